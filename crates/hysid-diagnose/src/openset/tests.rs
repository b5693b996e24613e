//! Corrections of simulations in which something of no mechanism is missing.

use hysid_plant::{Compiled, Drive, Expr, Run, Simulation};

use super::*;
use crate::budget::Budget;
use crate::model::hypothesis::{calibrated, lacking_a_law, recorded};
use crate::oscillator::{drive, normal, rms};

const PERIOD: f64 = 0.02;
const CRANE: &str = "[time]\nperiod_s = 0.02\n[inputs]\na = \"trolley_m_s2\"\n[parameters]\nL = { value = 3.0, min = 1.0, max = 9.0, unit = \"m\" }\n\
                     fr = { value = 0.9, min = 0.3, max = 3.0, unit = \"Hz\" }\n[states]\nth = { derivative = \"w\", initial = 0.0, unit = \"rad\" }\n\
                     w = { derivative = \"-(9.81*sin(th) + a)/L - 0.1*w\", initial = 0.0, unit = \"rad/s\" }\n\
                     s = { derivative = \"sd\", initial = 0.0, unit = \"m\" }\nsd = { derivative = \"-(2*pi*fr)^2*s - 0.8*sd\", initial = 0.0, unit = \"m/s\" }\n\
                     [outputs]\nswing_rad = \"th\"\nstretch_m = \"s\"\n";

/// What is said to be missing in the simulation of a load on an elastic rope, where this stands in the equation of the rope.
fn missing(coupling: &str) -> Option<OpenSet> {
    missing_in(|truth| {
        let elastic = truth.state("sd").unwrap().derivative.to_string();
        truth.state_mut("sd").unwrap().derivative = Expr::parse(&format!("{elastic}{coupling}")).unwrap();
    })
}

/// The same where the machine is this other one.
fn missing_in(change: impl Fn(&mut Simulation)) -> Option<OpenSet> {
    let original = Simulation::parse(CRANE, "crane.sim.toml").unwrap();
    let mut truth = original.clone();
    change(&mut truth);
    let mut random = normal(3);
    let a: Vec<f64> = drive(1500, &mut random);
    let size = 1.5 / rms(&a);
    let a: Vec<f64> = a.into_iter().map(|x| size * x).collect();
    let compiled = Compiled::new(&truth).unwrap();
    let run = Drive::new(0.0, PERIOD, a.len(), vec![a.clone()]).unwrap();
    let mut outputs = compiled.simulate(&Run::new(&run, &compiled.theta())).outputs;
    let noise = [0.01 * rms(&outputs[0]), 0.002];
    for (y, noise) in outputs.iter_mut().zip(noise) {
        y.iter_mut().for_each(|y| *y += noise * random());
    }
    let [swing, stretch] = <[Vec<f64>; 2]>::try_from(outputs).unwrap();
    let data = recorded(&original, PERIOD, [("trolley_m_s2", a), ("swing_rad", swing), ("stretch_m", stretch)]);
    let budget = Budget::new(&|_| false);
    let (_, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
    correction(&none.base, NoiseKind::White(1.0))
}

#[test]
fn what_moves_elsewhere_is_seen() {
    // The centrifugal force of the swing; nothing moves the rope in the simulation as it is, and its own parameter has no influence.
    let found = missing(" + 3.0*w^2").unwrap();
    let first = &found.record.terms[0];
    assert_eq!((found.record.slot.as_str(), first.term.as_str()), ("state:sd", "w^2"), "{:?}", found.record.terms);
    assert!((first.coefficient / 3.0 - 1.0).abs() < 0.05 && found.gain > 50.0, "{first:?} {}", found.gain);
    assert_eq!(found.record.signature.side, "plant");
    // The sway of the rope with the swing, in proportion: no parameter of the simulation does that.
    let found = missing(" + 0.4*w").unwrap();
    let first = &found.record.terms[0];
    assert_eq!((found.record.slot.as_str(), first.term.as_str()), ("state:sd", "w"), "{:?}", found.record.terms);
    assert!((first.coefficient / 0.4 - 1.0).abs() < 0.05 && found.gain > 50.0, "{first:?} {}", found.gain);
    // As on a linkage: a lever that depends on where the other part stands.
    let found = missing(" + 20.0*th*w^2").unwrap();
    let first = &found.record.terms[0];
    assert_eq!((found.record.slot.as_str(), first.term.as_str()), ("state:sd", "th*w^2"), "{:?}", found.record.terms);
    assert!((first.coefficient / 20.0 - 1.0).abs() < 0.1 && found.gain > 50.0, "{first:?} {}", found.gain);
    let nothing = missing("");
    assert!(nothing.is_none_or(|o| o.by_chance(ODDS_AGAINST) > 0.1));
}

#[test]
fn what_a_sensor_shows_of_what_it_does_not_measure_is_seen() {
    // Of another sensor, of the input, and of a state that no sensor shows.
    for (output, measured, passed, share) in
        [("stretch_m", "s", "swing_rad", 0.02), ("swing_rad", "th", "a", 0.01), ("stretch_m", "s", "w", 0.01)]
    {
        let shown = if passed == "swing_rad" { "th" } else { passed };
        let found = missing_in(|truth| {
            let mixed = Expr::parse(&format!("{measured} + {share}*{shown}")).unwrap();
            truth.output_mut(output).unwrap().expression = mixed;
        });
        let OpenSet { record, gain, .. } = found.unwrap();
        let first = &record.terms[0];
        let told = (record.slot.as_str(), first.term.as_str(), record.signature.side.as_str());
        assert_eq!(told, (format!("output:{output}").as_str(), passed, "output"), "{:?}", record.terms);
        assert!((first.coefficient / share - 1.0).abs() < 0.05 && gain > 50.0, "{first:?} {gain}");
    }
}

/// What is said to be missing in a simulation, where a state of the truth has another derivative and the one output a noise of this share.
fn seen(text: &str, law: (&str, &str), drive: (&str, Vec<f64>), noise: (f64, &mut dyn FnMut() -> f64)) -> OpenSet {
    let original = Simulation::parse(text, "test.sim.toml").unwrap();
    let data = lacking_a_law(&original, law, PERIOD, drive, noise);
    let budget = Budget::new(&|_| false);
    let (_, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
    correction(&none.base, NoiseKind::White(1.0)).unwrap()
}

/// A fin that turns no faster than its drive can: the equation of the fin has no slot of the catalogue.
#[test]
fn a_rate_that_is_limited_is_seen() {
    let text = "[time]\nperiod_s = 0.02\n[inputs]\ndc = \"command_deg\"\n[parameters]\nta = { value = 0.06, min = 0.01, max = 0.6, unit = \"s\" }\n\
                tr = { value = 0.4, min = 0.1, max = 2.0, unit = \"s\" }\n[states]\nfin = { derivative = \"(dc - fin)/ta\", initial = 0.0, unit = \"deg\" }\n\
                p = { derivative = \"(3*fin - p)/tr\", initial = 0.0, unit = \"deg/s\" }\n[outputs]\nroll_deg_s = \"p\"\n";
    let mut random = normal(4);
    let steps: Vec<f64> = (0..30).map(|_| 4.0 * random()).collect();
    let dc: Vec<f64> = (0..1500).map(|n| steps[n / 50]).collect();
    let limited = ("fin", "max(min((dc - fin)/ta, 40), -40)");
    let found = seen(text, limited, ("command_deg", dc), (0.005, &mut random));
    let first = &found.record.terms[0];
    assert_eq!(found.record.slot, "state:fin", "{:?}", found.record.terms);
    assert!(first.term.starts_with("max(rate_fin") && first.coefficient < -0.3, "{first:?}");
}

/// The force of a loudspeaker's coil falls as it leaves the magnet.
#[test]
fn a_coil_that_leaves_its_magnet_is_seen() {
    let text = "[time]\nperiod_s = 0.02\n[inputs]\ni = \"coil_A\"\n[parameters]\nB = { value = 5.0, fixed = true, unit = \"N/A\" }\n\
                m = { value = 1.0, min = 0.3, max = 3.0, unit = \"kg\" }\nc = { value = 2.0, min = 0.5, max = 8.0, unit = \"N s/m\" }\n\
                k = { value = 80.0, min = 30.0, max = 200.0, unit = \"N/m\" }\n[states]\nx = { derivative = \"v\", initial = 0.0, unit = \"m\" }\n\
                v = { derivative = \"(B*i - c*v - k*x)/m\", initial = 0.0, unit = \"m/s\" }\n[outputs]\ny_m = \"x\"\n";
    let mut random = normal(9);
    let i: Vec<f64> = drive(1500, &mut random).into_iter().map(|x| x / 3.0).collect();
    let falls = ("v", "(B*i*(1 - 3*x^2) - c*v - k*x)/m");
    let found = seen(text, falls, ("coil_A", i), (0.005, &mut random));
    let first = &found.record.terms[0];
    assert_eq!(first.term, "i*x^2", "{:?}", found.record.terms);
    assert!((first.coefficient / -15.0 - 1.0).abs() < 0.3, "{first:?}");
}

/// A force that comes late, as from the cut of the turn before, with a noise of one in a hundred.
#[test]
fn a_delayed_feedback_is_seen() {
    let text = "[time]\nperiod_s = 0.02\n[inputs]\nu = \"force_N\"\n[parameters]\nm = { value = 1.0, min = 0.3, max = 3.0, unit = \"kg\" }\n\
                c = { value = 2.0, min = 0.5, max = 8.0, unit = \"N s/m\" }\nk = { value = 80.0, min = 30.0, max = 200.0, unit = \"N/m\" }\n[states]\n\
                x = { derivative = \"v\", initial = 0.0, unit = \"m\" }\nv = { derivative = \"(u - c*v - k*x)/m\", initial = 0.0, unit = \"m/s\" }\n\
                [outputs]\ny_m = \"x\"\n";
    let mut random = normal(6);
    let u = drive(1500, &mut random);
    let late = ("v", "(u - c*v - k*x - 12*delay(x, 0.37))/m");
    let found = seen(text, late, ("force_N", u), (0.01, &mut random));
    let first = &found.record.terms[0];
    let late = first.term.strip_prefix("delay(x, ").and_then(|t| t.strip_suffix(')'));
    let late: f64 = late.unwrap_or_else(|| panic!("{:?}", found.record.terms)).parse().unwrap();
    assert!((late - 0.37).abs() < 0.06 && (first.coefficient / -12.0 - 1.0).abs() < 0.3, "{first:?}");
    assert_eq!((found.record.slot.as_str(), found.record.signature.memory.as_str()), ("state:v", "rate_dependent"));
}
