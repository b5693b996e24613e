//! Hysteresis of an actuator with a general weight over its turning points.

use super::plays::{Plays, density, widths};
use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose, anywhere};
use crate::slot::Place;

/// Plays that are bent each on its own: each has three amplitudes, and twice as many follow one recording and no other.
const PLAYS: usize = 3;

/// The law with the input's reach, by which levels are scaled, and the largest level that the recording has.
fn scaled(law: Law) -> Law {
    law.constant("u_r", "u", Grid::Reach("u", vec![1.0])).constant("u_m", "u", Grid::Quantiles("u", vec![1.0]))
}

/// A law with a weight that is normal over the level and over the half-width of the loops: each play along a curve that levels off. Beyond the levels
/// at which there are loops nothing is left of it, as in iron that is saturated.
fn normal(purpose: Purpose, text: impl Fn(&str) -> String) -> Law {
    let about = matches!(purpose, Purpose::Form(Form::Finer | Form::FinerUnsettled));
    let plays = Plays(match purpose {
        Purpose::Form(Form::Unsettled | Form::FinerUnsettled) => Purpose::Form(Form::Unsettled),
        _ => Purpose::Refit,
    });
    // Half-widths about zero, or about the field at which most of it turns.
    let middle = about.then_some("r_0");
    // The integral of a normal weight of width `u_c` over the level, to a thousandth of it.
    let level = |(share, r): (String, String)| format!("{share}*tanh(1.6*sinh(0.7075*{}/u_c))", plays.play(&r));
    let sum: Vec<String> = density(middle).map(level).collect();
    let law = plays.moved(Law::replace(text(&sum.join(" + "))));
    let law = widths(law).shape("u_c", "u", Grid::Reach("u", vec![0.1, 0.4]));
    if about { law.shape("r_0", "u", Grid::Reach("u", vec![0.1, 0.3])) } else { law }
}

/// Hysteresis of an actuator with a general weight over its turning points.
pub static PREISACH: Mechanism = Mechanism {
    id: "preisach",
    family: Family::ActuatorHysteresis,
    block: Block::Hysteresis,
    places: &[Place::Input, Place::Command, Place::Curve],
    applies: anywhere,
    already: &["play(u, R)", "play(u + P, R)", "relay(u, P, Q)"],
    law: |slot, purpose| {
        if slot.place == Place::Curve {
            let law = normal(purpose, |sum| format!("y + F_h*({sum})"));
            return law.amplitude("F_h", "y", 0.0, 5.0);
        }
        if purpose == Purpose::Form(Form::Other) {
            return normal(purpose, |sum| format!("u + p*(u_c*({sum}) - u)")).amplitude("p", "1", -0.2, 1.5);
        }
        // Preisach's model in play coordinates: a curved function of each play, which goes on as a straight line beyond what the recording
        // reached: a polynomial that runs on is no model of a hysteresis.
        let within = |play: &str| format!("max(min({play}, u_m), -u_m)");
        // Each play bent on its own, to the third degree.
        if let Purpose::Form(Form::Few) = purpose {
            let plays = Plays(purpose);
            let curved = |i: usize| {
                let play = plays.play(&format!("r_{i}"));
                format!(" + {play}*(q_{i}*{w}/u_r + s_{i}*{w}^2/u_r^2)", w = within(&play))
            };
            let bent: String = (1..=PLAYS).map(curved).collect();
            let law = scaled(plays.law(format!("{}{bent}", plays.simply())));
            return (1..=PLAYS).fold(law, |law, i| {
                law.amplitude(format!("q_{i}"), "1", -1.0, 1.0).amplitude(format!("s_{i}"), "1", -1.0, 1.0)
            });
        }
        // Alike for all plays: the density is a product of a function of the half-width and one of the level.
        let unsettled = Purpose::Form(Form::Unsettled);
        let plays = Plays(if purpose == unsettled { unsettled } else { Purpose::Refit });
        let square = purpose == Purpose::Form(Form::Finer);
        let curved = |(share, r): (String, String)| {
            let play = plays.play(&r);
            let w = within(&play);
            let second = if square { format!(" + s*{share}*{play}*{w}^2/u_r^2") } else { String::new() };
            format!(" + q*{share}*{play}*{w}/u_r{second}")
        };
        let bent: String = density(None).map(curved).collect();
        let law = scaled(plays.law(format!("{}{bent}", plays.simply()))).amplitude("q", "1", -5.0, 5.0);
        if square { law.amplitude("s", "1", -5.0, 5.0) } else { law }
    },
    contains: &["prandtl_ishlinskii", "backlash"],
    confusable: &["prandtl_ishlinskii", "asymmetric_hysteresis"],
    needs: &[Need::Turns(12), Need::Levels("u", 1.5)],
    sentence: "The actuator {place} has a rate-independent hysteresis loop whose shape depends on the level (Preisach).",
    signature: "A loop at any rate with wiping out; loops at different bias are congruent but not the same.",
    reference: "I. D. Mayergoyz, Mathematical Models of Hysteresis and Their Applications (2003); M. Brokate, J. Sprekels, Hysteresis and Phase Transitions (1996), sec. 2.4",
};

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use hysid_plant::Simulation;

    use super::super::plays::tests::response;
    use super::*;
    use crate::mechanism::Signals;
    use crate::mechanism::conformance::specimens;
    use crate::slot::{Slot, Structure};

    /// A simulation with the law at a place of this kind, whose input reaches 900.
    fn written(title: &str, place: Place, purpose: Purpose, values: &[(&str, f64)]) -> Simulation {
        let simulation = specimens().into_iter().find(|s| s.title.starts_with(title)).unwrap();
        let at = |s: &Slot| s.place == place;
        let slot = PREISACH.slots(&Structure::of(&simulation)).into_iter().find(at).unwrap();
        let signals = Signals::new(0.01, 0.0, BTreeMap::from([("u".to_owned(), vec![-900.0, 900.0, -900.0, 900.0])]));
        let mut written = PREISACH.rewrite(&simulation, &slot, &signals, purpose).unwrap().simulation;
        for (name, value) in values {
            written.parameter_mut(name).unwrap_or_else(|| panic!("{purpose:?} has no {name}")).value = *value;
        }
        written
    }

    /// Fields that turn at ever other values.
    fn field() -> Vec<f64> {
        (0..600)
            .map(f64::from)
            .map(|i| 850.0 * (0.05 * i).sin() * (0.0061 * i).cos() + 40.0 * (0.31 * i).sin())
            .collect()
    }

    #[test]
    fn normal_weights_are_those_of_relays() {
        // Twelve half-widths as the law has them, and levels in small steps, each relay followed by its thresholds.
        let (size, width, level, step) = (0.3, 250.0, 180.0, 1.0);
        for (form, middle) in [(Purpose::Refit, 0.0), (Purpose::Form(Form::Finer), 150.0)] {
            let mut values = vec![("F_h", size), ("r_d", width), ("u_c", level)];
            if form != Purpose::Refit {
                values.push(("r_0", middle));
            }
            let h = field();
            let with = response(&written("Magnetic core", Place::Curve, form, &values), &h);
            let without = response(&written("Magnetic core", Place::Curve, form, &[("F_h", 0.0)]), &h);
            let mut expected = vec![0.0; h.len()];
            for cell in 0..12 {
                let r = 75.0 * (f64::from(cell) + 0.5);
                let share = (-((r - middle) / width).powi(2)).exp() / 12.0;
                for i in -800..=800 {
                    let s = step * (f64::from(i) + 0.5);
                    let weight = (-(s / level).powi(2)).exp() * step / (level * std::f64::consts::PI.sqrt());
                    let mut up = s < 0.0;
                    for (sum, h) in expected.iter_mut().zip(&h) {
                        up = if *h > s + r {
                            true
                        } else if *h < s - r {
                            false
                        } else {
                            up
                        };
                        *sum += size * share * weight * if up { 1.0 } else { -1.0 };
                    }
                }
            }
            for (i, ((with, without), expected)) in with.iter().zip(&without).zip(&expected).enumerate() {
                assert!(
                    (with - without - expected).abs() < 0.01 * size,
                    "{form:?} at {i}: {with} {without} {expected}"
                );
            }
        }
    }

    #[test]
    fn before_the_plant_the_same_weights_take_the_place_of_the_input() {
        let u: Vec<f64> = field();
        let values = [("p", 0.4), ("r_d", 250.0), ("u_c", 180.0)];
        let own = response(&written("Piezo actuator", Place::Input, Purpose::Form(Form::Other), &values), &u);
        let beside = [("F_h", 1.0), ("r_d", 250.0), ("u_c", 180.0)];
        let with = response(&written("Magnetic core", Place::Curve, Purpose::Refit, &beside), &u);
        let without = response(&written("Magnetic core", Place::Curve, Purpose::Refit, &[("F_h", 0.0)]), &u);
        for (i, u) in u.iter().enumerate() {
            let expected = 0.1 * (0.6 * u + 0.4 * 180.0 * (with[i] - without[i]));
            assert!((own[i] - expected).abs() < 1e-9, "{i}: {} for {expected}", own[i]);
        }
    }
}
