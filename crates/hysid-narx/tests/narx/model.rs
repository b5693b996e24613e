//! The model against hand computation, the dictionary's own evaluator, and its file.

use crate::common::coefficients;
use hysid_dictionary::{Model, Record, Signal, SignalName, Signals};
use hysid_narx::{Derived, Law, NarxModel, NoiseTerm, Parts, Past};
use proptest::prelude::*;

fn parts(terms: &[(&str, f64)], derived: Vec<Derived>) -> Parts {
    let name = |s: &str, c: &str| SignalName { symbol: s.into(), column: c.into(), threshold: 0.0 };
    let mut inputs = vec![name("u", "u_V")];
    inputs.extend(derived.iter().map(|d| name(&d.symbol, &d.symbol)));
    let signals = Signals::new(name("y", "y_mm"), inputs).unwrap();
    let coefficients = coefficients(&signals, terms, 0.1);
    Parts { signals, derived, coefficients, noise: vec![], limit: 100.0, period_s: Some(0.01), decimation: 1 }
}

fn input(n: usize, seed: u64) -> Vec<f64> {
    let mut x = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    (0..n)
        .map(|_| {
            x ^= x << 13;
            x ^= x >> 7;
            x ^= x << 17;
            (x >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
        })
        .collect()
}

#[test]
fn a_run_is_the_recursion_written_out() {
    let model = NarxModel::new(parts(&[("y[n-1]", 0.5), ("u[n]*u[n-1]", 1.0), ("1", 0.1)], vec![])).unwrap();
    let u = [1.0, 2.0, 3.0, -1.0];
    let y = [7.0, 0.0, 0.0, 0.0];
    let p = model.free_run(&Record::siso(&u, &y)).unwrap();
    assert!(p.y[0].is_nan());
    let y1 = 3.5 + 2.0 + 0.1;
    let y2 = 0.5 * y1 + 6.0 + 0.1;
    assert_eq!(&p.y[1..], &[y1, y2, 0.5 * y2 - 3.0 + 0.1]);
    assert_eq!(model.one_step(&Record::siso(&u, &y)).unwrap()[2], 6.1);
    assert_eq!(p.diverged_at, None);
}

#[test]
fn divergence_is_a_result() {
    let model = NarxModel::new(parts(&[("y[n-1]^2", 1.0)], vec![])).unwrap();
    let p = model.free_run(&Record::siso(&[0.0; 8], &[3.0; 8])).unwrap();
    assert_eq!(p.diverged_at, Some(3)); // 3, 9, 81, 6561 > 100
    assert_eq!(p.y[2], 81.0);
    assert!(p.y[3].is_nan() && p.y[7].is_nan());
}

#[test]
fn gaps_of_the_output_are_run_through_and_gaps_of_the_input_start_anew() {
    let model = NarxModel::new(parts(&[("y[n-1]", 0.5), ("u[n]", 1.0)], vec![])).unwrap();
    let nan = f64::NAN;
    let u = [0.0, 0.0, 0.0, 0.0, nan, 0.0, 0.0];
    let y = [8.0, nan, nan, 1.0, 1.0, 6.0, 0.0];
    let p = model.free_run(&Record::siso(&u, &y)).unwrap();
    assert_eq!(&p.y[1..4], &[4.0, 2.0, 1.0]);
    assert!(p.y[4].is_nan() && p.y[5].is_nan());
    assert_eq!(p.y[6], 3.0);
}

#[test]
fn k_steps_lie_between_one_step_and_free_run() {
    let model = NarxModel::new(parts(&[("y[n-1]", 0.8), ("y[n-2]*u[n-1]", 0.3), ("u[n]", 1.0)], vec![])).unwrap();
    let (u, y) = (input(40, 3), input(40, 4));
    let r = Record::siso(&u, &y);
    let one = model.k_step(&r, 1).unwrap().y;
    assert_eq!(format!("{one:?}"), format!("{:?}", model.one_step(&r).unwrap()));
    let three = model.k_step(&r, 3).unwrap().y;
    assert!(three[..4].iter().all(|v| v.is_nan()) && three[4..].iter().all(|v| v.is_finite()));
    // Sample 20 from what was recorded up to 17.
    let (mut a, mut b) = (y[16], y[17]);
    for n in 18..=20 {
        let next = 0.8 * b + 0.3 * a * u[n - 1] + u[n];
        (a, b) = (b, next);
    }
    assert!((three[20] - b).abs() < 1e-14);
    let all = model.k_step(&r, 38).unwrap().y;
    assert_eq!(all[39], model.free_run(&r).unwrap().y[39]);
    assert!(model.k_step(&r, 0).is_err());
}

#[test]
fn a_noise_model_uses_past_residuals() {
    let mut p = parts(&[("u[n]", 1.0)], vec![]);
    p.noise = vec![NoiseTerm { term: p.signals.parse("u[n-1]").unwrap(), lag: 1, theta: 0.5 }];
    let model = NarxModel::new(p).unwrap();
    let (u, y) = ([1.0, 2.0, 3.0], [1.0, 2.5, 3.0]);
    let one = model.one_step(&Record::siso(&u, &y)).unwrap();
    assert_eq!(one[1], 2.0);
    assert_eq!(one[2], 3.0 + 0.5 * 2.0 * 0.5);
    assert_eq!(model.free_run(&Record::siso(&u, &y)).unwrap().y[2], 3.0);
}

#[test]
fn a_model_survives_its_file() {
    let derived = vec![
        Derived { symbol: "w1".into(), source: 0, law: Law::Play { half_width: 0.25, past: Past::TurnedAt(-0.75) } },
        Derived { symbol: "w2".into(), source: 1, law: Law::Filter { a: vec![-0.5, 0.1] } },
        Derived { symbol: "w3".into(), source: 0, law: Law::Dahl { length: 0.5 } },
        Derived { symbol: "w4".into(), source: 2, law: Law::SoftThreshold { centre: 0.1, width: 0.2 } },
    ];
    let mut p =
        parts(&[("y[n-1]", 1.0 / 3.0), ("w1[n]*w2[n-1]", 0.1), ("w3[n]", 1e-300), ("w4[n]*sgn(du[n])", 2.0)], derived);
    p.noise = vec![NoiseTerm { term: p.signals.parse("1").unwrap(), lag: 2, theta: -0.3 }];
    let model = NarxModel::new(p).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("model.json");
    model.save(&path).unwrap();
    let back = NarxModel::load(&path).unwrap();
    assert_eq!(format!("{:?}", back), format!("{model:?}"));
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains("\"format_version\": 1"));
    for (from, to, part) in [
        ("\"format_version\": 1", "\"format_version\": 99", "99"),
        ("y[n-1]", "y[n]", "lag 0"),
        ("\"half_width\": 0.25", "\"half_width\": -1", "half-width"),
        ("\"period_s\": 0.01", "\"period_s\": 0", "`period_s` is 0"),
        ("\"period_s\": 0.01", "\"period_s\": -2.5", "`period_s` is -2.5"),
        ("\"decimation\": 1", "\"decimation\": 0", "`decimation` is 0"),
        ("\"decimation\": 1", "\"decimation\": 4000000000", "`decimation` is 4000000000"),
        (
            "\"decimation\": 1",
            "\"decimation\": 1.5",
            "`decimation`: invalid type: floating point `1.5`, expected a whole number",
        ),
        ("\"limit\": 100", "\"limit\": -100", "`limit` is -100"),
        ("\"standard_error\": 0", "\"standard_error\": -1", "`terms[0].standard_error` is -1"),
        ("\"residual_lag\": 2", "\"residual_lag\": 0", "`noise[0].residual_lag` is 0"),
        ("\"terms\": [", "\"terms\": [], \"other\": [", "`terms` is empty"),
        (
            "\"inputs\": [",
            "\"inputs\": [5, ",
            "`inputs[0]`: invalid type: integer `5`, expected an object with `symbol` and `column`",
        ),
        ("\"law\": \"play\"", "\"law\": \"magic\"", "`derived"),
    ] {
        assert!(text.contains(from), "{from}");
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        let message = NarxModel::load(&path).unwrap_err().to_string();
        assert!(message.contains(part) && message.contains("model.json"), "{message}");
        assert!(!message.contains("struct") && !message.contains("File"), "{message}");
    }
}

proptest! {
    /// One term, one evaluator: our compiled program and the dictionary's model give the same bits.
    #[test]
    fn the_program_is_the_dictionarys_evaluator(
        seed in 1u64..1000,
        picks in prop::collection::vec(0usize..8, 1..8),
        theta in prop::collection::vec(-0.2f64..0.2, 8),
    ) {
        let all = ["1", "y[n-1]", "u[n]*y[n-2]", "du[n]", "sgn(du[n-1])*y[n-1]", "dy[n-1]*sgn(dy[n-1])", "u[n-3]^3", "y[n-1]^2*u[n]"];
        let mut names: Vec<&str> = picks.iter().map(|&i| all[i]).collect();
        names.sort_unstable();
        names.dedup();
        let terms: Vec<(&str, f64)> = names.into_iter().zip(theta).collect();
        let p = parts(&terms, vec![]);
        let plain = Model::new(
            p.signals.clone(),
            p.coefficients.iter().map(|c| c.term.clone()).collect(),
            p.coefficients.iter().map(|c| c.theta).collect(),
        ).unwrap();
        let model = NarxModel::new(p).unwrap();
        let (u, y) = (input(60, seed), input(60, seed + 7));
        let record = Record::siso(&u, &y);
        let reach = model.reach();
        let ours = model.one_step(&record).unwrap();
        let theirs = plain.one_step(&record).unwrap();
        for n in reach..60 {
            prop_assert!((ours[n] - theirs[n]).abs() <= 1e-15 * (1.0 + theirs[n].abs()));
        }
        let ours = model.free_run(&record).unwrap();
        let theirs = plain.free_run(&[&u], &y[..reach], 60, 100.0).unwrap();
        prop_assert_eq!(ours.diverged_at, theirs.diverged_at);
        let end = ours.diverged_at.unwrap_or(60);
        for n in reach..end {
            prop_assert!((ours.y[n] - theirs.y[n]).abs() <= 1e-13 * (1.0 + theirs.y[n].abs()), "{} {} {}", n, ours.y[n], theirs.y[n]);
        }
    }
}

#[test]
fn a_model_at_a_reduced_rate_predicts_every_sample() {
    let mut p = parts(&[("y[n-1]", 0.5), ("u[n]", 1.0)], vec![]);
    let plain = NarxModel::new(p.clone()).unwrap();
    p.decimation = 3;
    let model = NarxModel::new(p).unwrap();
    let (u, y) = (input(20, 1), input(20, 2));
    let whole = model.free_run(&Record::siso(&u, &y)).unwrap().y;
    let ahead = model.k_step(&Record::siso(&u, &y), 4).unwrap().y;
    for phase in 0..3 {
        let take = |x: &[f64]| x.iter().copied().skip(phase).step_by(3).collect::<Vec<_>>();
        let means: Vec<f64> = (0..20usize)
            .map(|n| {
                let part = &u[n.saturating_sub(2)..=n];
                part.iter().sum::<f64>() / part.len() as f64
            })
            .collect();
        let (pu, py) = (take(&means), take(&y));
        let run = plain.free_run(&Record::siso(&pu, &py)).unwrap().y;
        let two = plain.k_step(&Record::siso(&pu, &py), 2).unwrap().y;
        assert_eq!(format!("{:?}", take(&whole)), format!("{run:?}"));
        assert_eq!(format!("{:?}", take(&ahead)), format!("{two:?}"));
    }
    assert!(whole[..3].iter().all(|v| v.is_nan()) && whole[3..].iter().all(|v| v.is_finite()));
}

#[test]
fn terms_may_name_columns() {
    let p = parts(&[("y_mm[n-1]*u_V[n]", 1.0)], vec![]);
    assert_eq!(p.signals.format(&p.coefficients[0].term), "y[n-1]*u[n]");
    assert_eq!(p.signals.find("u_V"), Some(Signal::Input(0)));
}
