//! How far a prediction is from the measurement.

/// What an error is divided by. There is no silent choice: every normalised figure names one of these.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Normaliser {
    /// Root mean square of the measurement, its mean included.
    Rms,
    /// Standard deviation of the measurement (divisor N); the error of predicting the mean is then 1.
    Std,
    /// Largest minus smallest value of the measurement.
    Range,
}

impl Normaliser {
    /// What to call a root-mean-square error divided by this.
    pub fn label(self) -> &'static str {
        match self {
            Self::Rms => "RMSE / rms(y)",
            Self::Std => "RMSE / std(y)",
            Self::Range => "RMSE / range(y)",
        }
    }
}

/// Errors of a prediction over the samples that both the measurement and the prediction have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    /// Samples compared.
    pub samples: usize,
    /// Samples left out because one of the two is missing there.
    pub left_out: usize,
    /// Mean square error, in the square of the unit of `y`.
    pub mse: f64,
    /// Root mean square error, in the unit of `y`; infinite for a prediction that left the finite numbers.
    pub rmse: f64,
    /// Mean of y - prediction, in the unit of `y`.
    pub bias: f64,
    /// Mean absolute error, in the unit of `y`.
    pub mean_abs: f64,
    /// Largest absolute error, in the unit of `y`.
    pub largest: f64,
    /// Mean of |e / y| over the samples where y is not 0 (the average relative error of Zhang, Zhu and Gu), without unit.
    pub mean_relative: f64,
    /// Samples where y is 0, which `mean_relative` leaves out.
    pub zeros: usize,
    rms_y: f64,
    std_y: f64,
    range_y: f64,
}

impl Errors {
    /// Root mean square error divided by the normaliser; `NaN` where the normaliser is 0 (a constant measurement) or nothing was compared.
    pub fn nrmse(&self, by: Normaliser) -> f64 {
        let scale = match by {
            Normaliser::Rms => self.rms_y,
            Normaliser::Std => self.std_y,
            Normaliser::Range => self.range_y,
        };
        if scale > 0.0 { self.rmse / scale } else { f64::NAN }
    }

    /// Fit in percent: 100 (1 - RMSE / std(y)). 100 is perfect, 0 as good as the mean, below 0 worse than that.
    pub fn fit_percent(&self) -> f64 {
        100.0 * (1.0 - self.nrmse(Normaliser::Std))
    }
}

/// Compares a prediction with the measurement, sample by sample, up to the end of the shorter one.
///
/// All figures are `NaN` where there is no sample to compare.
pub fn measure(y: &[f64], prediction: &[f64]) -> Errors {
    measure_at(y, prediction, 0..y.len().min(prediction.len()))
}

/// As [`measure`], over the samples `which` only.
pub(crate) fn measure_at(y: &[f64], prediction: &[f64], which: impl Iterator<Item = usize> + Clone) -> Errors {
    let all = which.clone().count();
    let pairs = which.filter_map(|n| {
        let (y, p) = (*y.get(n)?, *prediction.get(n)?);
        (y.is_finite() && !p.is_nan()).then_some((y, p))
    });
    let samples = pairs.clone().count();
    let count = samples as f64;
    let mean = |f: &dyn Fn(f64, f64) -> f64| pairs.clone().map(|(y, p)| f(y, p)).sum::<f64>() / count;
    let largest = |f: &dyn Fn(f64, f64) -> f64| pairs.clone().map(|(y, p)| f(y, p)).fold(f64::NAN, f64::max);
    let mse = mean(&|y, p| (y - p).powi(2));
    let mean_y = mean(&|y, _| y);
    let zeros = pairs.clone().filter(|(y, _)| *y == 0.0).count();
    let relative = pairs.clone().filter(|(y, _)| *y != 0.0).map(|(y, p)| ((y - p) / y).abs()).sum::<f64>();
    Errors {
        samples,
        left_out: all - samples,
        mse,
        rmse: mse.sqrt(),
        bias: mean(&|y, p| y - p),
        mean_abs: mean(&|y, p| (y - p).abs()),
        largest: largest(&|y, p| (y - p).abs()),
        mean_relative: relative / (samples - zeros) as f64,
        zeros,
        rms_y: mean(&|y, _| y * y).sqrt(),
        std_y: mean(&|y, _| (y - mean_y).powi(2)).sqrt(),
        range_y: largest(&|y, _| y) + largest(&|y, _| -y),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn closed_forms() {
        // y = 0, 2, 4 and a prediction that is 1 too low: every figure by hand.
        let e = measure(&[0.0, 2.0, 4.0], &[-1.0, 1.0, 3.0]);
        assert_eq!((e.samples, e.left_out, e.zeros), (3, 0, 1));
        assert_eq!((e.mse, e.rmse, e.bias, e.mean_abs, e.largest), (1.0, 1.0, 1.0, 1.0, 1.0));
        assert_relative_eq!(e.mean_relative, (0.5 + 0.25) / 2.0);
        assert_relative_eq!(e.nrmse(Normaliser::Rms), 1.0 / (20.0_f64 / 3.0).sqrt());
        assert_relative_eq!(e.nrmse(Normaliser::Std), 1.0 / (8.0_f64 / 3.0).sqrt());
        assert_relative_eq!(e.nrmse(Normaliser::Range), 0.25);
        assert_relative_eq!(e.fit_percent(), 100.0 * (1.0 - (3.0_f64 / 8.0).sqrt()));
    }

    #[test]
    fn the_mean_as_prediction_has_fit_zero() {
        let y: Vec<f64> = (0..50).map(|n| (n as f64).sin() + 3.0).collect();
        let mean = y.iter().sum::<f64>() / 50.0;
        assert!(measure(&y, &vec![mean; 50]).fit_percent().abs() < 1e-9);
    }

    #[test]
    fn missing_samples_are_left_out_and_divergence_is_not() {
        let nan = f64::NAN;
        let e = measure(&[1.0, nan, 3.0, 4.0], &[nan, 2.0, 3.0, 5.0]);
        assert_eq!((e.samples, e.left_out), (2, 2));
        assert_eq!(e.mse, 0.5);
        assert_eq!(measure(&[1.0, 2.0], &[1.0, f64::INFINITY]).rmse, f64::INFINITY);
        assert!(measure(&[], &[]).rmse.is_nan());
        assert!(measure(&[2.0, 2.0], &[1.0, 2.0]).nrmse(Normaliser::Std).is_nan());
    }
}
