//! Whether errors on blocks that were held out of a fit fell by chance.

/// Mean and standard error of `a - b` over stretches of 20 rows (neighbouring errors are no independent witnesses); `None` for
/// fewer than five stretches.
pub fn difference(a: &[f64], b: &[f64]) -> Option<(f64, f64)> {
    let differences: Vec<f64> =
        a.chunks(20).zip(b.chunks(20)).map(|(a, b)| a.iter().sum::<f64>() - b.iter().sum::<f64>()).collect();
    let count = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / count.max(1.0);
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    (count > 4.0).then_some((mean, (variance / count).sqrt()))
}

/// Probability that squared errors on blocks fall by so much by chance, one-sided; `None` where the blocks are too few.
pub fn better_by_chance(before: &[f64], after: &[f64]) -> Option<f64> {
    let (mean, error) = difference(before, after)?;
    let t = mean / error.max(f64::MIN_POSITIVE);
    let count = before.chunks(20).count() as f64;
    let law = statrs::distribution::StudentsT::new(0.0, 1.0, count - 1.0).ok()?;
    Some(1.0 - statrs::distribution::ContinuousCDF::cdf(&law, t))
}
