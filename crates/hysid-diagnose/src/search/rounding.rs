//! Whether all that is left is the rounding of a converter.
//!
//! A converter with fine steps is a part of how a machine was recorded and no physics of it: its rounding is what noise there is. Where
//! noise of another kind is beside it, steps that are coarser than that noise are an effect; so are steps so coarse that the recording is stairs.
//!
//! Reference: B. Widrow, I. Kollár, Quantization Noise, Cambridge University Press (2008), ch. 1.

use super::Search;
use crate::mechanism::number_with_unit;
use crate::model::hypothesis::Hypothesis;

/// What is rounded to steps that are told as an effect otherwise.
const ROUNDING: &str = "quantisation";
/// Part of a step that may be left beside the rounding (rms), which makes 0.29 of it itself.
const BESIDE: f64 = 0.07;
/// Steps that the recording covers where they are fine.
const FINE: f64 = 64.0;
/// Share of what is left of another output that effects must not have taken from it.
const NOTHING: f64 = 0.05;

impl Search<'_, '_> {
    /// What to tell where the simulation as it is, rounded as a converter with fine steps does it, leaves next to nothing, and no set in the pool
    /// takes anything from the other outputs.
    pub fn by_rounding(&self, none: &Hypothesis<'_>, pool: &[Hypothesis<'_>]) -> Option<String> {
        let rounded =
            |h: &&Hypothesis<'_>| !h.effects.is_empty() && h.effects.iter().all(|e| e.mechanism.id == ROUNDING);
        let set = pool.iter().filter(rounded).max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))?;
        let data = self.setting.data;
        let rms = |h: &Hypothesis<'_>| data.layout.rms(&h.base.fit.residual);
        let (before, after, values) = (rms(none), rms(set), set.base.values());
        let mut told = Vec::new();
        for (i, output) in self.setting.original.outputs.iter().enumerate() {
            let label = format!("output:{}", output.column);
            let Some(effect) = set.effects.iter().find(|e| e.slot.label == label) else {
                let taken = |h: &Hypothesis<'_>| rms(h)[i] < (1.0 - NOTHING) * before[i];
                if pool.iter().any(taken) {
                    return None;
                }
                continue;
            };
            let step = effect.written.report.first()?;
            let q = *values.parameters.get(step.value.symbols().first()?)?;
            let recorded = data.stretches.iter().flat_map(|s| s.outputs[i].iter().copied()).filter(|y| y.is_finite());
            let (low, high) = recorded.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(y), h.max(y)));
            if after[i] > BESIDE * q || high - low < FINE * q {
                return None;
            }
            told.push(format!("`{}` ({})", output.column, number_with_unit(q, step.unit.as_ref())));
        }
        Some(format!(
            "what is left is the rounding of the converter to the steps of {}: nothing else is in it, and it is taken for the noise of the recording",
            told.join(" and ")
        ))
    }
}
