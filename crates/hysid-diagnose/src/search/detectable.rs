//! The least effects that a recording would have shown.

use super::candidate::Candidate;
use crate::evidence::{FeatureGroup, detectable_amplitude};
use crate::file::DetectableRecord;

/// The smallest effects that this recording would have shown.
pub fn detectability(candidates: &[Candidate]) -> Vec<DetectableRecord> {
    let count: usize = candidates.iter().map(|c| c.points.len()).sum();
    let mut out: Vec<DetectableRecord> = candidates
        .iter()
        .filter_map(|c| {
            let amplitude = c.refit.amplitudes.first()?;
            let point = c.points.iter().filter(|p| p.norm > 0.0).max_by(|a, b| a.norm.total_cmp(&b.norm))?;
            let group = FeatureGroup::of_norm(point.norm);
            let unit = c
                .refit
                .simulation
                .parameter(&amplitude.name)?
                .unit
                .as_ref()
                .map(ToString::to_string)
                .unwrap_or_default();
            let smallest = detectable_amplitude(&group, 1.0, count);
            smallest.is_finite().then(|| DetectableRecord {
                mechanism: c.mechanism.id.into(),
                slot: c.slot.label.clone(),
                smallest,
                unit,
            })
        })
        .collect();
    out.sort_by(|a, b| (&a.slot, &a.mechanism).cmp(&(&b.slot, &b.mechanism)));
    out.dedup_by(|a, b| a.mechanism == b.mechanism && a.slot == b.slot);
    out
}
