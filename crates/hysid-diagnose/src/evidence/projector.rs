//! The projector onto the complement of what the simulation's own parameters and initial states can do.

use hysid_linalg::{Stored, axpy, dot};

/// Squared Euclidean norm.
pub fn norm2(a: &[f64]) -> f64 {
    dot(a, a)
}

/// Takes the part along orthonormal columns out of `x`.
pub fn remove_along<A: Stored>(columns: &[Vec<A>], x: &mut [f64]) {
    for q in columns {
        axpy(-dot(q, x), q, x);
    }
}

/// A column in double precision again.
pub fn doubly(column: &[f32]) -> Vec<f64> {
    column.iter().map(|&x| x.into()).collect()
}

/// An orthonormal basis and the projection off it.
#[derive(Debug, Clone, Default)]
pub struct Projector {
    basis: Vec<Vec<f64>>,
}

/// Times that a column is projected, so that rounding cannot leave a visible part of it inside the span.
const PASSES: usize = 2;

/// Columns that are projected together: each direction of a basis, of which there may be hundreds, is read once for all of them.
const TOGETHER: usize = 8;

/// A column whose part outside the basis is smaller than this share of its norm is taken as inside.
const RANK_TOLERANCE: f64 = 1e-7;

impl Projector {
    /// The projector off the span of these columns; columns that are (nearly) linear combinations of earlier ones add nothing.
    pub fn new(columns: impl IntoIterator<Item = Vec<f64>>) -> Self {
        let mut p = Self::default();
        let mut columns = columns.into_iter();
        loop {
            let mut block: Vec<Vec<f64>> = columns.by_ref().take(TOGETHER).collect();
            if block.is_empty() {
                return p;
            }
            let first = p.rank();
            let before: Vec<f64> = block.iter().map(|c| norm2(c)).collect();
            for _ in 0..PASSES {
                for q in &p.basis {
                    block.iter_mut().for_each(|c| remove_along(std::slice::from_ref(q), c));
                }
            }
            for (column, before) in block.into_iter().zip(before) {
                p.push_beyond(first, column, before);
            }
        }
    }

    /// Adds a column to the span; whether it added a dimension.
    pub fn push(&mut self, column: Vec<f64>) -> bool {
        let before = norm2(&column);
        self.push_beyond(0, column, before)
    }

    /// The same of a column that was this large (squared) and has nothing along the basis before `first` any more.
    fn push_beyond(&mut self, first: usize, mut column: Vec<f64>, before: f64) -> bool {
        if !(before.is_finite() && before > 0.0) {
            return false;
        }
        self.remove_from(first, &mut column);
        let after = norm2(&column);
        if after <= before * RANK_TOLERANCE * RANK_TOLERANCE {
            return false;
        }
        let scale = 1.0 / after.sqrt();
        column.iter_mut().for_each(|x| *x *= scale);
        self.basis.push(column);
        true
    }

    /// Dimension of the span.
    pub fn rank(&self) -> usize {
        self.basis.len()
    }

    /// The orthonormal basis.
    pub fn basis(&self) -> &[Vec<f64>] {
        &self.basis
    }

    /// The orthonormal basis in single precision.
    pub fn singly(self) -> Vec<Vec<f32>> {
        self.basis.into_iter().map(|q| q.into_iter().map(|x| x as f32).collect()).collect()
    }

    /// Projects in place.
    pub fn remove(&self, x: &mut [f64]) {
        self.remove_from(0, x);
    }

    /// The same off what the basis holds from `first` on.
    fn remove_from(&self, first: usize, x: &mut [f64]) {
        for _ in 0..PASSES {
            remove_along(&self.basis[first..], x);
        }
    }

    /// Sum of squares of the part of `x` inside the span.
    pub fn inside(&self, x: &[f64]) -> f64 {
        self.basis.iter().map(|q| dot(q, x).powi(2)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_left_is_orthogonal_and_projecting_twice_changes_nothing(
            columns in prop::collection::vec(prop::collection::vec(-10.0f64..10.0, 30), 1..6),
            x in prop::collection::vec(-10.0f64..10.0, 30),
        ) {
            let p = Projector::new(columns.clone());
            let mut r = x.clone();
            p.remove(&mut r);
            for c in &columns {
                prop_assert!(dot(c, &r).abs() < 1e-8);
            }
            prop_assert!((norm2(&x) - norm2(&r) - p.inside(&x)).abs() < 1e-8 * (1.0 + norm2(&x)));
            let once = r.clone();
            p.remove(&mut r);
            prop_assert!(once.iter().zip(&r).all(|(a, b)| (a - b).abs() < 1e-10));
        }
    }

    /// More columns than are projected together, some of them combinations of earlier ones.
    #[test]
    fn many_columns_span_what_they_span_one_after_the_other() {
        let wave = |k: usize| -> Vec<f64> { (0..90).map(|n| (0.13 * (k * n) as f64 + k as f64).sin()).collect() };
        let mut columns: Vec<Vec<f64>> = (1..=19).map(wave).collect();
        for (at, a, b) in [(9, 0, 1), (13, 2, 11), (20, 4, 18)] {
            columns.insert(at, columns[a].iter().zip(&columns[b]).map(|(a, b)| a - 2.0 * b).collect());
        }
        let together = Projector::new(columns.clone());
        let mut by_turns = Projector::default();
        let added = columns.into_iter().filter(|c| by_turns.push(c.clone())).count();
        assert!(added == 19 && together.rank() == 19, "{added} {}", together.rank());
        let x: Vec<f64> = (0..90).map(|n| ((n * n) as f64).sin()).collect();
        assert!((together.inside(&x) - by_turns.inside(&x)).abs() < 1e-10 * norm2(&x));
    }

    #[test]
    fn a_dependent_column_adds_no_dimension() {
        let p = Projector::new([vec![1.0, 0.0, 1.0], vec![0.0, 1.0, 0.0], vec![2.0, 3.0, 2.0]]);
        assert_eq!(p.rank(), 2);
    }
}
