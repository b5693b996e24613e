//! How samples are stacked into rows, and the whitening of such a stack.

use std::ops::Range;

use super::noise::NoiseModel;
use super::response::ForcePath;

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

    /// One noise model for each output, fitted to this stacked residual; `paths[output]` are the ways of an unknown force to it, where there are any.
    pub fn fit_noise(&self, residual: &[f64], max_order: usize, paths: &[Vec<ForcePath>]) -> Whitener {
        let models = (0..self.outputs)
            .map(|o| {
                let stretches: Vec<&[f64]> =
                    self.series.iter().filter(|s| s.output == o).map(|s| &residual[s.rows.clone()]).collect();
                NoiseModel::fit(&stretches, max_order, paths.get(o).map_or(&[], Vec::as_slice))
            })
            .collect();
        Whitener { models }
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

/// The noise model of each output.
#[derive(Debug, Clone, PartialEq)]
pub struct Whitener {
    /// In the order of the outputs.
    pub models: Vec<NoiseModel>,
}

impl Whitener {
    /// The stack, each series whitened by its output's model.
    pub fn apply(&self, layout: &Layout, stack: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; stack.len()];
        self.apply_into(layout, stack, &mut out);
        out
    }

    /// As [`Whitener::apply`], into a buffer of the same length.
    pub fn apply_into(&self, layout: &Layout, stack: &[f64], out: &mut [f64]) {
        for s in &layout.series {
            self.models[s.output].whiten(&stack[s.rows.clone()], &mut out[s.rows.clone()]);
        }
    }

    /// Sum over rows of the logarithm of the innovation's standard deviation: the determinant's share of a log likelihood.
    pub fn log_scale(&self, layout: &Layout) -> f64 {
        layout.series.iter().map(|s| self.models[s.output].log_scale(s.rows.len())).sum()
    }

    /// Number of coefficients beyond the scales.
    pub fn coefficients(&self) -> usize {
        self.models.iter().map(NoiseModel::coefficients).sum()
    }

    /// The largest order.
    pub fn order(&self) -> usize {
        self.models.iter().map(NoiseModel::order).max().unwrap_or(0)
    }
}
