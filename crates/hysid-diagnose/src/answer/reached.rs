//! Limits that are written alike on both sides, of which a recording shows one.

use crate::mechanism::Purpose;
use crate::model::hypothesis::{Effect, Hypothesis};
use crate::slot::{Place, Target};

/// What is taken for granted of the limits of a set: that they lie as far on the side that the recording never reached.
pub fn one_sided(h: &Hypothesis<'_>) -> Vec<String> {
    h.effects.iter().filter_map(|e| words(h, e)).collect()
}

/// Share of a limit at which it is reached: a signal that is cut off stands at it.
const AT: f64 = 1.0 - 1e-9;

fn words(h: &Hypothesis<'_>, effect: &Effect) -> Option<String> {
    let (mechanism, slot) = (effect.mechanism, &effect.slot);
    if effect.written.purpose != Purpose::Refit || !effect.is_a_limit() {
        return None;
    }
    let limit = h.base.values().parameters.get(&effect.written.shapes.first()?.name).copied()?;
    let signal = signal(h, slot.place, &slot.target)?;
    let (above, below) = (signal.iter().any(|x| *x >= AT * limit), signal.iter().any(|x| *x <= -AT * limit));
    let (seen, unseen) = match (above, below) {
        (true, false) => ("upper", "lower"),
        (false, true) => ("lower", "upper"),
        _ => return None,
    };
    Some(format!(
        "{}: the recordings reach the {seen} limit only; that the {unseen} one at {slot} lies as far on the other side is taken for granted",
        mechanism.id
    ))
}

/// What is limited: a recorded input, or an output as the fitted simulation has it.
fn signal(h: &Hypothesis<'_>, place: Place, target: &Target) -> Option<Vec<f64>> {
    let data = h.base.model.data();
    let simulation = h.base.model.simulation();
    match (place, target) {
        (Place::Input | Place::Prescribed, Target::Symbol(symbol)) => {
            let at = simulation.inputs.iter().position(|i| i.symbol == *symbol)?;
            Some(data.stretches.iter().flat_map(|s| s.drive.inputs()[at].iter().copied()).collect())
        }
        (Place::Sensor, Target::Output(column)) => {
            let at = simulation.outputs.iter().position(|o| o.column == *column)?;
            let prediction = h.base.prediction();
            let series = data.layout.series.iter().filter(|s| s.output == at);
            Some(series.flat_map(|s| &prediction[s.rows.clone()]).copied().collect())
        }
        _ => None,
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
    use crate::search::fitting::refit;
    use crate::search::screen::screen;

    /// What is told of a limit of the input at 1.2 times its rms where what is negative of it is smaller by this factor.
    fn told(smaller: f64) -> Vec<String> {
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let mut random = normal(11);
        let u = drive(900, &mut random);
        let limit = 1.2 * rms(&u);
        let u: Vec<f64> = u.into_iter().map(|u| if u < 0.0 { smaller * u } else { u }).collect();
        let cut: Vec<f64> = u.iter().map(|u| u.clamp(-limit, limit)).collect();
        let mut y = respond(&cut, REAL, |_, _| 0.0);
        let noise = 0.03 * rms(&y);
        y.iter_mut().for_each(|y| *y += noise * random());
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let evidence = none.base.evidence();
        let found = screen(&none.base, &setting.original, &[], &evidence, &|m, _| m.id == "input_saturation");
        let h = refit(&setting, &none, &found[0]).unwrap();
        one_sided(&h)
    }

    #[test]
    fn a_limit_that_was_never_reached_is_taken_for_granted_in_words() {
        assert!(told(1.0).is_empty());
        let words = told(0.3);
        assert!(words.len() == 1 && words[0].contains("upper limit only") && words[0].contains("input:u"), "{words:?}");
    }
}
