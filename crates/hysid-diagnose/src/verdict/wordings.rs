//! One statement in several wordings: sets that say the same of a recording share one weight, so that they do not count twice against another family.

use super::weigh::NESTED_GAIN;
use crate::evidence::norm2;
use crate::model::hypothesis::Hypothesis;

/// Squared difference of two predictions, in units of the noise, and difference of their log evidence, below which no recording of this length
/// tells them apart.
const SAME: f64 = 1.0;
/// Log evidence by which a set may trail and its other wordings still matter.
const NEAR: f64 = 12.0;

/// How many sets say in other words what each one says: as many effects of the same families, and the same prediction. An offset of the input and
/// one of the sensor of a linear plant are one statement; told twice, they would count twice against another family.
pub fn wordings(pool: &[Hypothesis<'_>], winner: usize) -> Vec<usize> {
    let best = &pool[winner];
    let families: Vec<Vec<&str>> = pool.iter().map(Hypothesis::families).collect();
    let layout = &best.base.model.data().layout;
    let same = |a: &Hypothesis<'_>, b: &Hypothesis<'_>| {
        let difference: Vec<f64> = a.base.fit.residual.iter().zip(&b.base.fit.residual).map(|(a, b)| a - b).collect();
        norm2(&best.base.whitener.apply(layout, &difference)) < SAME
    };
    (0..pool.len())
        .map(|i| {
            let near = |j: usize| (pool[i].log_evidence - pool[j].log_evidence).abs() < SAME;
            if pool[i].log_evidence < best.log_evidence - NEAR {
                return 1;
            }
            let others = (0..pool.len()).filter(|&j| j != i && families[j] == families[i] && near(j));
            1 + others.filter(|&j| same(&pool[i], &pool[j])).count()
        })
        .collect()
}

/// Of each set the one of the same families that it comes down to, a law of it having gained nothing on another that it contains; itself where it
/// comes down to none.
pub fn collapses(pool: &[Hypothesis<'_>]) -> Vec<usize> {
    let special = |i: usize, j: usize| {
        let (wide, plain) = (&pool[i], &pool[j]);
        wide.effects.len() == plain.effects.len()
            && wide.base.log_likelihood - plain.base.log_likelihood < NESTED_GAIN
            && wide.effects.iter().enumerate().any(|(a, w)| {
                plain.effects.iter().enumerate().any(|(b, p)| {
                    w.mechanism.family == p.mechanism.family
                        && w.slot.label == p.slot.label
                        && w.mechanism.contains.contains(&p.mechanism.id)
                        && wide.key_without(a) == plain.key_without(b)
                })
            })
    };
    let likeliest = |i: usize| {
        let others = (0..pool.len()).filter(|&j| j != i && special(i, j));
        others.max_by(|&a, &b| pool[a].log_evidence.total_cmp(&pool[b].log_evidence)).unwrap_or(i)
    };
    (0..pool.len()).map(likeliest).collect()
}

/// Logarithms of weights where sets that come down to one share the weight of the likeliest of them: a loop that pinches nowhere and one that never
/// wears out are that loop, and say no more of it together than it does.
pub fn shared(logs: Vec<f64>, root: &[usize]) -> Vec<f64> {
    let of_group = |i: usize| logs.iter().zip(root).filter(move |(_, r)| **r == root[i]).map(|(l, _)| *l);
    let one = |i: usize| {
        let top = of_group(i).fold(f64::NEG_INFINITY, f64::max);
        let all: f64 = of_group(i).map(|l| (l - top).exp()).sum();
        if top.is_finite() { logs[i] - all.ln() } else { logs[i] }
    };
    (0..logs.len()).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::super::weigh::{log_weights, weigh};
    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};
    use crate::search::fitting::refit;
    use crate::search::screen::screen;
    use crate::verdict::Hypothesis as Weighed;
    use hysid_plant::Simulation;

    #[test]
    fn laws_that_come_down_to_one_weigh_what_it_does() {
        let logs = shared(vec![0.0, -1.0, -3.0, -0.5], &[0, 0, 0, 3]);
        let sum: f64 = logs[..3].iter().map(|l| l.exp()).sum();
        assert!((sum - 1.0).abs() < 1e-12 && logs[3] == -0.5, "{logs:?}");
        assert!((logs[0] - logs[1] - 1.0).abs() < 1e-12, "{logs:?}");
    }

    /// A small offset of a sensor and one of the input leave the same; a spring that bends says something else.
    #[test]
    fn an_offset_of_input_and_sensor_are_one_statement() {
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let mut random = normal(3);
        let u = drive(800, &mut random);
        let mut y = respond(&u, REAL, |_, _| 0.0);
        let noise = 0.02 * rms(&y);
        y.iter_mut().for_each(|y| *y += noise * (random() + 0.1));
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let wanted = ["input_offset", "output_offset", "cubic_stiffness"];
        let found = screen(&none.base, &setting.original, &[], &none.base.evidence(), &|m, _| wanted.contains(&m.id));
        let fitted = |id: &str| refit(&setting, &none, found.iter().find(|c| c.mechanism.id == id).unwrap()).unwrap();
        let mut pool: Vec<Hypothesis<'_>> = wanted.into_iter().map(fitted).collect();
        pool.push(none);
        assert_eq!(wordings(&pool, 0), [2, 2, 1, 1]);
        // Together they weigh what one alone does.
        let weigh_all = |pool: &[Hypothesis<'_>]| {
            let weighed: Vec<Weighed> = pool.iter().map(weigh).collect();
            log_weights(pool, &weighed, &vec![None; pool.len()], 0, 0.4)
        };
        let both = weigh_all(&pool);
        pool.remove(1);
        let alone = weigh_all(&pool);
        let sum = both[0] + (both[1] - both[0]).exp().ln_1p();
        assert!((sum - alone[0]).abs() < 0.2, "{both:?} {alone:?}");
    }
}
