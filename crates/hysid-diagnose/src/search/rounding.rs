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
/// Part of a step that may be left beside the rounding (rms), which makes 0.29 of it itself: of two hundred samples one is rounded to the next step, since the
/// parameters are not known better.
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

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};
    use crate::request::{Hooks, Options};

    /// Whether the rounding to so many steps over the range of an oscillator's output is all that is left, with noise of this share of a step before it,
    /// and with this force besides.
    fn all(steps: f64, noise: f64, force: impl Fn(f64, f64) -> f64) -> bool {
        let mut random = normal(5);
        let u = drive(1500, &mut random);
        let y = respond(&u, REAL, force);
        let range = |y: &[f64]| y.iter().fold(0.0_f64, |m, y| m.max(*y)) - y.iter().fold(0.0_f64, |m, y| m.min(*y));
        let q = range(&y) / steps;
        let y: Vec<f64> = y.iter().map(|y| q * (y / q + noise * random()).round()).collect();
        assert!(rms(&y) > q);
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::Coloured, &budget);
        let hooks = Hooks { progress: &|_| {}, expired: &|_| false, accepted: &|| {} };
        let search = Search::new(setting, Options::default(), &hooks);
        let question = [(ROUNDING.to_owned(), "output:x_m".to_owned())];
        let set = search.answer(&none, &question.into());
        search.by_rounding(&none, &Vec::from_iter(set)).is_some()
    }

    #[test]
    fn a_fine_converter_alone_leaves_nothing_and_is_no_mismatch() {
        let nothing = |_: f64, _: f64| 0.0;
        assert!(all(150.0, 0.0, nothing));
        assert!(!all(150.0, 0.3, nothing), "steps beside a noise of their size");
        assert!(!all(20.0, 0.0, nothing), "stairs");
        assert!(!all(150.0, 0.0, |_, v| 0.3 * v.signum()), "dry friction besides");
    }
}
