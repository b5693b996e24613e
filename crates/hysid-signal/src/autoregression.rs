//! The autoregressive model of a noise: order by BIC, coefficients by Burg's recursion over several stretches.
//!
//! `e[n] = a_1 e[n-1] + ... + a_p e[n-p] + sigma w[n]`, `w` white with unit variance; `e` and `sigma` have the unit of the signal. All lower orders are kept, so that the first
//! `p` samples of a stretch are whitened by their own shorter predictors: the transformation is the Cholesky factor of the stationary
//! covariance, not an approximation that drops samples.
//!
//! Reference: J. P. Burg, Maximum entropy spectral analysis (1975); P. J. Brockwell and R. A. Davis, Time Series, section 5.2.

/// The orders that are compared.
const ORDERS: [usize; 8] = [0, 1, 2, 3, 4, 8, 12, 16];

/// An autoregressive model with every lower order of the recursion that led to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Autoregression {
    /// `predictors[k]` holds the `k` coefficients of the predictor of order `k`; the last one is the model.
    predictors: Vec<Vec<f64>>,
    /// Standard deviation of each order's prediction error, in the unit of the series.
    sigma: Vec<f64>,
}

impl Autoregression {
    /// White noise of this standard deviation.
    pub fn white(sigma: f64) -> Self {
        Self { predictors: vec![Vec::new()], sigma: vec![sigma.max(f64::MIN_POSITIVE)] }
    }

    /// The model of these stretches of one noise, its order the one of the smallest BIC up to `max_order`.
    ///
    /// The mean is not removed: a bias is the business of the caller. Series too short for an order are left out of that order.
    pub fn fit(stretches: &[&[f64]], max_order: usize) -> Self {
        let total: usize = stretches.iter().map(|s| s.len()).sum();
        let power: f64 = stretches.iter().flat_map(|s| s.iter()).map(|x| x * x).sum();
        if total == 0 || power <= 0.0 || !power.is_finite() {
            return Self::white(if power.is_finite() { f64::MIN_POSITIVE.sqrt() } else { 1.0 });
        }
        let max_order = max_order.min(total / 20);
        let mut forward: Vec<Vec<f64>> = stretches.iter().map(|s| s.to_vec()).collect();
        let mut backward = forward.clone();
        let mut predictors = vec![Vec::new()];
        let mut variance = vec![power / total as f64];
        for k in 1..=max_order {
            let (mut cross, mut energy) = (0.0, 0.0);
            for (f, b) in forward.iter().zip(&backward) {
                for n in k..f.len() {
                    cross += f[n] * b[n - 1];
                    energy += f[n] * f[n] + b[n - 1] * b[n - 1];
                }
            }
            if energy <= 0.0 {
                break;
            }
            let reflection = (2.0 * cross / energy).clamp(-0.999_999, 0.999_999);
            for (f, b) in forward.iter_mut().zip(backward.iter_mut()) {
                for n in (k..f.len()).rev() {
                    let (fo, bo) = (f[n], b[n - 1]);
                    f[n] = fo - reflection * bo;
                    b[n] = bo - reflection * fo;
                }
            }
            let last = &predictors[k - 1];
            let mut next: Vec<f64> = (0..k - 1).map(|i| last[i] - reflection * last[k - 2 - i]).collect();
            next.push(reflection);
            variance.push(variance[k - 1] * (1.0 - reflection * reflection));
            predictors.push(next);
        }
        let best = ORDERS
            .iter()
            .copied()
            .filter(|&p| p < variance.len())
            .min_by(|&a, &b| {
                let bic = |p: usize| total as f64 * variance[p].max(1e-300).ln() + p as f64 * (total as f64).ln();
                bic(a).total_cmp(&bic(b))
            })
            .unwrap_or(0);
        predictors.truncate(best + 1);
        variance.truncate(best + 1);
        let sigma = variance.iter().map(|v| v.sqrt().max(f64::MIN_POSITIVE)).collect();
        Self { predictors, sigma }
    }

    /// The order `p`.
    pub fn order(&self) -> usize {
        self.predictors.len() - 1
    }

    /// The coefficients `a_1 .. a_p`.
    pub fn coefficients(&self) -> &[f64] {
        self.predictors.last().map_or(&[], Vec::as_slice)
    }

    /// Standard deviation of the innovations `sigma w[n]`.
    pub fn innovation(&self) -> f64 {
        self.sigma.last().copied().unwrap_or(f64::MIN_POSITIVE)
    }

    /// Natural logarithm of the power at a frequency in cycles a sample, over that of the innovations.
    pub fn log_power(&self, frequency: f64) -> f64 {
        let (mut re, mut im) = (1.0, 0.0);
        for (i, a) in self.coefficients().iter().enumerate() {
            let (sin, cos) = (std::f64::consts::TAU * frequency * (i + 1) as f64).sin_cos();
            re -= a * cos;
            im += a * sin;
        }
        -(re * re + im * im).max(f64::MIN_POSITIVE).ln()
    }

    /// Standard deviation of the noise itself (order 0).
    pub fn noise_rms(&self) -> f64 {
        self.sigma.first().copied().unwrap_or(0.0)
    }

    /// Whitens one contiguous stretch into `out` (same length): unit variance where the model holds.
    pub fn whiten(&self, e: &[f64], out: &mut [f64]) {
        let p = self.order();
        for n in 0..e.len().min(p) {
            let a = &self.predictors[n];
            let predicted: f64 = a.iter().enumerate().map(|(i, a)| a * e[n - 1 - i]).sum();
            out[n] = (e[n] - predicted) / self.sigma[n];
        }
        let (a, scale) = (self.coefficients(), 1.0 / self.innovation());
        for n in p..e.len() {
            let mut w = e[n];
            for (i, a) in a.iter().enumerate() {
                w -= a * e[n - 1 - i];
            }
            out[n] = w * scale;
        }
    }

    /// Whitens a series with missing samples in place. Only where `present` is true a sample counts; the others become 0, and
    /// after one the filter starts anew.
    pub fn whiten_present(&self, series: &mut [f64], present: &[bool]) {
        let source = series.to_vec();
        series.fill(0.0);
        let mut first = 0;
        for run in present[..source.len()].chunk_by(|a, b| a == b) {
            let rows = first..first + run.len();
            first = rows.end;
            if run[0] {
                self.whiten(&source[rows.clone()], &mut series[rows]);
            }
        }
    }

    /// Colours unit white noise in place: the inverse of [`Autoregression::whiten`].
    pub fn colour(&self, w: &mut [f64]) {
        let p = self.order();
        for n in 0..w.len() {
            let k = n.min(p);
            let a = &self.predictors[k];
            let predicted: f64 = a.iter().enumerate().map(|(i, a)| a * w[n - 1 - i]).sum();
            w[n] = predicted + self.sigma[k] * w[n];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn white(n: usize, seed: u64) -> Vec<f64> {
        crate::white_noise(n, 1.0, seed).unwrap()
    }

    #[test]
    fn the_coefficients_of_a_known_process_come_back() {
        let mut e = white(20_000, 3);
        for n in 2..e.len() {
            e[n] += 1.5 * e[n - 1] - 0.8 * e[n - 2];
        }
        let m = Autoregression::fit(&[&e[..9000], &e[9000..]], 16);
        assert_eq!(m.order(), 2, "{:?}", m.coefficients());
        assert!((m.coefficients()[0] - 1.5).abs() < 0.02 && (m.coefficients()[1] + 0.8).abs() < 0.02);
        assert!((m.innovation() - 1.0).abs() < 0.02);
    }

    #[test]
    fn white_noise_stays_white() {
        assert_eq!(Autoregression::fit(&[&white(3000, 7)], 16).order(), 0);
    }

    #[test]
    fn whitening_and_colouring_are_inverse() {
        let mut e = white(500, 1);
        for n in 1..e.len() {
            e[n] += 0.9 * e[n - 1];
        }
        let m = Autoregression::fit(&[&e], 16);
        let mut w = vec![0.0; e.len()];
        m.whiten(&e, &mut w);
        m.colour(&mut w);
        for (a, b) in e.iter().zip(&w) {
            assert!((a - b).abs() < 1e-9 * (1.0 + a.abs()));
        }
    }

    #[test]
    fn the_first_samples_have_unit_variance_too() {
        // Many short stretches of one AR(1): the first samples' whitened variance is 1 although the process starts in its stationary state.
        let model = {
            let mut e = white(50_000, 5);
            for n in 1..e.len() {
                e[n] += 0.9 * e[n - 1];
            }
            Autoregression::fit(&[&e], 4)
        };
        let (mut sum, mut count) = (0.0, 0);
        for seed in 0..400 {
            let mut e = white(220, 1000 + seed);
            for n in 1..e.len() {
                e[n] += 0.9 * e[n - 1];
            }
            let mut w = vec![0.0; 20];
            model.whiten(&e[200..], &mut w);
            sum += w[0] * w[0];
            count += 1;
        }
        assert!((sum / count as f64 - 1.0).abs() < 0.25, "{}", sum / count as f64);
    }

    #[test]
    fn a_missing_sample_parts_two_stretches() {
        let mut e = white(300, 2);
        (1..e.len()).for_each(|n| e[n] += 0.9 * e[n - 1]);
        let m = Autoregression::fit(&[&e], 4);
        let mut parted = e.clone();
        parted[100] = f64::NAN;
        let present: Vec<bool> = parted.iter().map(|x| x.is_finite()).collect();
        m.whiten_present(&mut parted, &present);
        let mut alone = vec![0.0; 199];
        m.whiten(&e[101..], &mut alone);
        assert_eq!(parted[100], 0.0);
        assert_eq!(parted[101..], alone[..]);
    }

    #[test]
    fn silence_is_no_failure() {
        assert_eq!(Autoregression::fit(&[&[0.0; 100]], 16).order(), 0);
        assert_eq!(Autoregression::fit(&[], 16).order(), 0);
    }
}
