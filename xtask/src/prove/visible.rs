//! How much an observer could see of an effect at most.
//!
//! `N DNR^2` counts every sample by the power of the noise, so that a residual counts the same under white noise and under noise that
//! has most of its power where the residual has it. Whitened by the noise that is really on the recording (the generator knows it, the program does
//! not), half of the residual's sum of squares is the log likelihood ratio in nats that the exact law with its true parameters has over the
//! best baseline (Neyman and Pearson 1933): no method can have more, and one that searches has to pay for the search.

use hysid_concealed::case::Case;
use hysid_concealed::strength::residual;
use hysid_signal::Autoregression;

/// Highest order of the noise's autoregression.
const ORDER: usize = 16;
/// Rounds of the baseline's refit.
const ROUNDS: usize = 15;

/// The log likelihood ratio of the truth over the best baseline, in nats; `NaN` where the baseline cannot be run.
pub fn visible(case: &Case) -> f64 {
    let (record, sigma) = (&case.est, &case.label.sigma);
    let Some(left) = residual(&case.design, &case.machine.effects, &record.input, &record.clean, sigma, ROUNDS) else {
        return f64::NAN;
    };
    let channels = left.residual.iter().zip(record.y.iter().zip(&record.clean)).zip(sigma);
    channels.map(|((left, (y, clean)), sigma)| nats(left, &noise(y, clean, *sigma))).sum()
}

/// What a channel recorded beside its output, in standard deviations.
fn noise(y: &[f64], clean: &[f64], sigma: f64) -> Vec<f64> {
    y.iter().zip(clean).map(|(y, clean)| (y - clean) / sigma).collect()
}

/// Half of the sum of squares of a residual, whitened by this noise.
fn nats(residual: &[f64], noise: &[f64]) -> f64 {
    let mut white = vec![0.0; residual.len()];
    Autoregression::fit(&[noise], ORDER).whiten(residual, &mut white);
    0.5 * white.iter().map(|w| w * w).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use hysid_signal::{autoregressive_noise, white_noise};

    use super::*;

    #[test]
    fn under_white_noise_it_is_half_of_n_dnr_squared() {
        let residual: Vec<f64> = (0..4000).map(|n| 0.2 * (0.05 * n as f64).sin()).collect();
        let noise = white_noise(4000, 1.0, 3).unwrap();
        let expected = 0.5 * 4000.0 * 0.02;
        assert!((nats(&residual, &noise) / expected - 1.0).abs() < 0.05);
    }

    #[test]
    fn a_slow_residual_is_hidden_by_slow_noise_and_a_fast_one_is_not() {
        // An AR(1) with pole a has the power (1 - a^2)/(1 - 2 a cos w + a^2) at w, over that of white noise of the same variance.
        let (a, n) = (0.9, 8000);
        let noise = autoregressive_noise(&[a], n, 1.0, 5).unwrap();
        for w in [0.01f64, 0.3, 2.5] {
            let residual: Vec<f64> = (0..n).map(|n| 0.2 * (w * n as f64).sin()).collect();
            let power = (1.0 - a * a) / (1.0 - 2.0 * a * w.cos() + a * a);
            let expected = 0.5 * n as f64 * 0.02 / power;
            assert!((nats(&residual, &noise) / expected - 1.0).abs() < 0.15, "{w}");
        }
    }
}
