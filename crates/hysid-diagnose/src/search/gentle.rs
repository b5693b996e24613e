//! Strengths that the recording does not determine: of those that say as much as the likeliest, the gentlest.
//!
//! A tank that spills a little above a lower brim and one that lets nothing above a higher brim are one machine as long as the recording hardly reaches
//! it, and two on an input that fills the tank. A fit ends at either. What is written into a simulation must not be more violent than the recording
//! asks for: what it leaves out is then as it was before.

use crate::budget::Step;
use crate::model::base::Base;
use crate::model::hypothesis::{Hypothesis, Setting};

/// Shares of a strength from which a fit is tried.
const SHARES: [f64; 4] = [0.1, 0.03, 0.01, 0.003];
/// Share of a strength below which another one is gentler.
const GENTLER: f64 = 0.5;
/// Width of a strength's 95 % interval, over the strength, from which on the recording does not determine it.
const WIDE: f64 = 2.0;
/// Log likelihood within which a fit says as much.
const AS_GOOD: f64 = 0.5;
/// Iterations of a fit.
const ITERATIONS: usize = 8;

/// Takes the gentlest strengths of effects that begin beyond a knee, where their strength is not determined.
pub fn take_gentlest<'d>(setting: &Setting<'d>, h: &mut Hypothesis<'d>) {
    let knees = h.effects.iter().filter(|e| e.written.shapes.iter().any(|s| s.searched));
    let names: Vec<String> = knees.flat_map(|e| e.written.amplitudes.iter().map(|a| a.name.clone())).collect();
    for name in names {
        if setting.budget.omits(Step::Fits) {
            return;
        }
        if let Some(base) = gentlest(setting, &h.base, &name) {
            h.base = base;
            h.log_evidence = setting.evidence(&h.base);
        }
    }
}

fn gentlest<'d>(setting: &Setting<'d>, base: &Base<'d>, name: &str) -> Option<Base<'d>> {
    let strength = |b: &Base<'_>| b.model.place_of(name).map(|place| b.fit.theta[place].abs());
    let own = strength(base).filter(|s| *s > 0.0)?;
    let known = base.intervals().into_iter().find(|i| i.name == name)?;
    if known.ends.is_some_and(|[low, high]| high - low < WIDE * own) && !known.at_bound {
        return None;
    }
    let from = |share: f64| {
        let mut values = base.values();
        values.parameters.entry(name.to_owned()).and_modify(|x| *x *= share);
        setting.fit(base.model.simulation(), &values, Some(&base.whitener), 1, ITERATIONS)
    };
    let fits = SHARES.into_iter().filter_map(from);
    fits.filter(|b| b.log_likelihood > base.log_likelihood - AS_GOOD)
        .filter_map(|b| Some((strength(&b)?, b)))
        .filter(|(s, _)| *s < GENTLER * own)
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, b)| b)
}

#[cfg(test)]
pub mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::normal;
    use crate::search::fitting::refit;
    use crate::search::screen::screen;

    /// Two tanks of which the upper one spills a little above its brim, integrated by hand, with an overflow fitted from where the screening found it.
    pub fn with_a_spill(check: impl FnOnce(&Setting<'_>, &Hypothesis<'_>)) {
        let text = "[time]\nperiod_s = 1.0\nhold = \"zero\"\n[inputs]\nu = \"pump_V\"\n[parameters]\nkp = { value = 0.28, min = 0.1, max = 0.7, unit = \"cm/(s V)\" }\n\
                    a1 = { value = 0.45, min = 0.2, max = 1.3, unit = \"cm^0.5/s\" }\na2 = { value = 0.42, min = 0.2, max = 1.6, unit = \"cm^0.5/s\" }\n[states]\n\
                    h1 = { derivative = \"kp*u - a1*sqrt(max(h1, 0))\", initial = 9.0, unit = \"cm\" }\n\
                    h2 = { derivative = \"a1*sqrt(max(h1, 0)) - a2*sqrt(max(h2, 0))\", initial = 9.0, unit = \"cm\" }\n[outputs]\nh2_cm = \"h2\"\n";
        let original = Simulation::parse(text, "tanks.sim.toml").unwrap();
        let mut random = normal(9);
        // Two fillings that go a little beyond the brim.
        let levels: Vec<f64> = (0..20).map(|n| if n % 9 == 5 { 5.85 } else { 4.4 + 0.4 * random() }).collect();
        let u: Vec<f64> = (0..1200).map(|n| levels[n / 60]).collect();
        let (mut h1, mut h2, steps) = (9.0_f64, 9.0_f64, 50);
        let mut y = Vec::new();
        for u in &u {
            y.push(h2 + 0.04 * random());
            for _ in 0..steps {
                let (out, dt) = (0.45 * h1.max(0.0).sqrt(), 1.0 / f64::from(steps));
                h2 += dt * (out - 0.42 * h2.max(0.0).sqrt());
                h1 += dt * (0.28 * u - out - 0.05 * (h1 - BRIM).max(0.0));
            }
        }
        let data = recorded(&original, 1.0, [("pump_V", u), ("h2_cm", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let evidence = none.base.evidence();
        let found =
            screen(&none.base, &setting.original, &[], &evidence, &|m, s| m.id == "overflow" && s.label == "state:h1");
        check(&setting, &refit(&setting, &none, &found[0]).unwrap());
    }

    /// Level above which the upper tank spills, in centimetres.
    const BRIM: f64 = 12.5;

    #[test]
    fn what_is_not_determined_is_taken_gently() {
        with_a_spill(|setting, h| {
            let of = |b: &Base<'_>, name: &str| b.values().parameters[name];
            // As violent as it may be, and the brim where it is then.
            let mut from = h.base.values();
            from.parameters.insert("c_o".into(), 8.0);
            from.parameters.insert("s_max".into(), of(&h.base, "s_max") + 0.3);
            let violent = setting.fit(h.base.model.simulation(), &from, Some(&h.base.whitener), 1, 20).unwrap();
            assert!(of(&violent, "c_o") > 2.0);
            let likelihood = violent.log_likelihood;
            let mut taken = setting.hypothesis(h.effects.clone(), violent);
            take_gentlest(setting, &mut taken);
            assert!(of(&taken.base, "c_o") < 0.3 && taken.base.log_likelihood > likelihood - AS_GOOD);
            assert!((of(&taken.base, "s_max") - BRIM).abs() < 0.3);
        });
    }
}
