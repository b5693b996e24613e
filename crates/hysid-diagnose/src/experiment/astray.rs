//! Whether a correction that is about to be written leads anywhere on inputs that were not recorded.

use hysid_plant::Simulation;

use super::fresh::{Change, answered, apart, changed, doubled, mirror_image, reversed, started};
use crate::data::DataSet;
use crate::model::base::Base;
use crate::model::hypothesis::Setting;

/// Times as far from the simulation as it is that a correction may lead on an input of the levels and the band of the recorded one as on that one itself, and on
/// one that is twice as large, where a cube is eight times as large.
const AS_FAR: f64 = 5.0;
const TWICE_AS_LARGE: f64 = 20.0;

/// Whether a corrected simulation goes where nothing is known of it as soon as the input is another one: generic terms that cancel along the recording need
/// not do so elsewhere, and some of them run away.
pub fn astray(setting: &Setting<'_>, plain: &Base<'_>, corrected: &Base<'_>) -> bool {
    let noise: Vec<f64> = corrected.whitener.models.iter().map(|m| m.noise_rms()).collect();
    leads_far(&started(plain), &started(corrected), setting.data, setting.substeps, &noise)
}

/// The same of simulations.
fn leads_far(plain: &Simulation, corrected: &Simulation, data: &DataSet, substeps: usize, noise: &[f64]) -> bool {
    let distance = |change: Change| {
        let drive = changed(data, change)?;
        // Where the simulation as it is runs away nobody knows how far is far.
        let as_it_is = answered(plain, &drive, substeps)?;
        let there = answered(corrected, &drive, substeps);
        Some(there.map_or(f64::INFINITY, |there| apart(&as_it_is, &there, noise).sqrt()))
    };
    let Some(own) = distance(<[f64]>::to_vec) else { return false };
    let elsewhere: [(Change, f64); 3] = [(mirror_image, AS_FAR), (reversed, AS_FAR), (doubled, TWICE_AS_LARGE)];
    elsewhere.into_iter().any(|(change, most)| distance(change).is_some_and(|d| d > most * own))
}

#[cfg(test)]
mod tests {
    use hysid_plant::Drive;

    use super::*;
    use crate::experiment::fresh::tests::drive;

    #[test]
    fn what_cancels_along_the_recording_only_leads_far() {
        // Pushed one way first, and never back to the other side of where it began.
        let u = (0..600).map(|n| if n < 300 { 1.0 } else { -0.3 }).collect();
        let recorded = Drive::new(0.0, 0.01, 600, vec![u]).unwrap();
        let data = DataSet::of_drive(recorded, vec![vec![0.0; 600]], 0.01);
        let far = |force: &str| leads_far(&drive(0.5, ""), &drive(0.5, force), &data, 4, &[1.0]);
        assert!(!far(" + 0.05*w") && !far(" + 0.01*w*abs(w)"));
        assert!(far(" + 0.01*w - 2*max(-q, 0)"), "a spring that pushes on the other side");
        assert!(far(" + 0.01*w - 40*min(w, 0)^2*q"), "and what runs away there");
    }
}
