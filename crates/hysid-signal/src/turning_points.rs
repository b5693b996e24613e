//! Turning points: where a signal reverses, with a threshold below which a retreat is taken for noise.

/// Which way a signal turned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Turn {
    /// It rose and then fell.
    Maximum,
    /// It fell and then rose.
    Minimum,
}

/// One reversal of a signal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TurningPoint {
    /// The sample number; on a plateau the first sample of it.
    pub index: usize,
    /// The signal's value there.
    pub value: f64,
    /// Which way it turned.
    pub turn: Turn,
}

/// The reversals of `u` in order of time: maxima and minima alternate, and each differs from the next by more than `threshold`.
///
/// An extreme counts once the signal has retreated from it by more than `threshold` (unit of `u`; 0 takes every reversal, and
/// with white noise of standard deviation s a threshold of 6 s lets hardly a false one through). The first and the last sample
/// are no turning points. Samples that are not finite are passed over.
pub fn turning_points(u: &[f64], threshold: f64) -> Vec<TurningPoint> {
    let threshold = threshold.max(0.0);
    let mut points = Vec::new();
    let mut samples = u.iter().copied().enumerate().filter(|(_, u)| u.is_finite());
    let Some(first) = samples.next() else { return points };
    // Until the signal has moved by more than the threshold, both extremes are open.
    let (mut highest, mut lowest) = (first, first);
    let mut direction = None;
    for (index, value) in samples {
        if value > highest.1 {
            highest = (index, value);
        }
        if value < lowest.1 {
            lowest = (index, value);
        }
        let (fell, rose) = (highest.1 - value > threshold, value - lowest.1 > threshold);
        match direction {
            Some(Turn::Maximum) | None if fell => {
                // Before the first confirmed direction, an extreme at the first sample is no reversal.
                if direction.is_some() || highest.0 > first.0 {
                    points.push(TurningPoint { index: highest.0, value: highest.1, turn: Turn::Maximum });
                }
                direction = Some(Turn::Minimum);
                lowest = (index, value);
            }
            Some(Turn::Minimum) | None if rose => {
                if direction.is_some() || lowest.0 > first.0 {
                    points.push(TurningPoint { index: lowest.0, value: lowest.1, turn: Turn::Minimum });
                }
                direction = Some(Turn::Maximum);
                highest = (index, value);
            }
            _ => {}
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn reversals_are_found_as_a_table_says() {
        use Turn::{Maximum, Minimum};
        let nan = f64::NAN;
        type Case<'a> = (&'a [f64], f64, &'a [(usize, Turn)]);
        let cases: [Case; 8] = [
            (&[0.0, 1.0, 0.0, 1.0], 0.0, &[(1, Maximum), (2, Minimum)]),
            (&[0.0, 1.0, 1.0, 0.0], 0.0, &[(1, Maximum)]),
            (&[0.0, 1.0, 2.0], 0.0, &[]),
            (&[2.0, 1.0, 0.0, 0.5], 0.0, &[(2, Minimum)]),
            (&[0.0, 1.0, 0.9, 2.0, 0.0], 0.2, &[(3, Maximum)]),
            (&[0.0, 0.05, 0.0, 1.0, 0.0], 0.2, &[(3, Maximum)]),
            (&[0.0, nan, 1.0, nan, 0.0], 0.0, &[(2, Maximum)]),
            (&[], 0.0, &[]),
        ];
        for (u, threshold, expected) in cases {
            let found: Vec<_> = turning_points(u, threshold).iter().map(|p| (p.index, p.turn)).collect();
            assert_eq!(found, expected, "in {u:?} with threshold {threshold}");
        }
    }

    proptest! {
        #[test]
        fn they_alternate_and_differ_by_more_than_the_threshold(
            u in prop::collection::vec(-1.0f64..1.0, 0..200), threshold in 0.0f64..1.0
        ) {
            let points = turning_points(&u, threshold);
            for pair in points.windows(2) {
                prop_assert!(pair[0].turn != pair[1].turn);
                prop_assert!(pair[0].index < pair[1].index);
                prop_assert!((pair[0].value - pair[1].value).abs() > threshold);
            }
        }

        #[test]
        fn without_a_threshold_they_are_the_local_extremes(u in prop::collection::vec(-1.0f64..1.0, 3..200)) {
            let brute: Vec<usize> =
                (1..u.len() - 1).filter(|&n| (u[n] - u[n - 1]) * (u[n + 1] - u[n]) < 0.0).collect();
            let found: Vec<usize> = turning_points(&u, 0.0).iter().map(|p| p.index).collect();
            prop_assert_eq!(found, brute);
        }
    }
}
