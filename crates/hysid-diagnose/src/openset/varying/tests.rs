//! Parameters that vary against machines in which they do.

use std::cell::Cell;
use std::f64::consts::{SQRT_2, TAU};

use hysid_plant::Simulation;
use hysid_signal::{Channel, Clock, Recording};

use super::*;
use crate::data::DataSet;
use crate::model::base::{Start, fit_simulation};
use crate::model::{Model, Values};
use crate::openset::varying::written::WrittenVariation;
pub use crate::oscillator::BASELINE;
use crate::oscillator::{PERIOD, REAL, drive, normal, respond, rms};
use crate::refit::LmOptions;

/// An oscillator whose stiffness is multiplied by a function of the time, with white noise of this share of the output.
pub fn recorded(seed: u64, factor: impl Fn(f64) -> f64, noise: f64) -> DataSet {
    let mut random = normal(seed);
    let u = drive(1200, &mut random);
    let (steps, (.., k)) = (Cell::new(0u32), REAL);
    let force = |x: f64, _: f64| {
        let t = f64::from(steps.replace(steps.get() + 1)) * PERIOD / 40.0;
        k * (factor(t) - 1.0) * x
    };
    let mut y = respond(&u, REAL, force);
    let size = noise * rms(&y);
    y.iter_mut().for_each(|y| *y += size * random());
    let channels = vec![Channel { name: "u_N".into(), samples: u }, Channel { name: "x_m".into(), samples: y }];
    let recording = Recording::new("est.csv", Clock { start_s: 0.0, period_s: PERIOD }, channels).unwrap();
    DataSet::new(&Simulation::parse(BASELINE, "test.sim.toml").unwrap(), &[recording], 3).unwrap()
}

fn model<'d>(simulation: &Simulation, data: &'d DataSet) -> Model<'d> {
    Model::new(simulation, data, 2).unwrap()
}

fn fitted(data: &DataSet) -> Base<'_> {
    let simulation = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
    let start = Values::default();
    let options = LmOptions { iterations: 25, ..LmOptions::default() };
    let model = model(&simulation, data);
    fit_simulation(model, Start::Values(&start), &[], None, 2, options, NoiseKind::Coloured).unwrap()
}

fn found(data: &DataSet) -> LikelyVariation {
    let base = fitted(data);
    let plain = data.layout.white_noise(&base.fit.residual);
    varying(&base, NoiseKind::Coloured, &[base.whitener.clone(), plain]).swap_remove(0)
}

#[test]
fn a_stiffness_that_oscillates_is_found_with_its_frequency_and_size() {
    let v = found(&recorded(3, |t| 1.0 + 0.02 * (TAU * 0.73 * t + 0.4).sin(), 0.02));
    let Course::Line(f) = v.what.course else { panic!("{}", v.what.words()) };
    assert!(v.what.symbol == "k" && (f - 0.73).abs() < 0.01 && v.gain > 30.0, "{} {}", v.what.words(), v.gain);
    assert!((SQRT_2 * v.what.size - 0.02).abs() < 0.005, "{}", v.what.words());
}

#[test]
fn a_stiffness_that_wanders_is_found() {
    let v = found(&recorded(4, |t| 1.0 + 0.02 * ((0.31 * t).sin() + (0.17 * t).cos() * (0.53 * t).sin()), 0.02));
    assert!(
        v.what.symbol == "k" && matches!(v.what.course, Course::Walk(_)) && v.gain > 30.0,
        "{} {}",
        v.what.words(),
        v.gain
    );
}

#[test]
fn a_constant_stiffness_is_left_alone() {
    for seed in 10..16 {
        let v = found(&recorded(seed, |_| 1.0, 0.02));
        assert!(v.gain < 3.0, "{seed}: {} {}", v.what.words(), v.gain);
    }
}

#[test]
fn an_offset_that_wanders_is_no_parameter_that_does() {
    let offset = BASELINE
        .replace("(u - c*v - k*x)/m", "(u - c*v - k*x + F0)/m")
        .replace("[states]", "F0 = { value = 0.5, min = -5.0, max = 5.0, unit = \"N\" }\n[states]");
    let data = recorded(5, |_| 1.0, 0.02);
    let base = fit_simulation(
        model(&Simulation::parse(&offset, "test.sim.toml").unwrap(), &data),
        Start::Values(&Values::default()),
        &[],
        None,
        1,
        LmOptions::default(),
        NoiseKind::White(1.0),
    )
    .unwrap();
    let all = modulated(&base);
    assert_eq!(all, ["m", "c", "k", "F0", "u"]);
    let data = data.with_still_inputs(all.len());
    assert_eq!(Modulated::new(&base, &all, &data).unwrap().of_motion(), [true, true, true, false, true]);
}

#[test]
fn the_response_of_a_course_is_the_derivative_of_what_is_written() {
    let data = recorded(3, |t| 1.0 + 0.02 * (TAU * 0.73 * t).sin(), 0.02);
    let v = found(&data);
    let base = fitted(&data);
    let written = WrittenVariation::new(&base.document(), &v).unwrap().forms.swap_remove(0).simulation;
    let names: Vec<String> = written.parameters.iter().map(|p| p.name.clone()).filter(|n| n.starts_with('g')).collect();
    assert_eq!(names.len(), 2);
    for (name, column) in names.iter().zip(&v.columns) {
        let response = |g: f64| {
            let mut one = written.clone();
            names.iter().for_each(|n| one.parameter_mut(n).unwrap().value = 0.0);
            one.parameter_mut(name).unwrap().value = g;
            let m = model(&one, &data);
            m.predict(&m.theta(&Values::default())).unwrap()
        };
        let g = 1e-4;
        let slope: Vec<f64> = response(g).iter().zip(response(-g)).map(|(a, b)| (a - b) / (2.0 * g)).collect();
        let cosine = dot(&slope, column) / (norm2(&slope) * norm2(column)).sqrt();
        assert!(cosine > 0.999 && (rms(&slope) / rms(column) - 1.0).abs() < 0.01, "{name}: {cosine}");
    }
}
