//! The few statistics that the score needs.

/// Wilson's 95 % interval of a proportion; `(0, 1)` without trials.
pub fn wilson(hits: usize, trials: usize) -> (f64, f64) {
    if trials == 0 {
        return (0.0, 1.0);
    }
    let (n, p, z) = (trials as f64, hits as f64 / trials as f64, 1.959_963_985);
    let centre = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    ((centre - half).max(0.0), (centre + half).min(1.0))
}

/// Quantile by linear interpolation between order statistics; `NaN` of nothing.
pub fn quantile(values: &[f64], q: f64) -> f64 {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan()).collect();
    if sorted.is_empty() {
        return f64::NAN;
    }
    sorted.sort_by(f64::total_cmp);
    let at = q * (sorted.len() - 1) as f64;
    let low = at.floor() as usize;
    let high = (low + 1).min(sorted.len() - 1);
    let share = at - low as f64;
    if share == 0.0 { sorted[low] } else { sorted[low] * (1.0 - share) + sorted[high] * share }
}

/// Distribution-free 95 % interval of a quantile by order statistics (normal approximation of the binomial ranks).
pub fn quantile_interval(values: &[f64], q: f64) -> (f64, f64) {
    let n = values.len() as f64;
    let half = 1.96 * (q * (1.0 - q) / n.max(1.0)).sqrt();
    (quantile(values, (q - half).max(0.0)), quantile(values, (q + half).min(1.0)))
}

/// One bin of a reliability diagram: mean stated probability, share right, count.
pub type Bin = (f64, f64, usize);

/// The one of ten equal bins in which a probability lies.
fn bin_of(p: f64) -> usize {
    ((p * 10.0) as usize).min(9)
}

/// Expected calibration error over ten equal bins, and the bins that hold anything.
pub fn calibration(stated: &[(f64, bool)]) -> (f64, Vec<Bin>) {
    let mut bins = vec![(0.0, 0usize, 0usize); 10];
    for &(p, right) in stated {
        let bin = &mut bins[bin_of(p)];
        bin.0 += p;
        bin.1 += usize::from(right);
        bin.2 += 1;
    }
    let list: Vec<Bin> =
        bins.iter().filter(|b| b.2 > 0).map(|b| (b.0 / b.2 as f64, b.1 as f64 / b.2 as f64, b.2)).collect();
    let total = stated.len().max(1) as f64;
    (list.iter().map(|b| (b.0 - b.1).abs() * b.2 as f64 / total).sum(), list)
}

/// The calibration error to be expected of statements that are right as often as they say: so few of them differ by chance.
pub fn calibration_by_chance(stated: &[(f64, bool)]) -> f64 {
    let mut error = 0.0;
    for bin in 0..10 {
        let inside = stated.iter().map(|s| s.0).filter(|p| bin_of(*p) == bin);
        // The distribution of the number that are right, one statement after the other.
        let (mut right, mut sum) = (vec![1.0], 0.0);
        for p in inside {
            sum += p;
            right.push(0.0);
            for k in (0..right.len()).rev() {
                right[k] = right[k] * (1.0 - p) + if k > 0 { right[k - 1] * p } else { 0.0 };
            }
        }
        error += right.iter().enumerate().map(|(k, q)| q * (k as f64 - sum).abs()).sum::<f64>();
    }
    error / stated.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_matches_published_values() {
        // Newcombe 1998, table I: 81/263, 15/148, 0/20, 1/29.
        for (hits, n, low, high) in
            [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)]
        {
            let (l, h) = wilson(hits, n);
            assert!((l - low).abs() < 1e-4 && (h - high).abs() < 1e-4, "{hits}/{n}: {l} {h}");
        }
    }

    #[test]
    fn quantiles_and_calibration() {
        assert_eq!(quantile(&[3.0, 1.0, 2.0], 0.5), 2.0);
        assert_eq!(quantile(&[0.0, 10.0], 0.9), 9.0);
        assert_eq!(quantile(&[1.0, f64::INFINITY], 0.0), 1.0);
        let (ece, bins) = calibration(&[(0.95, true), (0.95, false), (0.05, false)]);
        assert!((ece - (0.45 * 2.0 + 0.05) / 3.0).abs() < 1e-12 && bins.len() == 2);
    }

    #[test]
    fn by_chance_few_statements_are_off_and_many_are_not() {
        // One coin is off by a half; of two one of them half of the time by one, else not at all.
        assert_eq!(calibration_by_chance(&[(0.5, true)]), 0.5);
        assert_eq!(calibration_by_chance(&[(0.5, true), (0.5, false)]), 0.25);
        // Mean absolute deviation of a binomial law for many: sqrt(2 p (1 - p) / (pi n)).
        let many: Vec<(f64, bool)> = (0..2000).map(|i| ([0.25, 0.75][i % 2], true)).collect();
        let expected = (2.0 * 0.25 * 0.75 / (std::f64::consts::PI * 1000.0)).sqrt();
        assert!((calibration_by_chance(&many) - expected).abs() < 1e-3 * expected);
        assert_eq!(calibration_by_chance(&[(1.0, true), (0.0, false)]), 0.0);
        assert_eq!(calibration_by_chance(&[]), 0.0);
    }
}
