//! Whether the strength of an effect depends on where the machine stands or on how fast it moves: friction that is larger at one end of a
//! guide, say. The catalogue names laws of one strength throughout. A recording that sees a law can often not see that much of it; then the
//! name is one of several that fit, and the others are not in the catalogue.
//!
//! The strength is multiplied by `1 + a g`, with `g` a function of the motion of mean zero and variance one, and `a` unknown: a normal variable of
//! mean zero and standard deviation one beforehand. By the tangent of the fitted simulation the odds against `a = 0` are in closed form
//! (the ratio of Savage and Dickey for a linear model), and they pay for `a` by what the recording says of it, not by its number of samples.
//!
//! Reference: I. Verdinelli, L. Wasserman, Computing Bayes factors using a generalization of the Savage-Dickey density ratio, JASA 90 (1995).

use hysid_linalg::dot;
use hysid_plant::Expr;

use crate::evidence::norm2;
use crate::model::along;
use crate::model::base::{Base, NoiseKind};
use crate::model::hypothesis::Effect;
use crate::text::number;

use super::varying::modulation::Modulated;
use super::view::View;

/// Odds beforehand that a law's strength is not the same everywhere. On development cases a single law that was named firmly at a level below
/// the noise was one of the catalogue in nine of ten.
const BEFOREHAND: f64 = 0.1;
/// A modulation of which the simulation's own parameters take up all but this share (squared norms) is another value of theirs, no other law:
/// dry friction that grows with the speed is dry friction beside more viscous friction.
const VISIBLE: f64 = 1e-3;

/// A strength that may depend on the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uneven {
    /// The probability that it does.
    pub probability: f64,
    /// The dependence that speaks loudest, as people say it.
    pub on: &'static str,
}

/// A gain in log likelihood beyond which nothing is more certain, so that odds stay numbers.
const CERTAIN: f64 = 300.0;
/// Below this probability nothing is said of it.
const WORTH_SAYING: f64 = 0.05;

impl Uneven {
    /// The same where an effect of such a support, from which this was taken already, is told with another probability: the dependence keeps its share of
    /// what the effect leaves, so that the two never sum to more than one.
    pub fn beside(self, support: f64, probability: f64) -> Self {
        let share = (1.0 - probability) / (1.0 - support).max(f64::MIN_POSITIVE);
        Self { probability: (self.probability * share).min(1.0), ..self }
    }

    /// In words, of an effect; `None` where it is too unlikely to be said.
    pub fn words(&self, e: &Effect) -> Option<String> {
        (self.probability >= WORTH_SAYING).then(|| {
            let Self { probability, on } = self;
            format!(
                "with a probability of {} the strength of {} at {} depends on {on}",
                number(*probability),
                e.mechanism.id,
                e.slot.label
            )
        })
    }
}

/// Whether the strength of each effect of a fitted set depends on the motion; `None` where nothing moves along it, or where nothing of it could be seen.
pub fn uneven(base: &Base<'_>, kind: NoiseKind, effects: &[Effect]) -> Vec<Option<Uneven>> {
    let of = |e: &Effect| {
        let [x, v] = ["x", "v"].map(|n| e.slot.quantity(n).map(|q| q.expression.clone()));
        let names: Vec<String> = e.written.amplitudes.iter().map(|a| a.name.clone()).collect();
        of_strengths(base, kind, &names, &[x?, v?])
    };
    effects.iter().map(of).collect()
}

/// The same of strengths by their names, which one factor multiplies, along a displacement and a velocity.
fn of_strengths(base: &Base<'_>, kind: NoiseKind, names: &[String], motion: &[Expr; 2]) -> Option<Uneven> {
    let data = base.model.data().with_still_inputs(names.len());
    let machine = Modulated::new(base, names, &data)?;
    let motion = along(base, motion)?;
    let view = View::new(base, &base.whitener);
    let variance = norm2(&view.r) / view.r.len().max(1) as f64;
    let weight = kind.share() / variance.max(f64::MIN_POSITIVE);
    let courses = [
        ("the position", standardised(&motion[0], |x| x)),
        ("the square of the position", standardised(&motion[0], |x| x * x)),
        ("the speed", standardised(&motion[1], f64::abs)),
    ];
    let factor = |course: Vec<Vec<f64>>| {
        let requests: Vec<_> = (0..names.len()).map(|k| (k, course.clone())).collect();
        let parts: Vec<Vec<f64>> = machine.responses(&requests).into_iter().collect::<Option<_>>()?;
        let whole = parts.into_iter().reduce(|mut sum, part| {
            sum.iter_mut().zip(part).for_each(|(s, p)| *s += p);
            sum
        })?;
        let (plain, column) = view.column(&whole);
        let information = norm2(&column);
        (information > VISIBLE * plain)
            .then(|| bayes_factor(weight * dot(&column, &view.r), weight * information))
            .filter(|f| f.is_finite())
    };
    let factors: Vec<(&str, f64)> =
        courses.into_iter().filter_map(|(on, course)| Some((on, factor(course?)?))).collect();
    let (on, _) = *factors.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let odds = BEFOREHAND * factors.iter().map(|f| f.1).sum::<f64>() / factors.len() as f64;
    Some(Uneven { probability: odds / (1.0 + odds), on })
}

/// A function of a series with mean zero and variance one; `None` where it does not vary.
fn standardised(x: &[Vec<f64>], f: impl Fn(f64) -> f64) -> Option<Vec<Vec<f64>>> {
    let values: Vec<Vec<f64>> = x.iter().map(|s| s.iter().map(|v| f(*v)).collect()).collect();
    let count = values.iter().map(Vec::len).sum::<usize>().max(1) as f64;
    let mean = values.iter().flatten().sum::<f64>() / count;
    let sd = (values.iter().flatten().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt();
    (sd > 0.0 && sd.is_finite()).then(|| values.iter().map(|s| s.iter().map(|v| (v - mean) / sd).collect()).collect())
}

/// Evidence for a linear coefficient that is standard normal beforehand over that for zero, from the score and the information at zero.
fn bayes_factor(score: f64, information: f64) -> f64 {
    (0.5 * score * score / (1.0 + information)).min(CERTAIN).exp() / (1.0 + information).sqrt()
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;
    use hysid_signal::{Channel, Clock, Recording};

    use super::*;
    use crate::budget::Budget;
    use crate::data::DataSet;
    use crate::model::hypothesis::calibrated;
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};

    /// What an oscillator with dry friction, whose level is multiplied by a function of the position, looks like to a simulation that has dry friction.
    fn found(seed: u64, factor: fn(f64) -> f64, noise: f64) -> Uneven {
        let mut random = normal(seed);
        let u = drive(1500, &mut random);
        let plain = rms(&respond(&u, REAL, |_, _| 0.0));
        let level = 0.1 * rms(&u);
        let mut y = respond(&u, REAL, |x, v| level * factor(x / plain) * (v / (0.01 * plain)).tanh());
        let size = noise * rms(&y);
        y.iter_mut().for_each(|y| *y += size * random());
        let channels = vec![Channel { name: "u_N".into(), samples: u }, Channel { name: "x_m".into(), samples: y }];
        let recording = Recording::new("est.csv", Clock { start_s: 0.0, period_s: PERIOD }, channels).unwrap();
        let text = BASELINE.replace("- k*x)/m", "- k*x - F*sign(v))/m").replace(
            "[states]",
            &format!("F = {{ value = {level}, min = 0.0, max = {}, unit = \"N\" }}\n[states]", 10.0 * level),
        );
        let simulation = Simulation::parse(&text, "test.sim.toml").unwrap();
        let data = DataSet::new(&simulation, &[recording], 3).unwrap();
        let budget = Budget::new(&|_| false);
        let (_, fit) = calibrated(simulation, &data, NoiseKind::Coloured, &budget);
        let motion = ["x", "v"].map(Expr::symbol);
        of_strengths(&fit.base, NoiseKind::Coloured, &["F".to_owned()], &motion).unwrap()
    }

    #[test]
    fn a_level_that_depends_on_the_position_is_told_from_one_that_does_not() {
        for seed in 0..4 {
            let same = found(seed, |_| 1.0, 0.02);
            assert!(same.probability < 0.05, "{seed}: {same:?}");
            let slanted = found(seed, |x| 1.0 + 0.5 * x, 0.02);
            assert!(slanted.probability > 0.99 && slanted.on == "the position", "{seed}: {slanted:?}");
        }
        let humped = found(9, |x| 1.0 + 0.5 * x * x, 0.02);
        assert!(humped.probability > 0.99 && humped.on == "the square of the position", "{humped:?}");
    }

    #[test]
    fn an_effect_and_the_dependence_of_its_strength_sum_to_one_at_most() {
        for dependence in [0.0, 0.03, 0.4, 0.97, 1.0] {
            for own in [0.0, 0.2, 0.9, 1.0] {
                let support = own * (1.0 - dependence);
                for told in [0.0, 0.1, support, 0.89, 1.0] {
                    let beside = Uneven { probability: dependence, on: "the speed" }.beside(support, told);
                    assert!(told + beside.probability <= 1.0 + 1e-12, "{dependence} {own} {told}: {beside:?}");
                }
            }
        }
        let kept = Uneven { probability: 0.1, on: "the speed" }.beside(0.6, 0.6);
        assert!((kept.probability - 0.1).abs() < 1e-15, "a support that is not mapped leaves it as it was");
    }

    #[test]
    fn noise_leaves_the_probability_that_was_there_beforehand() {
        let blind = found(1, |x| 1.0 + 0.5 * x, 3.0).probability;
        assert!((blind - BEFOREHAND / (1.0 + BEFOREHAND)).abs() < 0.03, "{blind}");
    }

    #[test]
    fn the_bayes_factor_is_the_integral_over_what_was_thought_beforehand() {
        for (score, information) in [(0.0, 4.0), (3.0, 4.0), (-7.0, 9.0), (0.5, 0.1)] {
            let h = 1e-3;
            let integral: f64 = (-12_000..=12_000)
                .map(|i| {
                    let a = f64::from(i) * h;
                    (score * a - 0.5 * information * a * a - 0.5 * a * a).exp() * h
                })
                .sum::<f64>()
                / std::f64::consts::TAU.sqrt();
            assert!((bayes_factor(score, information) / integral - 1.0).abs() < 1e-6, "{score} {information}");
        }
    }
}
