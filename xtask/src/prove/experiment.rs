//! Does the experiment that a diagnosis proposes settle its tie? The bank's machine performs it, and the program judges again.

use hysid_concealed::case::{Case, Group, Record};
use hysid_concealed::design::Source;
use hysid_concealed::excite::Excitation;
use hysid_concealed::input::Input;
use hysid_concealed::seed::Random;

use super::score::Row;
use super::trial::Bench;
use super::verdict::{Experiment, Verdict};

/// Separation from which an experiment is promised to decide.
const PROMISED: f64 = 25.0;

impl Bench {
    /// `None` where no experiment was proposed that is predicted to decide, or the plant cannot be driven at will.
    pub fn experiment(&self, case: &Case, row: &Row) -> anyhow::Result<Option<bool>> {
        let proposed = row.verdict().and_then(|v| v.experiment.clone()).filter(|e| e.separation >= PROMISED);
        let (Some(proposed), Group::Single) = (proposed, case.label.group) else { return Ok(None) };
        let Some(record) = perform(case, &proposed) else { return Ok(None) };
        let folder = self.root.join("experiments").join(&case.label.id);
        let out = self.root.join("experiments-out").join(&case.label.id);
        case.write(&folder)?;
        std::fs::write(folder.join("proposed.csv"), case.csv(&record, &record.y))?;
        let limit = format!("{}", self.time_limit.as_secs());
        let said = self.call(
            &folder,
            &[
                "diagnose",
                "baseline.sim.toml",
                "--recording",
                "est.csv",
                "--recording",
                "proposed.csv",
                "--holdout",
                "val.csv",
            ],
            &["--threads", "1", "--time-limit", &limit, "--out"],
            &out,
        );
        let verdict =
            said.ok().and_then(|()| Verdict::read(&std::fs::read_to_string(out.join("diagnosis.json")).ok()?).ok());
        let mut again = Row::new(case, row.trial.clone(), row.rivals.clone());
        let Some(verdict) = verdict else { return Ok(Some(false)) };
        let named = verdict.kind == "named";
        again.trial.verdict = Ok(verdict);
        Ok(Some(named && again.mechanisms_right()))
    }
}

/// The true machine under the proposed input, with white noise of the case's size.
fn perform(case: &Case, proposed: &Experiment) -> Option<Record> {
    let Input::Held { values, .. } = &case.est.input else { return None };
    if case.design.gains.is_some() {
        return None;
    }
    let mut random = Random::for_case(hysid_concealed::seed::Stream::Reporting, u64::MAX, case.label.samples as u64);
    let mut design = case.design.clone();
    if proposed.band[0] > 0.0 && proposed.band[1] > proposed.band[0] {
        // What the sampling of the recording can carry.
        design.band = (proposed.band[0], proposed.band[1].min(0.2 / design.period));
    }
    let n = case.label.samples;
    let mut u = match shape(&proposed.shape) {
        Shape::Drawn(excitation) => match design.source(&mut random, excitation, n) {
            Source::Open(Input::Held { values, .. }) => values,
            _ => return None,
        },
        Shape::Triangle => {
            (0..n).map(|k| triangle(design.band.0.max(3.0 / case.design.length()) * k as f64 * design.period)).collect()
        }
        Shape::Growing => (0..n)
            .map(|k| {
                let t = k as f64 * design.period;
                k as f64 / n as f64 * (std::f64::consts::TAU * (design.band.0 * design.band.1).sqrt() * t).sin()
            })
            .collect(),
    };
    let peak = |x: &[f64]| x.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
    let level = proposed.level.clamp(0.05, 10.0) * peak(values) / peak(&u).max(f64::MIN_POSITIVE);
    u.iter_mut().for_each(|v| *v *= level);
    let input = Input::Held { values: u, period: design.period, hold: design.hold };
    let clean = case.machine.run(&input, None).ok()?;
    let y =
        clean.iter().zip(&case.label.sigma).map(|(c, s)| c.iter().map(|v| v + s * random.normal()).collect()).collect();
    Some(Record { input, y, clean })
}

enum Shape {
    Drawn(Excitation),
    Triangle,
    Growing,
}

/// The input that a word stands for.
fn shape(word: &str) -> Shape {
    match word {
        w if w.contains("triangle") => Shape::Triangle,
        w if w.contains("grow") => Shape::Growing,
        w if w.contains("chirp") || w.contains("sweep") => Shape::Drawn(Excitation::Chirp),
        w if w.contains("step") => Shape::Drawn(Excitation::Steps),
        w if w.contains("multisine") => Shape::Drawn(Excitation::Multisine),
        w if w.contains("sine") => Shape::Drawn(Excitation::Sine),
        _ => Shape::Drawn(Excitation::SteppedMultisine),
    }
}

/// A triangle of unit height and frequency.
fn triangle(phase: f64) -> f64 {
    let s = phase.rem_euclid(1.0);
    if s < 0.25 {
        4.0 * s
    } else if s < 0.75 {
        2.0 - 4.0 * s
    } else {
        4.0 * s - 4.0
    }
}
