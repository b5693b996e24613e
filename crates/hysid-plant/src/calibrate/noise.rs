//! Coloured noise as an autoregression: Burg's estimate, its order by BIC, and the filter that whitens with it.
//!
//! Conventions: `e[n] + a[0] e[n-1] + ... + a[p-1] e[n-p] = sigma w[n]`. A missing sample starts the filter anew; the first
//! `p` samples of a stretch are filtered with the lower orders' prediction (their Levinson stages), so none is lost.
//! References: Burg (1975); Schwarz (1978).

/// An autoregressive noise model.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseModel {
    /// Coefficients, without the leading 1.
    pub ar: Vec<f64>,
    /// Standard deviation of the innovations, in the output's unit.
    pub sigma: f64,
    /// Lower-order predictors and their innovation's standard deviation, for the start of a stretch.
    stages: Vec<(Vec<f64>, f64)>,
}

/// Orders that are compared.
const ORDERS: [usize; 7] = [0, 1, 2, 4, 8, 12, 16];

impl NoiseModel {
    /// White noise.
    pub fn white(sigma: f64) -> Self {
        Self { ar: Vec::new(), sigma, stages: vec![(Vec::new(), sigma)] }
    }

    /// The model of residuals in several stretches (a missing sample splits one), its order by BIC up to `most`.
    pub fn fit(stretches: &[&[f64]], most: usize) -> Self {
        let parts: Vec<&[f64]> =
            stretches.iter().flat_map(|s| s.split(|e| !e.is_finite())).filter(|p| !p.is_empty()).collect();
        let n: usize = parts.iter().map(|p| p.len()).sum();
        let power = parts.iter().flat_map(|p| p.iter()).map(|e| e * e).sum::<f64>() / (n.max(1) as f64);
        let top = ORDERS.iter().copied().filter(|o| *o <= most && o * 8 <= n).max().unwrap_or(0);
        let mut forward: Vec<Vec<f64>> = parts.iter().map(|p| p.to_vec()).collect();
        let mut backward = forward.clone();
        let mut a: Vec<f64> = Vec::new();
        let mut variance = power;
        let mut stages = vec![(a.clone(), variance.sqrt())];
        for order in 1..=top {
            let (mut cross, mut total) = (0.0, 0.0);
            for (f, b) in forward.iter().zip(&backward) {
                for i in order..f.len() {
                    cross += f[i] * b[i - 1];
                    total += f[i] * f[i] + b[i - 1] * b[i - 1];
                }
            }
            if total <= 0.0 {
                break;
            }
            let k = -2.0 * cross / total;
            let reversed: Vec<f64> = a.iter().rev().copied().collect();
            a.iter_mut().zip(&reversed).for_each(|(a, r)| *a += k * r);
            a.push(k);
            for (f, b) in forward.iter_mut().zip(&mut backward) {
                for i in (order..f.len()).rev() {
                    let (fi, bi) = (f[i], b[i - 1]);
                    f[i] = fi + k * bi;
                    b[i] = bi + k * fi;
                }
            }
            variance *= 1.0 - k * k;
            stages.push((a.clone(), variance.max(0.0).sqrt()));
        }
        let bic = |order: usize| match stages.get(order) {
            Some((_, sigma)) if *sigma > 0.0 => 2.0 * n as f64 * sigma.ln() + order as f64 * (n.max(1) as f64).ln(),
            Some(_) => f64::NEG_INFINITY,
            None => f64::INFINITY,
        };
        let order = ORDERS.iter().copied().filter(|o| *o < stages.len()).min_by(|a, b| bic(*a).total_cmp(&bic(*b)));
        stages.truncate(order.unwrap_or(0) + 1);
        let (ar, sigma) = stages.last().cloned().unwrap_or((Vec::new(), power.sqrt()));
        Self { ar, sigma, stages }
    }

    /// Filters a series to unit innovations, in place; missing samples become 0.
    ///
    /// `present` says which samples count (the same for a residual and for every column that belongs to it).
    pub fn whiten(&self, series: &mut [f64], present: &[bool]) {
        let source = series.to_vec();
        let mut run = 0;
        for n in 0..series.len() {
            if !present.get(n).copied().unwrap_or(false) {
                series[n] = 0.0;
                run = 0;
                continue;
            }
            let Some((a, sigma)) = self.stages.get(run.min(self.stages.len() - 1)) else { continue };
            let mut e = source[n];
            for (k, a) in a.iter().enumerate() {
                e += a * source[n - 1 - k];
            }
            series[n] = if *sigma > 0.0 { e / sigma } else { e };
            run += 1;
        }
    }

    /// The spectral density at `w` radians per sample, relative to white noise of the same innovations.
    pub fn density(&self, w: f64) -> f64 {
        let (mut re, mut im) = (1.0, 0.0);
        for (k, a) in self.ar.iter().enumerate() {
            let phase = -w * (k + 1) as f64;
            re += a * phase.cos();
            im += a * phase.sin();
        }
        1.0 / (re * re + im * im).max(f64::MIN_POSITIVE)
    }
}
