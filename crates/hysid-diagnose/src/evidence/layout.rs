//! How samples are stacked into rows, and the whitening of such a stack.

use std::ops::Range;
use std::sync::Arc;

use super::noise::NoiseModel;
use super::response::{Course, ForcePath};
use super::shared::Shared;

/// A run of rows that follow each other in time: one output of one stretch, between gaps.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// The stretch of the data set (a contiguous simulation run).
    pub stretch: usize,
    /// The output.
    pub output: usize,
    /// First sample within the stretch.
    pub first: usize,
    /// The rows in the stack; as many samples follow `first`.
    pub rows: Range<usize>,
}

impl Series {
    /// Whether the other holds the same moments.
    pub fn is_beside(&self, other: &Self) -> bool {
        (self.stretch, self.first, self.rows.len()) == (other.stretch, other.first, other.rows.len())
    }
}

/// The rows of a stack.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Layout {
    /// In order of rows, without holes.
    pub series: Vec<Series>,
    /// Number of outputs.
    pub outputs: usize,
}

impl Layout {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.series.last().map_or(0, |s| s.rows.end)
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The series, each after its place among those of its output.
    pub fn runs(&self) -> impl Iterator<Item = (usize, &Series)> {
        let mut seen = vec![0; self.outputs];
        self.series.iter().map(move |s| {
            seen[s.output] += 1;
            (seen[s.output] - 1, s)
        })
    }

    /// One noise model for each output, fitted to this stacked residual, with what they share (neither colour nor that for an order of 0); `paths[output]` are the
    /// ways of an unknown force to it, where there are any.
    pub fn fit_noise(&self, residual: &[f64], max_order: usize, paths: &[Vec<ForcePath>]) -> Whitener {
        self.fit_noise_along(residual, max_order, paths, |output, way| paths[output][way].course())
    }

    /// The same with courses of the ways, by output and place among them, that are made where they are asked for.
    pub fn fit_noise_along(
        &self,
        residual: &[f64],
        max_order: usize,
        paths: &[Vec<ForcePath>],
        course: impl Fn(usize, usize) -> Option<Arc<Course>>,
    ) -> Whitener {
        let models = (0..self.outputs)
            .map(|o| {
                let stretches: Vec<&[f64]> =
                    self.series.iter().filter(|s| s.output == o).map(|s| &residual[s.rows.clone()]).collect();
                NoiseModel::along(&stretches, max_order, paths.get(o).map_or(&[], Vec::as_slice), |way| course(o, way))
            })
            .collect();
        let each = Whitener::of(models);
        let shared = if max_order > 0 { Shared::of(self, &each.apply(self, residual)) } else { None };
        Whitener { shared, ..each }
    }

    /// Root mean square of each output's rows of a stack.
    pub fn rms(&self, stack: &[f64]) -> Vec<f64> {
        (0..self.outputs)
            .map(|o| {
                let (mut sum, mut count) = (0.0, 0usize);
                for s in self.series.iter().filter(|s| s.output == o) {
                    sum += stack[s.rows.clone()].iter().map(|x| x * x).sum::<f64>();
                    count += s.rows.len();
                }
                if count == 0 { 0.0 } else { (sum / count as f64).sqrt() }
            })
            .collect()
    }
}

/// The noise of the outputs: the model of each, and what they share.
#[derive(Debug, Clone, PartialEq)]
pub struct Whitener {
    /// In the order of the outputs.
    pub models: Vec<NoiseModel>,
    /// What the whitened outputs still share.
    shared: Option<Shared>,
}

impl Whitener {
    /// Of outputs that share no noise.
    pub fn of(models: Vec<NoiseModel>) -> Self {
        Self { models, shared: None }
    }

    /// The stack, each series whitened by its output's model.
    pub fn apply(&self, layout: &Layout, stack: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; stack.len()];
        self.apply_into(layout, stack, &mut out);
        out
    }

    /// As [`Whitener::apply`], into a buffer of the same length.
    pub fn apply_into(&self, layout: &Layout, stack: &[f64], out: &mut [f64]) {
        for (run, s) in layout.runs() {
            self.models[s.output].whiten(run, &stack[s.rows.clone()], &mut out[s.rows.clone()]);
        }
        if let Some(shared) = &self.shared {
            shared.take_out(layout, out);
        }
    }

    /// The transpose of [`Whitener::apply`], in place.
    pub fn transpose(&self, layout: &Layout, stack: &mut [f64]) {
        if let Some(shared) = &self.shared {
            shared.transpose(layout, stack);
        }
        for (run, s) in layout.runs() {
            self.models[s.output].transpose(run, &mut stack[s.rows.clone()]);
        }
    }

    /// The same for rows of another motion than that it was fitted to: what a force makes there is known by the mean of its ways.
    pub fn elsewhere(&self) -> Self {
        Self { models: self.models.iter().map(NoiseModel::elsewhere).collect(), shared: self.shared.clone() }
    }

    /// Colours unit white noise in place: the inverse of [`Whitener::apply`].
    pub fn colour(&self, layout: &Layout, stack: &mut [f64]) {
        if let Some(shared) = &self.shared {
            shared.put_in(layout, stack);
        }
        for (run, s) in layout.runs() {
            self.models[s.output].colour(run, &mut stack[s.rows.clone()]);
        }
    }

    /// Sum over rows of the logarithm of the innovation's standard deviation: the determinant's share of a log likelihood.
    pub fn log_scale(&self, layout: &Layout) -> f64 {
        layout.runs().map(|(run, s)| self.log_scale_of(layout, run, s)).sum()
    }

    /// The share that a series, after its place among those of its output, has in [`Whitener::log_scale`].
    pub fn log_scale_of(&self, layout: &Layout, run: usize, s: &Series) -> f64 {
        let shared = self.shared.as_ref().map_or(0.0, |shared| shared.log_scale(layout, s));
        self.models[s.output].log_scale(run, s.rows.len()) + s.rows.len() as f64 * shared
    }

    /// Number of coefficients beyond the scales.
    pub fn coefficients(&self) -> usize {
        let shared = self.shared.as_ref().map_or(0, Shared::coefficients);
        self.models.iter().map(NoiseModel::coefficients).sum::<usize>() + shared
    }

    /// Whether each output's noise is white, whatever they share.
    pub fn is_white(&self) -> bool {
        self.models.iter().all(|m| m.coefficients() == 0)
    }

    /// Whether an output's noise is that of an unknown force through the plant.
    pub fn is_driven(&self) -> bool {
        self.models.iter().any(NoiseModel::is_driven)
    }

    /// The largest order.
    pub fn order(&self) -> usize {
        self.models.iter().map(NoiseModel::order).max().unwrap_or(0)
    }
}
