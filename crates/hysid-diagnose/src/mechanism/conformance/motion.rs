//! The part of the suite that runs simulations: the baseline at zero, a feature that lives.

use hysid_plant::{Compiled, Direction, Drive, Run, Simulation};
use hysid_signal::{Channel, Clock, Recording};
use rand::RngExt;

use super::Breach;
use crate::mechanism::{Amplitudes, Mechanism, Purpose, Rewritten, Signals, Stretch, survey};
use crate::slot::{Slot, Structure};

/// Samples of the specimens' recordings.
pub(super) const SAMPLES: usize = 1000;

/// An excitation for a specimen: a sum of sines over more than a decade whose level changes, with a pause at the end; the
/// recorded outputs are the baseline's own.
pub fn example_recording(simulation: &Simulation, period_s: f64, size: f64) -> Option<Recording> {
    let wave = |n: usize, channel: usize| {
        let t = n as f64 / SAMPLES as f64;
        let level = match (12.0 * t) as usize {
            0..=2 => 0.3,
            3..=5 => 1.0,
            6..=7 => 0.6,
            8..=10 => 1.3,
            _ => 0.0,
        };
        let line = |cycles: f64, phase: f64| (std::f64::consts::TAU * cycles * t + phase + channel as f64).sin();
        size * level * (line(7.0, 0.3) + 0.8 * line(16.0, 1.1) + 0.6 * line(31.0, 2.3) + 0.5 * line(62.0, 0.9))
    };
    let inputs = (0..simulation.inputs.len()).map(|c| (0..SAMPLES).map(|n| wave(n, c)).collect()).collect();
    recorded(simulation, period_s, inputs)
}

/// As [`example_recording`], with levels without a pattern that are held for a few samples.
pub fn jumping_recording(simulation: &Simulation, period_s: f64, size: f64) -> Option<Recording> {
    let mut random = crate::random::generator(0, 0);
    let mut uniform = || random.random::<f64>();
    let mut levels = || {
        let mut series = Vec::with_capacity(SAMPLES);
        while series.len() < SAMPLES {
            let level = 1.5 * size * (2.0 * uniform() - 1.0) * if uniform() < 0.3 { 0.2 } else { 1.0 };
            let held = 1 + (uniform() * SAMPLES as f64 / 250.0) as usize;
            series.extend(std::iter::repeat_n(level, held.min(SAMPLES - series.len())));
        }
        series
    };
    let inputs = (0..simulation.inputs.len()).map(|_| levels()).collect();
    recorded(simulation, period_s, inputs)
}

/// These inputs with what the simulation answers.
fn recorded(simulation: &Simulation, period_s: f64, mut inputs: Vec<Vec<f64>>) -> Option<Recording> {
    // A velocity beside its displacement is its derivative.
    if let [x, v, ..] = inputs.as_mut_slice() {
        let last = SAMPLES - 1;
        *v = (0..SAMPLES).map(|n| (x[(n + 1).min(last)] - x[n.saturating_sub(1)]) / (2.0 * period_s)).collect();
    }
    let compiled = Compiled::new(simulation).ok()?;
    let drive = Drive::new(0.0, period_s, SAMPLES, inputs.clone()).ok()?;
    let response = compiled.simulate(&Run::new(&drive, &compiled.theta()));
    let columns = simulation.inputs.iter().map(|i| i.column.clone()).zip(inputs);
    let outputs = simulation.outputs.iter().map(|o| o.column.clone()).zip(response.outputs);
    let channels = columns.chain(outputs).map(|(name, samples)| Channel { name, samples }).collect();
    Recording::new(&simulation.title, Clock { start_s: 0.0, period_s }, channels).ok()
}

/// A base simulation with an excitation.
pub struct Bench {
    pub(crate) simulation: Simulation,
    pub(super) drive: Drive,
    structure: Structure,
    signals: Vec<Signals>,
    pub(super) baseline: Vec<Vec<f64>>,
}

pub(super) fn outputs(simulation: &Simulation, drive: &Drive) -> Option<Vec<Vec<f64>>> {
    let compiled = Compiled::new(simulation).ok()?;
    let response = compiled.simulate(&Run::new(drive, &compiled.theta()));
    response.diverged.is_none().then_some(response.outputs)
}

pub(super) fn with(simulation: &Simulation, values: &[(String, f64)]) -> Simulation {
    let mut set = simulation.clone();
    for (name, value) in values {
        if let Some(p) = set.parameter_mut(name) {
            p.value = *value;
        }
    }
    set
}

pub(super) fn rms(series: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = series.fold((0.0, 0usize), |(s, n), v| (s + v * v, n + 1));
    (sum / count.max(1) as f64).sqrt()
}

/// Largest difference of two sets of outputs, each output in units of its own rms.
pub(super) fn difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let parts = a.iter().zip(b).map(|(a, b)| {
        let size = rms(a.iter().copied()).max(f64::MIN_POSITIVE);
        rms(a.iter().zip(b).map(|(a, b)| a - b)) / size
    });
    parts.fold(0.0, f64::max)
}

impl Bench {
    /// A bench for a simulation: its own response to [`example_recording`].
    pub fn new(simulation: &Simulation, period_s: f64, size: f64) -> Option<Self> {
        Self::of(simulation, &example_recording(simulation, period_s, size)?)
    }

    /// A bench for a simulation under a recording's inputs.
    pub fn of(simulation: &Simulation, recording: &Recording) -> Option<Self> {
        let compiled = Compiled::new(simulation).ok()?;
        let range = 0..recording.len();
        let drive = Drive::from_recording(&compiled, recording, range.clone()).ok()?;
        let structure = Structure::of(simulation);
        let stretch = Stretch { recording, range: &range, free: &[] };
        let signals = survey(simulation, &structure, &[stretch]).ok()?;
        let baseline = outputs(simulation, &drive)?;
        Some(Self { simulation: simulation.clone(), drive, structure, signals, baseline })
    }

    /// The title of the simulation.
    pub fn title(&self) -> &str {
        &self.simulation.title
    }

    /// The slots of a mechanism with their signals.
    pub fn slots(&self, mechanism: &Mechanism) -> Vec<(Slot, Signals)> {
        let of = |slot: &Slot| self.structure.slots.iter().position(|s| s == slot).and_then(|i| self.signals.get(i));
        mechanism
            .slots(&self.structure)
            .into_iter()
            .filter_map(|s| of(&s).cloned().map(|signals| (s, signals)))
            .collect()
    }

    pub(super) fn breach(&self, mechanism: &'static Mechanism, slot: &Slot, what: String) -> Breach {
        Breach { mechanism: mechanism.id, at: format!("{} at {}", self.simulation.title, slot.label), what }
    }

    /// Whether the neutral values give the baseline (up to rounding, unless the law brings a switching surface: its crossing
    /// divides an integration step, which changes more digits), and whether every amplitude changes some output.
    pub fn check_motion(&self, mechanism: &'static Mechanism, slot: &Slot, signals: &Signals) -> Vec<Breach> {
        let mut breaches = Vec::new();
        let mut breach = |what: String| breaches.push(self.breach(mechanism, slot, what));
        for purpose in
            std::iter::once(Purpose::Screening).chain(mechanism.forms(slot).into_iter().map(|(form, _)| form))
        {
            let Ok(written) = mechanism.rewrite(&self.simulation, slot, signals, purpose) else { continue };
            if !written.neutral.is_empty() {
                match outputs(&with(&written.simulation, &written.neutral), &self.drive) {
                    None => breach(format!("{purpose:?}: diverges at its neutral values")),
                    Some(found) => {
                        let surfaces = |s: &Simulation| Compiled::new(s).is_ok_and(|c| c.has_switching());
                        let close = difference(&self.baseline, &found);
                        // `delay` by nothing interpolates between equal points, and a divisor that became a function of time is
                        // no longer one that is inverted once: the last digit may differ.
                        let rounding = close < 1e-13;
                        if !rounding && !(surfaces(&written.simulation) && close < 1e-5) {
                            breach(format!(
                                "{purpose:?}: not the baseline at its neutral values: {close:e} of the output"
                            ));
                        }
                    }
                }
            }
            if purpose == Purpose::Screening {
                let of_two_sides = mechanism.law_at(slot, purpose).amplitudes == Amplitudes::OfTwoSides;
                for what in self.dead_amplitudes(&written, of_two_sides) {
                    breach(what);
                }
            }
        }
        breaches
    }

    /// Amplitudes whose derivative at zero is zero or not finite, at every point of the grid. A signal may be on one side only: of a law of two sides one
    /// may be dead.
    fn dead_amplitudes(&self, written: &Rewritten, of_two_sides: bool) -> Vec<String> {
        let mut alive = vec![false; written.amplitudes.len()];
        let mut found = Vec::new();
        let starts = written.starts();
        for start in starts.iter().step_by((starts.len() / 2).max(1)) {
            let Ok(compiled) = Compiled::new(&with(&written.simulation, start)) else { continue };
            let indices: Vec<usize> =
                written.amplitudes.iter().filter_map(|a| compiled.parameter_index(&a.name)).collect();
            let directions: Vec<Direction<'_>> = indices.iter().map(|i| Direction::Parameter(*i)).collect();
            let theta = compiled.theta();
            let sensitivity = compiled.sensitivities(&Run::new(&self.drive, &theta), &directions);
            for ((alive, amplitude), tangent) in alive.iter_mut().zip(&written.amplitudes).zip(&sensitivity.tangents) {
                let moved = tangent.iter().zip(&self.baseline).map(|(t, y)| {
                    amplitude.size * rms(t.iter().copied()) / rms(y.iter().copied()).max(f64::MIN_POSITIVE)
                });
                let moved = moved.fold(0.0, f64::max);
                if tangent.iter().flatten().any(|t| !t.is_finite()) {
                    found.push(format!("the feature of {} is not finite at {start:?}", amplitude.name));
                }
                *alive |= moved.is_finite() && moved > 1e-9;
            }
        }
        if of_two_sides && alive.contains(&true) {
            return found;
        }
        let dead = written.amplitudes.iter().zip(&alive).filter(|(_, alive)| !**alive);
        found.extend(dead.map(|(a, _)| format!("the amplitude {} changes no output", a.name)));
        found
    }
}
