//! Does the experiment that a diagnosis proposes settle its tie? The bank's machine performs it, and the program judges again.

use hysid_concealed::case::{Case, Group, Record};
use hysid_concealed::excite::Excitation;
use hysid_concealed::input::Input;
use hysid_concealed::seed::{Random, Stream};

use super::score::Row;
use super::trial::Bench;
use super::verdict::{Experiment, Verdict};

/// Separation from which an experiment is promised to decide.
const PROMISED: f64 = 25.0;

/// What came of a proposal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settled {
    /// Whether the proposed experiment resolved the tie correctly.
    pub proposed: bool,
    /// Whether an input drawn at random did: same length, same level, a shape of the bank in the band of the recording.
    pub random: bool,
}

impl Bench {
    /// `None` where no experiment was proposed that is predicted to decide, or the plant cannot be driven at will.
    pub fn experiment(&self, case: &Case, row: &Row) -> anyhow::Result<Option<Settled>> {
        let proposed = row.verdict().and_then(|v| v.experiment.clone()).filter(|e| e.separation >= PROMISED);
        let (Some(proposed), Group::Single) = (proposed, case.label.group) else { return Ok(None) };
        let mut random = Random::for_case(Stream::Reporting, u64::MAX, case.label.samples as u64);
        let Some(record) = perform(case, &Plan::of(&proposed, case), &mut random) else { return Ok(None) };
        let settled = self.judge_again(case, row, &record, "experiments", &proposed)?;
        let plan = Plan {
            shape: Shape::Drawn(Excitation::SHARES[random.weighted(&Excitation::SHARES.map(|s| s.1))].0),
            band: case.design.band,
            level: proposed.level,
        };
        let by_chance = match perform(case, &plan, &mut random) {
            Some(record) => self.judge_again(case, row, &record, "inputs", &proposed)?,
            None => false,
        };
        Ok(Some(Settled { proposed: settled, random: by_chance }))
    }

    /// The verdict on the case's recording and a further one together: whether it resolves the tie.
    fn judge_again(
        &self,
        case: &Case,
        row: &Row,
        record: &Record,
        place: &str,
        proposed: &Experiment,
    ) -> anyhow::Result<bool> {
        let folder = self.root.join(place).join(&case.label.id);
        let out = self.root.join(format!("{place}-out")).join(&case.label.id);
        case.write(&folder)?;
        std::fs::write(folder.join("further.csv"), case.csv(record, &record.y))?;
        // Twice the data, twice the time: what a limit cuts short is no answer to whether the tie is settled.
        let patient = Self { time_limit: 2 * self.time_limit, ..self.clone() };
        let limit = format!("{}", patient.time_limit.as_secs());
        let said = patient.call(
            &folder,
            &[
                "diagnose",
                "baseline.sim.toml",
                "--recording",
                "est.csv",
                "--recording",
                "further.csv",
                "--holdout",
                "val.csv",
            ],
            &["--threads", "1", "--time-limit", &limit, "--out"],
            &out,
        );
        let verdict =
            said.ok().and_then(|()| Verdict::read(&std::fs::read_to_string(out.join("diagnosis.json")).ok()?).ok());
        let Some(verdict) = verdict else { return Ok(false) };
        let mut again = Row::new(case, row.trial.clone(), row.rivals.clone());
        again.trial.verdict = Ok(verdict);
        Ok(again.resolves(&proposed.between))
    }
}

/// An input to be applied.
struct Plan {
    shape: Shape,
    /// In Hz.
    band: (f64, f64),
    /// Peak about the mean, as a multiple of the recording's.
    level: f64,
}

impl Plan {
    fn of(proposed: &Experiment, case: &Case) -> Self {
        let [low, high] = proposed.band;
        // What the sampling of the recording can carry.
        let high = high.min(0.2 / case.design.period);
        let band = if low > 0.0 && high >= low { (low, high) } else { case.design.band };
        Self { shape: shape(&proposed.shape), band, level: proposed.level.clamp(0.05, 10.0) }
    }
}

/// The true machine under an input, with white noise of the case's size.
fn perform(case: &Case, plan: &Plan, random: &mut Random) -> Option<Record> {
    let Input::Held { values, .. } = &case.est.input else { return None };
    if case.design.gains.is_some() {
        return None;
    }
    let (n, period) = (case.label.samples, case.design.period);
    let (low, high) = plan.band;
    let signal: Vec<f64> = match plan.shape {
        Shape::Drawn(excitation) => excitation.samples(random, n, period, low, high),
        Shape::Triangle => {
            let frequency = low.max(3.0 / case.design.length());
            (0..n).map(|k| triangle(frequency * k as f64 * period)).collect()
        }
        Shape::Growing => {
            let frequency = (low * high).sqrt();
            (0..n)
                .map(|k| k as f64 / n as f64 * (std::f64::consts::TAU * frequency * k as f64 * period).sin())
                .collect()
        }
    };
    let mean = if case.design.mean > 0.0 { values.iter().sum::<f64>() / values.len().max(1) as f64 } else { 0.0 };
    let peak = |x: &[f64], about: f64| x.iter().fold(0.0_f64, |a, v| a.max((v - about).abs()));
    let size = plan.level * peak(values, mean) / peak(&signal, 0.0).max(f64::MIN_POSITIVE);
    let u = signal.iter().map(|x| mean + size * x);
    // A pump or a heater does not take back.
    let values = if case.design.mean > 0.0 { u.map(|v| v.max(0.0)).collect() } else { u.collect() };
    let input = Input::Held { values, period, hold: case.design.hold };
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
