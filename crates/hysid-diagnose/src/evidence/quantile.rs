//! Quantiles of a sample.

/// The value below which a share of the sorted values lies.
pub fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let at = share.clamp(0.0, 1.0) * last as f64;
    let (below, part) = (at.floor() as usize, at.fract());
    let low = *sorted.get(below)?;
    let high = *sorted.get(below + 1).unwrap_or(&low);
    Some(low + part * (high - low))
}

#[cfg(test)]
mod tests {
    use super::quantile;

    #[test]
    fn quantiles_lie_between_the_values_beside_them() {
        let x = [1.0, 2.0, 4.0, 8.0];
        let at = [0.0, 0.5, 1.0, 1.0 / 6.0, 7.0].map(|q| quantile(&x, q).unwrap());
        assert_eq!(at, [1.0, 3.0, 8.0, 1.5, 8.0]);
        assert_eq!(quantile(&[], 0.5), None);
    }
}
