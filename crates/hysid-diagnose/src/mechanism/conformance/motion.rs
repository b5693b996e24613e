//! The part of the suite that runs simulations: the baseline at zero, a feature that lives, recovery from its own record.

use hysid_plant::{Compiled, Direction, Drive, Run, Simulation, Start};
use hysid_signal::{Channel, Clock, Recording};

use super::Breach;
use crate::evidence::{ArModel, Layout, Series, Whitener};
use crate::mechanism::{Mechanism, Purpose, Rewritten, Signals, Stretch, survey};
use crate::refit::{LmOptions, Problem, levenberg_marquardt};
use crate::slot::{Slot, Structure};

/// Samples of the specimens' recordings.
const SAMPLES: usize = 1000;

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
    let mut inputs: Vec<Vec<f64>> =
        (0..simulation.inputs.len()).map(|c| (0..SAMPLES).map(|n| wave(n, c)).collect()).collect();
    // A velocity beside its displacement is its derivative.
    if let [x, v] = inputs.as_mut_slice() {
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
    simulation: Simulation,
    drive: Drive,
    structure: Structure,
    signals: Vec<Signals>,
    baseline: Vec<Vec<f64>>,
}

fn outputs(simulation: &Simulation, drive: &Drive) -> Option<Vec<Vec<f64>>> {
    let compiled = Compiled::new(simulation).ok()?;
    let response = compiled.simulate(&Run::new(drive, &compiled.theta()));
    response.diverged.is_none().then_some(response.outputs)
}

fn with(simulation: &Simulation, values: &[(String, f64)]) -> Simulation {
    let mut set = simulation.clone();
    for (name, value) in values {
        if let Some(p) = set.parameter_mut(name) {
            p.value = *value;
        }
    }
    set
}

fn rms(series: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = series.fold((0.0, 0usize), |(s, n), v| (s + v * v, n + 1));
    (sum / count.max(1) as f64).sqrt()
}

/// Largest difference of two sets of outputs, each output in units of its own rms.
fn difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let parts = a.iter().zip(b).map(|(a, b)| {
        let size = rms(a.iter().copied()).max(f64::MIN_POSITIVE);
        rms(a.iter().zip(b).map(|(a, b)| a - b)) / size
    });
    parts.fold(0.0, f64::max)
}

impl Bench {
    /// A bench for a simulation: its own response to [`example_recording`].
    pub fn new(simulation: &Simulation, period_s: f64, size: f64) -> Option<Self> {
        let recording = example_recording(simulation, period_s, size)?;
        let compiled = Compiled::new(simulation).ok()?;
        let range = 0..recording.len();
        let drive = Drive::from_recording(&compiled, &recording, range.clone()).ok()?;
        let structure = Structure::of(simulation);
        let stretch = Stretch { recording: &recording, range: &range, free: &[] };
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

    fn breach(&self, mechanism: &'static Mechanism, slot: &Slot, what: String) -> Breach {
        Breach { mechanism: mechanism.id, at: format!("{} at {}", self.simulation.title, slot.label), what }
    }

    /// Whether the neutral values give the baseline (bit for bit, unless the law brings a switching surface: its crossing
    /// divides an integration step, which changes the last digits), and whether every amplitude changes some output.
    pub fn check_motion(&self, mechanism: &'static Mechanism, slot: &Slot, signals: &Signals) -> Vec<Breach> {
        let mut breaches = Vec::new();
        let mut breach = |what: String| breaches.push(self.breach(mechanism, slot, what));
        for purpose in [Purpose::Screening, Purpose::Refit] {
            let Ok(written) = mechanism.rewrite(&self.simulation, slot, signals, purpose) else { continue };
            if !written.neutral.is_empty() {
                match outputs(&with(&written.simulation, &written.neutral), &self.drive) {
                    None => breach(format!("{purpose:?}: diverges at its neutral values")),
                    Some(found) => {
                        let surfaces = |s: &Simulation| Compiled::new(s).is_ok_and(|c| c.has_switching());
                        let same = found == self.baseline;
                        let close = difference(&self.baseline, &found);
                        // `delay` by nothing interpolates between equal points: the last digit may differ.
                        let rounding = purpose == Purpose::Refit && close < 1e-13;
                        if !same && !rounding && !(surfaces(&written.simulation) && close < 1e-5) {
                            breach(format!(
                                "{purpose:?}: not the baseline at its neutral values: {close:e} of the output"
                            ));
                        }
                    }
                }
            }
            if purpose == Purpose::Screening {
                for what in self.dead_amplitudes(&written) {
                    breach(what);
                }
            }
        }
        breaches
    }

    /// Amplitudes whose derivative at zero is zero or not finite, at every point of the grid.
    fn dead_amplitudes(&self, written: &Rewritten) -> Vec<String> {
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
        let dead = written.amplitudes.iter().zip(&alive).filter(|(_, alive)| !**alive);
        found.extend(dead.map(|(a, _)| format!("the amplitude {} changes no output", a.name)));
        found
    }

    /// Simulates the mechanism at a point of its grid, then fits it from another point together with the baseline's own
    /// parameters, and returns the rms of what is left over the rms of the effect. `None` where the effect makes no
    /// difference here.
    pub fn recovery(&self, mechanism: &'static Mechanism, slot: &Slot, signals: &Signals) -> Option<f64> {
        let written = mechanism.rewrite(&self.simulation, slot, signals, Purpose::Refit).ok()?;
        let starts = written.starts();
        let truth = self.truth(&written, &starts)?;
        let (target, effect) = (truth.1, truth.2);
        let own = written.parameters(&self.simulation);
        let compiled = Compiled::new(&written.simulation).ok()?;
        let fitted: Vec<usize> = compiled.estimated();
        let bounds =
            fitted.iter().filter_map(|i| compiled.parameters().get(*i)).map(|p| (p.lower(), p.upper())).collect();
        let problem = SelfRecord { compiled: &compiled, drive: &self.drive, target: &target, fitted: &fitted, bounds };
        let rows = target.iter().map(Vec::len).sum::<usize>();
        let series =
            (0..target.len()).map(|o| Series { stretch: 0, output: o, first: 0, rows: o * SAMPLES..(o + 1) * SAMPLES });
        let layout = Layout { series: series.collect(), outputs: target.len() };
        let sizes = target.iter().map(|y| rms(y.iter().copied()).max(f64::MIN_POSITIVE));
        let whitener = Whitener { models: sizes.map(ArModel::white).collect() };
        debug_assert_eq!(layout.len(), rows);
        // Every amplitude at three shares of its size, at each point of a thinned grid: the best few by one run.
        let mut candidates: Vec<(f64, Vec<f64>)> = Vec::new();
        let step = (starts.len() / 24).max(1);
        for start in starts.iter().step_by(step) {
            for share in [0.02, 0.1, 0.3] {
                let theta: Vec<f64> = fitted
                    .iter()
                    .filter_map(|i| compiled.parameters().get(*i))
                    .map(|p| match written.amplitudes.iter().find(|a| a.name == p.name) {
                        Some(a) => (share * a.size).clamp(p.lower(), p.upper()),
                        None => start.iter().find(|(n, _)| *n == p.name).map_or(
                            // The baseline's own parameters start a little off.
                            if own.contains(&p.name) { p.value } else { (p.value * 1.01).clamp(p.lower(), p.upper()) },
                            |(_, v)| *v,
                        ),
                    })
                    .collect();
                if let Some(r) = problem.residual(&theta) {
                    candidates.push((rms(whitener.apply(&layout, &r).into_iter()), theta));
                }
            }
        }
        candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut left = f64::INFINITY;
        for (_, theta) in candidates.iter().take(5) {
            let options = LmOptions { iterations: 50, tolerance: 1e-9 };
            if let Some(fit) = levenberg_marquardt(&problem, theta, &layout, &whitener, None, options) {
                left = left.min(rms(whitener.apply(&layout, &fit.residual).into_iter()));
            }
            if left < 1e-3 * effect {
                break;
            }
        }
        Some(left / effect)
    }

    /// Parameter values that make a visible effect without divergence, the outputs there and the effect's size (relative).
    #[allow(clippy::type_complexity)]
    fn truth(
        &self,
        written: &Rewritten,
        starts: &[Vec<(String, f64)>],
    ) -> Option<(Vec<(String, f64)>, Vec<Vec<f64>>, f64)> {
        // Off the grid, between two neighbouring points; of a few such points and amplitudes the one whose effect is nearest
        // to a tenth of the output.
        let mut best: Option<(Vec<(String, f64)>, Vec<Vec<f64>>, f64)> = None;
        for at in [starts.len() / 2, starts.len() / 4, 3 * starts.len() / 4] {
            let (one, two) = (starts.get(at)?, starts.get((at + 1).min(starts.len() - 1))?);
            let between = one.iter().zip(two).map(|((name, a), (_, b))| (name.clone(), 0.6 * a + 0.4 * b));
            let shapes: Vec<(String, f64)> = between.collect();
            let shares: &[f64] = if written.amplitudes.is_empty() { &[0.0] } else { &[0.15, 0.05, 0.015, 0.4] };
            for share in shares {
                let mut values = shapes.clone();
                for a in &written.amplitudes {
                    let p = written.simulation.parameter(&a.name)?;
                    values.push((a.name.clone(), (share * a.size).clamp(p.lower(), p.upper())));
                }
                let Some(found) = outputs(&with(&written.simulation, &values), &self.drive) else { continue };
                let effect = difference(&self.baseline, &found);
                let off = |effect: f64| (effect / 0.1).ln().abs();
                if effect > 1e-4 && best.as_ref().is_none_or(|(_, _, e)| off(effect) < off(*e)) {
                    best = Some((values, found, effect));
                }
            }
        }
        best
    }
}

/// The fit of a simulation to the outputs of another.
struct SelfRecord<'a> {
    compiled: &'a Compiled,
    drive: &'a Drive,
    target: &'a [Vec<f64>],
    fitted: &'a [usize],
    bounds: Vec<(f64, f64)>,
}

impl SelfRecord<'_> {
    fn theta(&self, values: &[f64]) -> Vec<f64> {
        let mut theta = self.compiled.theta();
        for (i, value) in self.fitted.iter().zip(values) {
            if let Some(slot) = theta.get_mut(*i) {
                *slot = *value;
            }
        }
        theta
    }

    fn stack(&self, outputs: &[Vec<f64>]) -> Vec<f64> {
        self.target.iter().zip(outputs).flat_map(|(t, y)| t.iter().zip(y).map(|(t, y)| t - y)).collect()
    }
}

impl Problem for SelfRecord<'_> {
    fn bounds(&self) -> &[(f64, f64)] {
        &self.bounds
    }

    fn residual(&self, values: &[f64]) -> Option<Vec<f64>> {
        let theta = self.theta(values);
        let response = self.compiled.simulate(&Run::new(self.drive, &theta).from(Start::Document(&[])));
        response.diverged.is_none().then(|| self.stack(&response.outputs))
    }

    fn tangent(&self, values: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
        let theta = self.theta(values);
        let directions: Vec<Direction<'_>> = self.fitted.iter().map(|i| Direction::Parameter(*i)).collect();
        let found = self.compiled.sensitivities(&Run::new(self.drive, &theta), &directions);
        let finite =
            found.response.diverged.is_none() && found.tangents.iter().flatten().flatten().all(|t| t.is_finite());
        let tangents = found.tangents.into_iter().map(|outputs| outputs.concat()).collect();
        finite.then(|| (self.stack(&found.response.outputs), tangents))
    }
}
