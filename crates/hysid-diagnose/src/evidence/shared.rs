//! Noise that the outputs of one machine share.
//!
//! What acts inside a machine is in all of its outputs. Each of them whitened by its own model, what they record at one moment still goes together, and a
//! likelihood that takes them for independent counts twice what is said twice. The correlation of the whitened rows at one moment is taken out by the inverse of
//! its Cholesky factor: each output's row less what those before it tell of it. It is there where it gains what its coefficients cost (BIC).
//!
//! Only runs that all outputs recorded without a gap have it; of the others the rows are taken as they are. Correlation at other lags is left.
//!
//! Reference: H. Luetkepohl, New Introduction to Multiple Time Series Analysis, Springer (2005), section 2.3 (orthogonal innovations).

use hysid_linalg::dot;
use nalgebra::DMatrix;

use super::layout::{Layout, Series};

/// The correlation of whitened rows of one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Shared {
    /// The lower Cholesky factor of the correlation matrix.
    factor: DMatrix<f64>,
}

impl Shared {
    /// Of whitened rows; `None` where there is one output only, or no correlation that pays.
    pub fn of(layout: &Layout, white: &[f64]) -> Option<Self> {
        let m = layout.outputs;
        let runs = layout.together(0..layout.outputs);
        let rows: usize = runs.iter().map(|run| run[0].rows.len()).sum();
        if m < 2 || rows == 0 {
            return None;
        }
        let mut products: DMatrix<f64> = DMatrix::zeros(m, m);
        for run in &runs {
            for i in 0..m {
                for j in 0..=i {
                    products[(i, j)] += dot(&white[run[i].rows.clone()], &white[run[j].rows.clone()]);
                }
            }
        }
        let scale = |i: usize| products[(i, i)].sqrt();
        let correlation = DMatrix::from_fn(m, m, |i, j| products[(i.max(j), i.min(j))] / (scale(i) * scale(j)));
        let shared = Self { factor: correlation.cholesky()?.l() };
        let gain = -(rows as f64) * shared.log_determinant();
        (gain > 0.5 * shared.coefficients() as f64 * (rows as f64).ln()).then_some(shared)
    }

    /// Takes out of each output's rows what those before it tell of them.
    pub fn take_out(&self, layout: &Layout, white: &mut [f64]) {
        self.each_moment(layout, white, |w| {
            for i in 0..w.len() {
                let known: f64 = (0..i).map(|j| self.factor[(i, j)] * w[j]).sum();
                w[i] = (w[i] - known) / self.factor[(i, i)];
            }
        });
    }

    /// The transpose of [`Shared::take_out`].
    pub fn transpose(&self, layout: &Layout, stack: &mut [f64]) {
        self.each_moment(layout, stack, |w| {
            for i in (0..w.len()).rev() {
                let known: f64 = (i + 1..w.len()).map(|j| self.factor[(j, i)] * w[j]).sum();
                w[i] = (w[i] - known) / self.factor[(i, i)];
            }
        });
    }

    /// Gives independent rows the correlation: the inverse of [`Shared::take_out`].
    pub fn put_in(&self, layout: &Layout, white: &mut [f64]) {
        self.each_moment(layout, white, |w| {
            for i in (0..w.len()).rev() {
                w[i] = (0..=i).map(|j| self.factor[(i, j)] * w[j]).sum();
            }
        });
    }

    fn each_moment(&self, layout: &Layout, white: &mut [f64], mut change: impl FnMut(&mut [f64])) {
        let mut moment = vec![0.0; layout.outputs];
        for run in layout.together(0..layout.outputs) {
            for k in 0..run[0].rows.len() {
                run.iter().zip(&mut moment).for_each(|(s, w)| *w = white[s.rows.start + k]);
                change(&mut moment);
                run.iter().zip(&moment).for_each(|(s, w)| white[s.rows.start + k] = *w);
            }
        }
    }

    /// Logarithm of what a row of a series is scaled by.
    pub fn log_scale(&self, layout: &Layout, s: &Series) -> f64 {
        let complete = layout.together(0..layout.outputs).iter().any(|run| run[s.output] == s);
        if complete { self.factor[(s.output, s.output)].ln() } else { 0.0 }
    }

    fn log_determinant(&self) -> f64 {
        self.factor.diagonal().iter().map(|d| d.ln()).sum()
    }

    /// Number of coefficients: one for each pair of outputs.
    pub fn coefficients(&self) -> usize {
        let m = self.factor.nrows();
        m * (m - 1) / 2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::norm2;
    use crate::oscillator::normal;

    const N: usize = 2000;

    /// Three outputs of which the third has a gap, and two that are complete.
    fn layout(outputs: usize, gap: bool) -> Layout {
        let mut series: Vec<Series> = Vec::new();
        for output in 0..outputs {
            let cut = if gap && output == 2 { 500 } else { 0 };
            let start = series.last().map_or(0, |s| s.rows.end);
            series.push(Series { stretch: 0, output, first: cut, rows: start..start + N - cut });
        }
        Layout { series, outputs }
    }

    fn noise(rows: usize) -> Vec<f64> {
        let mut random = normal(7);
        (0..rows).map(|_| random()).collect()
    }

    #[test]
    fn what_is_put_in_is_found_and_taken_out() {
        let layout = layout(3, false);
        let factor = DMatrix::from_row_slice(3, 3, &[1.0, 0.0, 0.0, 0.8, 0.6, 0.0, 0.0, 0.6, 0.8]);
        let independent = noise(layout.len());
        let mut white = independent.clone();
        Shared { factor: factor.clone() }.put_in(&layout, &mut white);
        let found = Shared::of(&layout, &white).unwrap();
        assert!((&found.factor - factor).abs().max() < 0.06, "{}", found.factor);
        let before = white.clone();
        found.take_out(&layout, &mut white);
        let together = dot(&white[..N], &white[N..2 * N]) / N as f64;
        assert!(together.abs() < 0.05, "{together}");
        found.put_in(&layout, &mut white);
        assert!(white.iter().zip(&before).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn the_likelihood_is_that_of_the_normal_law_of_both() {
        // Density of two rows of one moment with correlation r, by its closed form.
        let layout = layout(2, false);
        let r = 0.9_f64;
        let factor = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, r, (1.0 - r * r).sqrt()]);
        let shared = Shared { factor };
        let mut white = noise(layout.len());
        shared.put_in(&layout, &mut white);
        let expected: f64 = (0..N)
            .map(|k| {
                let (x, y) = (white[k], white[N + k]);
                -0.5 * (x * x - 2.0 * r * x * y + y * y) / (1.0 - r * r) - 0.5 * (1.0 - r * r).ln()
            })
            .sum();
        shared.take_out(&layout, &mut white);
        let scale: f64 = layout.series.iter().map(|s| s.rows.len() as f64 * shared.log_scale(&layout, s)).sum();
        let found = -0.5 * norm2(&white) - scale;
        assert!((found - expected).abs() < 1e-6 * expected.abs(), "{found} {expected}");
    }

    #[test]
    fn independent_rows_one_output_and_gaps_have_nothing_to_share() {
        let two = layout(2, false);
        assert_eq!(Shared::of(&two, &noise(two.len())), None);
        let one = layout(1, false);
        assert_eq!(Shared::of(&one, &noise(N)), None);
        let gap = layout(3, true);
        let same: Vec<f64> = noise(N).iter().chain(&noise(N)).chain(&noise(N)[500..]).copied().collect();
        assert_eq!(Shared::of(&gap, &same), None);
    }
}
