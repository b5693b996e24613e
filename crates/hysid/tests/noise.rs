//! Noise terms in `identify`: they come where the output carries noise, lower the one-step error and leave the free run alone.

use hysid::identify::{Options, Source, identify};
use hysid_dictionary::Record;
use hysid_narx::{NarxModel, Parts};
use hysid_signal::{Channel, Clock, Excitation, Recording, white_noise};
use hysid_validate::measure;

#[test]
fn output_noise_is_modelled_one_step_ahead_only() {
    let u = Excitation::Multisine { lowest_hz: 1.0, highest_hz: 30.0, period: 0 }.signal(1500, 0.01, 1.0, 3).unwrap();
    let mut y = vec![0.0; u.len()];
    for n in 1..u.len() {
        y[n] = 0.8 * y[n - 1] + 0.5 * u[n];
    }
    let noisy: Vec<f64> = y.iter().zip(white_noise(u.len(), 1e-3, 4).unwrap()).map(|(y, e)| y + e).collect();
    let channel = |name: &str, x: &[f64]| Channel { name: name.into(), samples: x.to_vec() };
    let clock = Clock { start_s: 0.0, period_s: 0.01 };
    let recordings = [Recording::new("r", clock, vec![channel("u", &u), channel("y", &noisy)]).unwrap()];
    let source = Source { recordings: &recordings, inputs: &["u".to_owned()], output: "y" };
    let model = identify(source, &Options::default(), &|_| {}).unwrap().model;
    assert!(!model.parts().noise.is_empty());
    let plain = NarxModel::new(Parts { noise: vec![], ..model.parts().clone() }).unwrap();
    let record = Record::siso(&u, &noisy);
    let bits = |m: &NarxModel| m.free_run(&record).unwrap().y.iter().map(|y| y.to_bits()).collect::<Vec<_>>();
    assert!(bits(&model) == bits(&plain));
    let error = |m: &NarxModel| measure(&noisy, &m.one_step(&record).unwrap()).rmse;
    // The noise of variance 1e-3 is what cannot be predicted; without noise terms 1 + 0.8^2 times that is left.
    assert!(error(&model) < 0.9 * error(&plain), "{} {}", error(&model), error(&plain));
}
