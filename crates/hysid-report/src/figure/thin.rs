//! Thinning of long series for drawing: each bucket keeps its smallest and largest value, so no peak is lost.

/// The points of a line through `(x, y)` with at most about `2 * buckets` points.
///
/// Points that are not finite are passed over. A series that is short enough comes back whole, in its order; of a longer
/// one, each of `buckets` equal stretches gives the points of its minimum and its maximum, in order of their position.
pub fn envelope(x: &[f64], y: &[f64], buckets: usize) -> Vec<(f64, f64)> {
    let n = x.len().min(y.len());
    let finite = |i: &usize| x[*i].is_finite() && y[*i].is_finite();
    if n <= 2 * buckets || buckets == 0 {
        return (0..n).filter(finite).map(|i| (x[i], y[i])).collect();
    }
    let mut points = Vec::with_capacity(2 * buckets);
    for b in 0..buckets {
        let range = b * n / buckets..(b + 1) * n / buckets;
        let low = range.clone().filter(finite).min_by(|&i, &j| y[i].total_cmp(&y[j]));
        let high = range.filter(finite).max_by(|&i, &j| y[i].total_cmp(&y[j]));
        if let (Some(low), Some(high)) = (low, high) {
            points.push((x[low.min(high)], y[low.min(high)]));
            if low != high {
                points.push((x[low.max(high)], y[low.max(high)]));
            }
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_extremes_survive(y in proptest::collection::vec(-1e6f64..1e6, 1..3000), buckets in 1usize..200) {
            let x: Vec<f64> = (0..y.len()).map(|i| i as f64).collect();
            let thin = envelope(&x, &y, buckets);
            prop_assert!(thin.len() <= y.len().min((2 * buckets).max(1)));
            let extremes = |v: &mut dyn Iterator<Item = f64>| v.fold((f64::MAX, f64::MIN), |(a, b), p| (a.min(p), b.max(p)));
            prop_assert_eq!(extremes(&mut thin.iter().map(|p| p.1)), extremes(&mut y.iter().copied()));
            prop_assert!(thin.windows(2).all(|w| w[0].0 < w[1].0));
        }
    }

    #[test]
    fn what_is_not_finite_is_passed_over() {
        assert_eq!(envelope(&[0.0, 1.0, 2.0], &[1.0, f64::NAN, 3.0], 10), vec![(0.0, 1.0), (2.0, 3.0)]);
    }
}
