//! Whether coefficients are constant: the evidence for a coefficient that wanders, and the lines at which a score oscillates.
//!
//! A coefficient that wanders like a random walk is a sum of known courses with independent normal amplitudes whose variances fall as the
//! square of their order (Karhunen and Loeve), and one unknown scale. With the amplitudes integrated out the evidence of a scale is
//! that of a normal law whose covariance has a few large directions; it pays for each direction as far as the recording settles it, and not
//! half of `ln n` for each. For a small scale its gain is Nyblom's statistic: the weighted squares of the score's partial sums.
//! Scales are equally likely beforehand on a logarithmic grid, so that the ratio of evidences is one of two full laws and exceeds `x` by chance
//! with a probability of `1/x` at most.
//!
//! An oscillation stands out of the periodogram of the score, line by line against the power that noise alone makes there: the score has the
//! colour of what is modulated, and where that moves in few lines a whole comb of them.
//!
//! References: J. Nyblom, Testing for the constancy of parameters over time, JASA 84 (1989) 223; B. E. Hansen, Testing for parameter instability in
//! linear models, Journal of Policy Modeling 14 (1992) 517.

use hysid_linalg::dot;
use hysid_signal::fourier;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Scales of the normal amplitudes that are tried: the first one and the ratio of the next to it.
const SCALES: (f64, f64, usize) = (2e-4, 2.0, 16);

/// Normal amplitudes of a few columns.
#[derive(Debug, Clone)]
pub struct Wander {
    /// Eigenvalues of the columns' Gram matrix.
    values: Vec<f64>,
    /// The residual along the eigenvectors.
    along: Vec<f64>,
}

impl Wander {
    /// Of whitened columns, each for an amplitude of one standard deviation at scale one, and a whitened residual, all projected off what
    /// is estimated besides; each row counts for this share of one.
    pub fn new(columns: &[Vec<f64>], r: &[f64], share: f64) -> Self {
        let k = columns.len();
        let gram = DMatrix::from_fn(k, k, |a, b| share * dot(&columns[a], &columns[b]));
        let right = DVector::from_iterator(k, columns.iter().map(|c| share * dot(c, r)));
        let eigen = SymmetricEigen::new(gram);
        let along = eigen.eigenvectors.transpose() * right;
        Self { values: eigen.eigenvalues.iter().map(|v| v.max(0.0)).collect(), along: along.iter().copied().collect() }
    }

    /// Log evidence of amplitudes of this scale over that of none.
    pub fn gain(&self, scale: f64) -> f64 {
        let t = scale * scale;
        let one = |(v, a): (&f64, &f64)| 0.5 * (t * a * a / (1.0 + t * v) - (t * v).ln_1p());
        self.values.iter().zip(&self.along).map(one).sum()
    }

    /// The grid of scales.
    fn scales() -> impl Iterator<Item = f64> {
        let (first, ratio, count) = SCALES;
        (0..count).map(move |i| first * ratio.powi(i as i32))
    }

    /// The mean of the evidence over the scales, and the likeliest scale.
    pub fn mean_gain(&self) -> (f64, f64) {
        let gains: Vec<(f64, f64)> = Self::scales().map(|s| (self.gain(s), s)).collect();
        let (top, scale) = gains.iter().copied().fold((f64::NEG_INFINITY, 0.0), |a, b| if b.0 > a.0 { b } else { a });
        let mean = gains.iter().map(|(g, _)| (g - top).exp()).sum::<f64>() / gains.len() as f64;
        (top + mean.ln(), scale)
    }
}

/// A line of the periodogram of a score.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Cycles for each sample.
    pub cycles: f64,
    /// Power over what noise makes there.
    pub height: f64,
}

/// Cycles in the record below which an oscillation is none.
const FEWEST_CYCLES: f64 = 2.0;
/// Zero padding: lines lie this many times as close as the record's own.
const PADDED: usize = 2;
/// Lines to either side over which the power that noise makes is smoothed.
const SMOOTHED: usize = 3;

fn periodogram(series: &[f64]) -> Vec<f64> {
    let mut x = series.to_vec();
    x.resize(PADDED * series.len(), 0.0);
    fourier(&x).iter().map(|(re, im)| re * re + im * im).collect()
}

/// The highest lines of a score, at most `most`, highest first, against scores of the same kind that noise alone makes.
pub fn lines(score: &[f64], noises: &[Vec<f64>], most: usize) -> Vec<Line> {
    let power = periodogram(score);
    let mut level = vec![0.0; power.len()];
    for noise in noises {
        level.iter_mut().zip(periodogram(noise)).for_each(|(l, p)| *l += p / noises.len() as f64);
    }
    let last = power.len().saturating_sub(1);
    let smooth = |k: usize| {
        let near = &level[k.saturating_sub(SMOOTHED).max(1)..=(k + SMOOTHED).min(last)];
        near.iter().sum::<f64>() / near.len() as f64
    };
    let height: Vec<f64> =
        (0..power.len()).map(|k| if k == 0 || smooth(k) <= 0.0 { 0.0 } else { power[k] / smooth(k) }).collect();
    let first = (FEWEST_CYCLES * PADDED as f64) as usize;
    let mut found: Vec<Line> = (first..last)
        .filter(|&k| height[k] > height[k - 1] && height[k] >= height[k + 1])
        .map(|k| {
            let (a, b, c) = (power[k - 1].sqrt(), power[k].sqrt(), power[k + 1].sqrt());
            let bend = a - 2.0 * b + c;
            let shift = if bend < 0.0 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 };
            Line { cycles: (k as f64 + shift) / (PADDED * score.len()) as f64, height: height[k] }
        })
        .collect();
    found.sort_by(|a, b| b.height.total_cmp(&a.height));
    found.truncate(most);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::norm2;
    use rand_distr::{Distribution, StandardNormal};

    fn white(n: usize, seed: u64) -> Vec<f64> {
        let mut rng = crate::random::generator(seed, 21);
        (0..n).map(|_| StandardNormal.sample(&mut rng)).collect()
    }

    /// Courses of a Brownian motion over `n` samples, each times what it modulates.
    fn columns(n: usize, count: usize) -> Vec<Vec<f64>> {
        (0..count)
            .map(|k| {
                let w = (k as f64 + 0.5) * std::f64::consts::PI;
                (0..n).map(|i| 2f64.sqrt() / w * (w * i as f64 / n as f64).sin() * (0.3 * i as f64).cos()).collect()
            })
            .collect()
    }

    #[test]
    fn the_evidence_is_that_of_the_normal_law_with_the_whole_covariance() {
        let (n, share) = (40, 0.7);
        let (f, r) = (columns(n, 5), white(n, 3));
        for scale in [0.05, 0.8, 5.0] {
            // A share of each row is a noise of that much less weight.
            let noise = 1.0 / share;
            let whole = DMatrix::from_fn(n, n, |a, b| {
                f.iter().map(|c| c[a] * c[b]).sum::<f64>() * scale * scale + if a == b { noise } else { 0.0 }
            });
            let c = whole.cholesky().unwrap();
            let x = DVector::from_column_slice(&r);
            let log = -0.5 * x.dot(&c.solve(&x)) - c.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
            let none = -0.5 * norm2(&r) * share - 0.5 * n as f64 * noise.ln();
            let gain = Wander::new(&f, &r, share).gain(scale);
            assert!((gain - (log - none)).abs() < 1e-9, "{scale}: {gain} {}", log - none);
        }
    }

    #[test]
    fn for_a_small_scale_the_gain_is_nybloms_statistic() {
        // Sum over all times of the squared partial sums of the score, in the limit of many courses.
        let n = 400;
        let r = white(n, 5);
        let f = columns(n, 120);
        let s: Vec<f64> = r.iter().enumerate().map(|(i, r)| r * (0.3 * i as f64).cos()).collect();
        // Later scores: what a step of the walk at this time moves.
        let mut later = 0.0;
        let statistic: f64 = s
            .iter()
            .rev()
            .map(|x| {
                later += x;
                later * later
            })
            .sum::<f64>()
            / n as f64;
        let w = Wander::new(&f, &r, 1.0);
        let squares: f64 = w.along.iter().map(|a| a * a).sum();
        assert!((squares - statistic).abs() < 0.03 * statistic, "{squares} {statistic}");
    }

    #[test]
    fn noise_gains_x_with_a_probability_of_exp_minus_x_at_most() {
        let n = 300;
        let f = columns(n, 12);
        let gains: Vec<f64> = (0..2000).map(|s| Wander::new(&f, &white(n, s), 1.0).mean_gain().0).collect();
        for x in [0.5f64, 1.0, 2.0, 3.0] {
            let share = gains.iter().filter(|g| **g > x).count() as f64 / gains.len() as f64;
            assert!(share <= (-x).exp() + 3.0 * ((-x).exp() / 2000.0).sqrt(), "{x}: {share}");
        }
    }

    #[test]
    fn a_walk_that_is_there_is_found_with_its_scale_and_course() {
        let (n, scale) = (1000, 3.0);
        let f = columns(n, 12);
        let amplitudes: Vec<f64> = white(12, 8).iter().map(|a| a * scale).collect();
        let mut r = white(n, 9);
        f.iter().zip(&amplitudes).for_each(|(c, a)| r.iter_mut().zip(c).for_each(|(r, c)| *r += a * c));
        let w = Wander::new(&f, &r, 1.0);
        let (gain, likeliest) = w.mean_gain();
        assert!(gain > 50.0 && likeliest > 0.5 * scale && likeliest < 2.0 * scale, "{gain} {likeliest}");
        // The likeliest amplitudes at that scale, from the normal equations.
        let precision = 1.0 / (likeliest * likeliest);
        let normal = DMatrix::from_fn(12, 12, |a, b| dot(&f[a], &f[b]) + if a == b { precision } else { 0.0 });
        let right = DVector::from_iterator(12, f.iter().map(|c| dot(c, &r)));
        let found = normal.cholesky().unwrap().solve(&right);
        assert!((found[0] - amplitudes[0]).abs() < 0.2 * scale, "{found:?} {amplitudes:?}");
    }

    #[test]
    fn a_line_is_found_in_coloured_noise_and_its_frequency_between_the_lines() {
        let coloured = |seed: u64| {
            let mut x = white(1500, seed);
            (1..1500).for_each(|i| x[i] += 0.95 * x[i - 1]);
            x
        };
        let mut x = coloured(4);
        x.iter_mut().enumerate().for_each(|(i, x)| *x += 0.5 * (std::f64::consts::TAU * 0.1234 * i as f64).cos());
        let noises: Vec<Vec<f64>> = (20..27).map(coloured).collect();
        let found = lines(&x, &noises, 2);
        assert!((found[0].cycles - 0.1234).abs() < 5e-5, "{found:?}");
        assert!(found[0].height > 20.0 && found[1].height < 18.0, "{found:?}");
    }
}
