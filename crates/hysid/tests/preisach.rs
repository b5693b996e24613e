//! `identify` with defaults on a Preisach operator: the model free-runs on inputs that it has not seen.

use hysid::identify::{Options, Source, identify};
use hysid_dictionary::Record;
use hysid_hysteresis::Operator;
use hysid_hysteresis::preisach::PreisachPlane;
use hysid_signal::{Channel, Clock, Excitation, Recording};
use hysid_validate::{Normaliser, measure};

fn multisine(samples: usize, seed: u64) -> Vec<f64> {
    let shape = Excitation::Multisine { lowest_hz: 0.1, highest_hz: 1.0, period: 0 };
    shape.signal(samples, 0.01, 0.5, seed).unwrap()
}

/// The input of Zhang, Zhu, Gu (2017): one loop, the peak twice.
fn one_loop() -> Vec<f64> {
    (0..=100).map(|m| -0.5 + 0.01 * f64::from(m)).chain((0..=100).map(|n| 0.5 - 0.01 * f64::from(n))).collect()
}

#[test]
fn the_free_run_follows_other_inputs() {
    let plane = PreisachPlane::of_the_paper().staircase().unwrap();
    let fresh = multisine(2000, 77);
    let fresh_y = plane.run(&fresh);
    // The input that teaches, and the relative error that the fresh one must stay below. One loop does not tell what the
    // operator remembered before it.
    for (name, u, bound) in [("one loop", one_loop(), 0.3), ("a multisine", multisine(2500, 7), 0.06)] {
        let channel = |name: &str, x: Vec<f64>| Channel { name: name.into(), samples: x };
        let y = plane.run(&u);
        let clock = Clock { start_s: 0.0, period_s: 0.01 };
        let recordings = [Recording::new(name, clock, vec![channel("u", u), channel("y", y)]).unwrap()];
        let source = Source { recordings: &recordings, inputs: &["u".to_owned()], output: "y" };
        let model = identify(source, &Options::default(), &|_| {}).unwrap().model;
        let run = model.free_run(&Record::siso(&fresh, &fresh_y)).unwrap();
        assert_eq!(run.diverged_at, None, "{name}");
        let error = measure(&fresh_y, &run.y).nrmse(Normaliser::Std);
        assert!(error < bound, "{name}: {error}");
    }
}
