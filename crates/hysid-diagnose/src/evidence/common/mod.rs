//! Noise of several outputs that one unknown force makes beside the noises of their sensors.
//!
//! Each output whitened by itself keeps what the others tell of it: the force is in all of them, in each with a delay and a shape of its own. The joint filter of all
//! takes it out of each, and what is left is independent from output to output and from row to row.
//!
//! The size of the force and the noise of each sensor are those of the highest likelihood, from those that the outputs have by themselves.
//!
//! Reference: B. D. O. Anderson, J. B. Moore, Optimal Filtering, Prentice-Hall (1979), sec. 5.3 (innovations), 6.4 (outputs one after the other).

use std::sync::Arc;

use super::below::Below;
use super::driven::fit::{likeliest_pole, search};
use super::driven::{Driven, differenced, first_scale, remembered, transpose_differenced};
use super::layout::{Layout, Series};
use super::noise::NoiseModel;
use super::response::{CommonPath, MovingFilter, Sensor};

/// Rounds in which sizes of the sensors' noises and of the force are looked for in turn, and the log likelihood below which another one is not worth it.
const ROUNDS: (usize, f64) = (4, 0.05);
/// Decades between the first guesses of the force's variance.
const SHARE: f64 = 0.5;
/// A pole of a sensor's noise that is tried where it has none by itself.
const FIRST_POLE: f64 = 0.5;
/// Ends within which a sensor's noise changes from one guess to the next.
const CHANGE: (f64, f64) = (0.1, 3.0);

/// A force that several outputs have in common, and the noise of each one's sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct CommonForce {
    outputs: Vec<usize>,
    entry: usize,
    /// Poles of the autoregressions of force and sensors, 0 where they are white.
    pole: f64,
    sensors: Vec<Sensor>,
    filter: Arc<MovingFilter>,
    below: Below,
}

/// A guess of the noises: variance and pole of the force, each sensor.
#[derive(Debug, Clone)]
struct Guess {
    variance: f64,
    pole: f64,
    sensors: Vec<Sensor>,
}

/// What a guess comes to: the log likelihood with the best scale of all noises together, that scale squared, and the variance of each output's innovations.
struct Outcome {
    likelihood: f64,
    variance: f64,
    each: Vec<f64>,
}

/// A residual in the runs that its outputs recorded together, by the way of a force to all of them.
struct Problem<'a> {
    path: &'a CommonPath,
    /// Of each run, each output.
    runs: Vec<Vec<&'a [f64]>>,
}

impl Problem<'_> {
    /// Moments of all runs.
    fn moments(&self) -> f64 {
        self.runs.iter().map(|run| run[0].len()).sum::<usize>() as f64
    }

    fn of(&self, guess: &Guess) -> Option<Outcome> {
        let stretches: Vec<Vec<f64>> = self.runs.iter().map(|run| interleaved(run, &guess.sensors)).collect();
        let moved = self.path.interleaved(&guess.sensors, guess.pole);
        let (squares, logs) = moved.innovations(guess.variance, &stretches)?;
        let (moments, outputs) = (self.moments(), squares.len() as f64);
        let each: Vec<f64> = squares.iter().map(|squares| squares / moments).collect();
        let variance = each.iter().sum::<f64>() / outputs;
        let scale = |s: &Sensor| self.runs.len() as f64 * first_scale(s.pole).ln() - moments * s.sigma.ln();
        let scales: f64 = guess.sensors.iter().map(scale).sum();
        let likelihood = -0.5 * moments * outputs * (1.0 + variance.ln()) - logs + scales;
        likelihood.is_finite().then_some(Outcome { likelihood, variance, each })
    }

    /// With the sensors' noises so much larger or smaller as their innovations are.
    fn rescaled(&self, guess: &Guess, outcome: &Outcome) -> Option<(Guess, Outcome)> {
        let mut next = guess.clone();
        for (s, each) in next.sensors.iter_mut().zip(&outcome.each) {
            s.sigma *= each.sqrt().clamp(CHANGE.0, CHANGE.1);
        }
        let outcome = self.of(&next)?;
        Some((next, outcome))
    }

    /// The sensors' noises of the highest likelihood beside a force of this size, or nearly so.
    fn balanced(&self, mut best: (Guess, Outcome)) -> (Guess, Outcome) {
        for _ in 0..ROUNDS.0 {
            let before = best.1.likelihood;
            match self.rescaled(&best.0, &best.1) {
                Some(next) if next.1.likelihood > before => best = next,
                _ => break,
            }
            if best.1.likelihood < before + ROUNDS.1 {
                break;
            }
        }
        best
    }

    /// The likeliest sizes from balanced ones on.
    fn sized(&self, mut best: (Guess, Outcome)) -> (Guess, Outcome) {
        for _ in 0..ROUNDS.0 {
            let before = best.1.likelihood;
            let at = |decade: f64| {
                let guess = Guess { variance: best.0.variance * 10f64.powf(decade), ..best.0.clone() };
                let outcome = self.of(&guess)?;
                Some((outcome.likelihood, (guess, outcome)))
            };
            if let Some((_, _, found)) = search((0.0, SHARE), at) {
                best = found;
            }
            if best.1.likelihood < before + ROUNDS.1 {
                break;
            }
            best = self.balanced(best);
        }
        best
    }

    /// The likeliest memory of one sensor's noise, where it pays `price`.
    fn remembering(&self, best: (Guess, Outcome), output: usize, price: f64) -> (Guess, Outcome) {
        let own = best.0.sensors[output];
        let at = |pole: f64| {
            let mut guess = best.0.clone();
            // As large as before.
            guess.sensors[output] = Sensor { pole, sigma: own.sigma * first_scale(pole) / first_scale(own.pole) };
            let found = self.of(&guess).and_then(|outcome| self.rescaled(&guess, &outcome))?;
            Some((found.1.likelihood, found))
        };
        let (start, price) = if own.pole > 0.0 { (own.pole, 0.0) } else { (FIRST_POLE, price) };
        if own.pole == 0.0 && at(start).is_none_or(|(likelihood, _)| likelihood < best.1.likelihood) {
            return best;
        }
        let found = likeliest_pole(start, at).filter(|(likelihood, _)| *likelihood > best.1.likelihood + price);
        found.map_or(best, |(_, found)| found)
    }
}

impl CommonForce {
    /// Of a stacked residual, from the noises that its outputs have by themselves, where that of one of them is such a force; a memory where it pays `price`.
    pub fn fit(
        path: &CommonPath,
        layout: &Layout,
        residual: &[f64],
        models: &[NoiseModel],
        price: f64,
    ) -> Option<Self> {
        let outputs = path.outputs();
        let runs = complete(layout, outputs)?;
        if runs.is_empty() || !path.moments().eq(runs.iter().map(|run| run[0].rows.len())) {
            return None;
        }
        let runs = runs.iter().map(|run| run.iter().map(|s| &residual[s.rows.clone()]).collect()).collect();
        let problem = Problem { path, runs };
        let own = |o: usize| models[o].driven().filter(|driven| driven.entry == path.entry());
        // Where an output tells nothing of the force, its noise may be white or remember.
        let sensor = |&o: &usize, pole: f64| match own(o) {
            Some(driven) => Sensor { sigma: driven.sigma, pole: driven.colours.sensor },
            None => Sensor { sigma: models[o].innovation(), pole },
        };
        let start = |driven: &Driven, pole: f64| {
            let sensors: Vec<Sensor> = outputs.iter().map(|o| sensor(o, pole)).collect();
            let variance = driven.share * driven.sigma * driven.sigma;
            let possible = sensors.iter().all(|s| s.sigma > 0.0);
            let guess = possible.then_some(Guess { variance, pole: driven.colours.force, sensors })?;
            let outcome = problem.of(&guess)?;
            Some(problem.balanced((guess, outcome)))
        };
        let poles: &[f64] = if outputs.iter().all(|&o| own(o).is_some()) { &[0.0] } else { &[0.0, FIRST_POLE] };
        // Balanced, the force of one output tells already whether that of another is nearer.
        let likeliest = (outputs.iter().filter_map(|&o| own(o)))
            .flat_map(|driven| poles.iter().filter_map(|&pole| start(driven, pole)))
            .max_by(|a, b| a.1.likelihood.total_cmp(&b.1.likelihood))?;
        let (mut guess, mut outcome) = problem.sized(likeliest);
        for _ in 0..ROUNDS.0 {
            let before = outcome.likelihood;
            let remembering = |best, output| problem.remembering(best, output, price);
            let remembered = (0..outputs.len()).fold((guess, outcome), remembering);
            (guess, outcome) = problem.sized(problem.balanced(remembered));
            if outcome.likelihood < before + ROUNDS.1 {
                break;
            }
        }
        let sensors =
            (guess.sensors.iter()).map(|s| Sensor { sigma: s.sigma * outcome.variance.sqrt(), ..*s }).collect();
        // In units of the sensors' noises the force has the variance that it had.
        let filter = Arc::new(path.interleaved(&guess.sensors, guess.pole).filter(guess.variance)?);
        let (outputs, entry) = (outputs.to_vec(), path.entry());
        Some(Self { outputs, entry, pole: guess.pole, sensors, filter, below: Below::rising(1.0) })
    }

    /// The state in whose derivative the force enters.
    pub fn entry(&self) -> usize {
        self.entry
    }

    /// Whether the force is in an output.
    pub fn has(&self, output: usize) -> bool {
        self.outputs.contains(&output)
    }

    /// Number of coefficients beyond the scales: the size of the force, and each pole.
    pub fn coefficients(&self) -> usize {
        let poles = self.sensors.iter().map(|s| s.pole).chain([self.pole]);
        1 + poles.filter(|pole| *pole != 0.0).count()
    }

    /// The runs of a layout that it was fitted to; `None` where it has others.
    pub fn runs<'a>(&self, layout: &'a Layout) -> Option<Vec<Vec<&'a Series>>> {
        let known = |(i, run): (usize, &Vec<&Series>)| self.filter.has(i, run[0].rows.len() * self.outputs.len());
        complete(layout, &self.outputs).filter(|runs| runs.iter().enumerate().all(known))
    }

    /// Whitens the outputs of these runs.
    pub fn whiten(&self, runs: &[Vec<&Series>], stack: &[f64], out: &mut [f64]) {
        let outputs = self.outputs.len();
        for (i, run) in runs.iter().enumerate() {
            let of_run: Vec<&[f64]> = run.iter().map(|s| &stack[s.rows.clone()]).collect();
            let e = interleaved(&of_run, &self.sensors);
            self.filter.run(i, |sigma, predicted, k| {
                out[run[k % outputs].rows.start + k / outputs] = (e[k] - predicted) / sigma;
                e[k] - predicted
            });
            run.iter().for_each(|s| self.below.whiten(&mut out[s.rows.clone()]));
        }
    }

    /// The transpose of [`CommonForce::whiten`], in place.
    pub fn transpose(&self, runs: &[Vec<&Series>], stack: &mut [f64]) {
        let outputs = self.outputs.len();
        for (i, run) in runs.iter().enumerate() {
            run.iter().for_each(|s| self.below.whiten(&mut stack[s.rows.clone()]));
            let row = |k: usize| run[k % outputs].rows.start + k / outputs;
            let mut v: Vec<f64> = (0..outputs * run[0].rows.len()).map(|k| stack[row(k)]).collect();
            self.filter.transpose(i, &mut v);
            v.iter().enumerate().for_each(|(k, v)| stack[row(k)] = v / self.sensors[k % outputs].sigma);
            for (s, sensor) in run.iter().zip(&self.sensors) {
                transpose_differenced(&mut stack[s.rows.clone()], sensor.pole);
            }
        }
    }

    /// Colours unit white noise in place.
    pub fn colour(&self, runs: &[Vec<&Series>], stack: &mut [f64]) {
        let outputs = self.outputs.len();
        for (i, run) in runs.iter().enumerate() {
            run.iter().for_each(|s| self.below.colour(&mut stack[s.rows.clone()]));
            self.filter.run(i, |sigma, predicted, k| {
                let w = &mut stack[run[k % outputs].rows.start + k / outputs];
                let innovation = *w * sigma;
                *w = (predicted + innovation) * self.sensors[k % outputs].sigma;
                innovation
            });
            for (s, sensor) in run.iter().zip(&self.sensors) {
                remembered(&mut stack[s.rows.clone()], sensor.pole);
            }
        }
    }

    /// Logarithm of the determinant of the map from the white samples of one output's series in run `i`.
    pub fn log_scale(&self, i: usize, s: &Series) -> f64 {
        let Some(at) = self.outputs.iter().position(|&o| o == s.output) else { return 0.0 };
        let sensor = self.sensors[at];
        let own = self.filter.log_scale_of(i, at, self.outputs.len());
        s.rows.len() as f64 * sensor.sigma.ln() + own - first_scale(sensor.pole).ln() + self.below.log_scale()
    }
}

/// The runs that these outputs recorded together; `None` where one of them has others too.
fn complete<'a>(layout: &'a Layout, outputs: &[usize]) -> Option<Vec<Vec<&'a Series>>> {
    let runs = layout.together(outputs.iter().copied());
    let all = layout.series.iter().filter(|s| outputs.contains(&s.output)).count();
    (all == runs.len() * outputs.len()).then_some(runs)
}

/// The outputs of a run one after the other, each in units of its sensor's innovations and less what the sensor's noise before tells of it.
fn interleaved(run: &[&[f64]], sensors: &[Sensor]) -> Vec<f64> {
    let mut rows = vec![0.0; run.len() * run[0].len()];
    for (o, (e, sensor)) in run.iter().zip(sensors).enumerate() {
        let e = differenced(e, sensor.pole);
        rows.iter_mut().skip(o).step_by(run.len()).zip(e.iter()).for_each(|(row, e)| *row = e / sensor.sigma);
    }
    rows
}

#[cfg(test)]
mod tests;
