//! The finer form of a law: more terms of the same series, or a start of its own, where the recording is sharp enough to tell them.
//!
//! A hysteresis made of plays is a sum over as many as one likes. Three follow a loop that noise blurs; six follow one that stands far above the
//! noise, where what three leave would pass for another effect. The evidence decides, so that no recording pays for terms that it cannot tell.

use crate::budget::Step;
use crate::fitting::finish;
use crate::hypothesis::{Effect, Hypothesis, Setting};
use crate::mechanism::{Amplitude, Purpose};
use crate::model::Values;
use crate::screen::{rewrite_at, with_added_starts};

/// Log evidence that an effect must have brought before a finer form of its law is tried.
const WORTH_REFINING: f64 = 10.0;

/// The hypothesis with its last effect's law in its finer form, if there is one and it has more evidence.
pub fn finer<'d>(setting: &Setting<'d>, parent: &Hypothesis<'_>, h: &Hypothesis<'d>) -> Option<Hypothesis<'d>> {
    let effect = h.effects.last()?;
    let forms = [Purpose::Refit, Purpose::Finer].map(|purpose| (effect.mechanism.law)(&effect.slot, purpose));
    if forms[0] == forms[1] || h.log_evidence < parent.log_evidence + WORTH_REFINING || setting.budget.omits(Step::Fits)
    {
        return None;
    }
    let (base, label) = (&parent.base, &effect.slot.label);
    let (written, slot) =
        rewrite_at(base, &base.document(), &setting.original, effect.mechanism, label, Purpose::Finer)?;
    let coarse = h.base.values();
    let mut from = with_added_starts(&coarse, &written, &slot, setting.data.stretches.len());
    for p in &written.simulation.parameters {
        from.parameters.entry(p.name.clone()).and_modify(|x| *x = x.clamp(p.lower(), p.upper()));
    }
    for (name, value) in spread(&coarse, &effect.written.amplitudes, &written.amplitudes) {
        from.parameters.insert(name, value);
    }
    let fitted = setting.fit(&written.simulation, &from, Some(&h.base.whitener), 1, setting.iterations)?;
    let mut effects = parent.effects.clone();
    effects.push(Effect { written, slot, ..effect.clone() });
    let mut more = setting.hypothesis(effects, fitted);
    finish(setting, &mut more, parent.effects.len());
    (more.log_evidence > h.log_evidence).then_some(more)
}

/// Start values for a longer series of terms: those of the shorter one, each over as many terms as stand in its place.
fn spread(coarse: &Values, few: &[Amplitude], many: &[Amplitude]) -> Vec<(String, f64)> {
    let series = |a: &Amplitude| a.name.trim_end_matches(|c: char| c.is_ascii_digit()).to_owned();
    let value = |a: &Amplitude| coarse.parameters.get(&a.name).copied().unwrap_or(0.0);
    let mut out = Vec::new();
    for one in many {
        let old: Vec<&Amplitude> = few.iter().filter(|a| series(a) == series(one)).collect();
        let new: Vec<&Amplitude> = many.iter().filter(|a| series(a) == series(one)).collect();
        let place = new.iter().position(|a| a.name == one.name).unwrap_or(0) * old.len() / new.len().max(1);
        let shares = new.len() as f64 / old.len().max(1) as f64;
        out.extend(old.get(place).map(|a| (one.name.clone(), value(a) / shares)));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_weight_is_spread_over_the_terms_in_its_place() {
        let named = |names: &[&str]| -> Vec<Amplitude> {
            names.iter().map(|n| Amplitude { name: (*n).to_owned(), size: 1.0 }).collect()
        };
        let mut coarse = Values::default();
        for (name, value) in [("p_1", 0.2), ("p_2", 0.4), ("a_h", 0.7)] {
            coarse.parameters.insert(name.to_owned(), value);
        }
        let many = named(&["p_1", "p_2", "p_3", "p_4", "a_h", "q_1"]);
        let found = spread(&coarse, &named(&["p_1", "p_2", "a_h"]), &many);
        let expected = [("p_1", 0.1), ("p_2", 0.1), ("p_3", 0.2), ("p_4", 0.2), ("a_h", 0.7)];
        assert_eq!(found, expected.map(|(n, v)| (n.to_owned(), v)));
    }
}
