//! The middle of some values.

/// The middle one of the values in their order, in their unit; the upper one of two, `NaN` of none.
pub fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { f64::NAN } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

#[cfg(test)]
mod tests {
    use super::median;

    #[test]
    fn as_many_lie_below_as_above() {
        assert_eq!(median(vec![5.0, -1.0, 3.0]), 3.0);
        assert_eq!(median(vec![4.0, 1.0]), 4.0);
        assert!(median(Vec::new()).is_nan());
    }
}
