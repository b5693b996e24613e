//! Whether all that is left is the rounding of a converter.
//!
//! A converter with fine steps is a part of how a machine was recorded and no physics of it: its rounding, and that of noise before it, is what noise there
//! is, and the recorded values lie on its steps. Where noise of another kind is behind it, steps that are coarser than that noise are an effect; so are steps so
//! coarse that the recording is stairs.
//!
//! Reference: B. Widrow, I. Kollár, Quantization Noise, Cambridge University Press (2008), ch. 1.

use hysid_signal::range;

use super::Search;
use super::compose::best_of;
use crate::mechanism::number_with_unit;
use crate::model::hypothesis::{Effect, Hypothesis};

/// What is rounded to steps that are told as an effect otherwise.
const ROUNDING: &str = "quantisation";
/// Part of a step by which values on the steps may miss them: the step itself is read off the values.
const OFF_A_STEP: f64 = 0.1;
/// Steps that the recording covers where they are fine.
const FINE: f64 = 64.0;
/// Share of what is left of another output that effects must not have taken from it.
const NOTHING: f64 = 0.05;

/// An effect that is the rounding of a fine converter.
pub struct Converter {
    /// Its place in the set.
    pub member: usize,
    /// The place of the output that it converts.
    output: usize,
    /// The column and the step, in words.
    words: String,
}

impl Converter {
    /// Several of them, in words.
    fn list(all: &[Self]) -> String {
        all.iter().map(|c| c.words.as_str()).collect::<Vec<_>>().join(" and ")
    }

    /// Why they are not told as effects.
    pub fn note(all: &[Self]) -> String {
        format!(
            "the rounding of the converter to the steps of {} is in the recording too, and is taken for its own: it is no physics that is missing",
            Self::list(all)
        )
    }
}

impl Search<'_, '_> {
    /// The members of a set that are the rounding of a fine converter on the steps of which the recorded values lie.
    pub fn converters(&self, set: &Hypothesis<'_>) -> Vec<Converter> {
        let values = set.base.values();
        let fine = |(member, effect): (usize, &Effect)| {
            let outputs = &self.setting.original.outputs;
            let place = outputs.iter().position(|o| effect.slot.label == format!("output:{}", o.column))?;
            let step = effect.written.report.first().filter(|_| effect.mechanism.id == ROUNDING)?;
            let q = *values.parameters.get(step.value.symbols().first()?)?;
            let recorded = || {
                let all = self.setting.data.stretches.iter().flat_map(|s| s.outputs[place].iter().copied());
                all.filter(|y| y.is_finite())
            };
            let (low, high) = range(recorded());
            let off = |y: f64| ((y - low) / q - ((y - low) / q).round()).abs();
            let own = high - low >= FINE * q && recorded().all(|y| off(y) <= OFF_A_STEP);
            let words = format!("`{}` ({})", outputs[place].column, number_with_unit(q, step.unit.as_ref()));
            own.then_some(Converter { member, output: place, words })
        };
        set.effects.iter().enumerate().filter_map(fine).collect()
    }

    /// What to tell where the rounding of fine converters is all that stands of the pool, and no set in it takes anything from the other outputs.
    pub fn by_rounding(&self, none: &Hypothesis<'_>, pool: &[Hypothesis<'_>]) -> Option<String> {
        let set = &pool[best_of(pool)?];
        let converters = self.converters(set);
        if set.effects.is_empty() || converters.len() < set.effects.len() {
            return None;
        }
        let rms = |h: &Hypothesis<'_>| self.setting.data.layout.rms(&h.base.fit.residual);
        let before = rms(none);
        let takes = |h: &Hypothesis<'_>| {
            let after = rms(h);
            let is_rounded = |output: &usize| converters.iter().any(|c| c.output == *output);
            (0..after.len()).filter(|i| !is_rounded(i)).any(|i| after[i] < (1.0 - NOTHING) * before[i])
        };
        (!pool.iter().any(takes)).then(|| {
            format!(
                "what is left is the rounding of the converter to the steps of {}: nothing else is in it, and it is taken for the noise of the recording",
                Converter::list(&converters)
            )
        })
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

    /// Whether the rounding to so many steps over the range of an oscillator's output is all that is left, with noise of these shares of a step before it
    /// and behind it, and with this force besides.
    fn all(steps: f64, [before, behind]: [f64; 2], force: impl Fn(f64, f64) -> f64) -> bool {
        let mut random = normal(5);
        let u = drive(1500, &mut random);
        let y = respond(&u, REAL, force);
        let range = |y: &[f64]| y.iter().fold(0.0_f64, |m, y| m.max(*y)) - y.iter().fold(0.0_f64, |m, y| m.min(*y));
        let q = range(&y) / steps;
        let mut converted = |y: &f64| q * ((y / q + before * random()).round() + behind * random());
        let y: Vec<f64> = y.iter().map(&mut converted).collect();
        assert!(rms(&y) > q);
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::Coloured, &budget);
        let search = Search::new(setting, Options::default(), &Hooks::SILENT);
        let asked = |id: &str, slot: &str| search.answer(&none, &vec![(id.to_owned(), slot.to_owned())]);
        let sets = [asked(ROUNDING, "output:x_m"), asked("coulomb_friction", "state:v")];
        search.by_rounding(&none, &Vec::from_iter(sets.into_iter().flatten())).is_some()
    }

    #[test]
    fn a_fine_converter_alone_leaves_nothing_and_is_no_mismatch() {
        let nothing = |_: f64, _: f64| 0.0;
        assert!(all(150.0, [0.0, 0.0], nothing));
        assert!(all(150.0, [0.25, 0.0], nothing), "noise that is rounded too");
        assert!(!all(150.0, [0.0, 0.3], nothing), "steps beside a noise of their size");
        assert!(!all(20.0, [0.0, 0.0], nothing), "stairs");
        assert!(!all(150.0, [0.0, 0.0], |_, v| 0.3 * v.signum()), "dry friction besides");
    }
}
