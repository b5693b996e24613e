//! The ends of a range of values.

/// The lowest and the highest value, in the unit of the values; `(inf, -inf)` of none. `NaN` counts as none.
pub fn range(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    values.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

#[cfg(test)]
mod tests {
    use super::range;

    #[test]
    fn gaps_are_no_ends() {
        assert_eq!(range([2.0, f64::NAN, -1.0, 0.5]), (-1.0, 2.0));
        assert_eq!(range([f64::NAN]), (f64::INFINITY, f64::NEG_INFINITY));
    }
}
