//! The inner products that a search works on: columns of the Gram matrix, made when first asked for and kept.
//!
//! Columns and target have unit length here, so the Gram matrix is that of cosines and energies are parts of y'y.

use std::collections::HashMap;

use crate::SelectError;
use crate::evidence::Evidence;

/// How many columns of the Gram matrix one pass over the samples makes at most: on short data a pass costs more than its
/// columns, on long data a column that is not needed costs more than a pass.
const PER_PASS: (usize, usize) = (8, 2);
/// Samples times candidates from which data are long.
const LONG: usize = 1_000_000;

/// The inner products of unit columns with each other and with the unit target.
pub(crate) struct Moments<'a, E: ?Sized> {
    pub evidence: &'a E,
    /// 1 / norm of each column; 0 for a column of zeros.
    scale: Vec<f64>,
    /// Inner product of each unit column with the unit target.
    pub cross: Vec<f64>,
    /// y'y.
    pub target_energy: f64,
    gram: HashMap<usize, Vec<f64>>,
}

impl<'a, E: Evidence + ?Sized> Moments<'a, E> {
    pub fn new(evidence: &'a E) -> Result<Self, SelectError> {
        let start = evidence.start();
        if let Some(j) = start.norms.iter().zip(&start.cross).position(|(n, c)| !n.is_finite() || !c.is_finite()) {
            return Err(SelectError::NotFinite(format!("column {j}")));
        }
        let scale: Vec<f64> = start.norms.iter().map(|n| if *n > 0.0 { 1.0 / n.sqrt() } else { 0.0 }).collect();
        let target = start.target.sqrt();
        let cross = start.cross.iter().zip(&scale).map(|(c, s)| c * s / target).collect();
        Ok(Self { evidence, scale, cross, target_energy: start.target, gram: HashMap::new() })
    }

    pub fn len(&self) -> usize {
        self.scale.len()
    }

    pub fn is_zero(&self, j: usize) -> bool {
        self.scale[j] == 0.0
    }

    pub fn has(&self, j: usize) -> bool {
        self.gram.contains_key(&j)
    }

    /// Makes column `j`, and in the same pass those of `likely` that fit and are not there yet.
    pub fn make(&mut self, j: usize, likely: impl IntoIterator<Item = usize>) {
        if self.has(j) {
            return;
        }
        let mut which = vec![j];
        let long = self.evidence.samples().saturating_mul(self.evidence.candidates()) >= LONG;
        let most = if long { PER_PASS.1 } else { PER_PASS.0 };
        which.extend(likely.into_iter().filter(|k| *k != j && !self.has(*k)).take(most - 1));
        let columns = self.evidence.gram_columns(&which);
        for (c, &k) in which.iter().enumerate() {
            let column = columns.col(c).iter().zip(&self.scale).map(|(g, s)| g * s * self.scale[k]).collect();
            self.gram.insert(k, column);
        }
    }

    /// Makes of column `j` only what it shares with `chosen`, whose columns are there; elsewhere it is 0. No pass over the samples.
    pub fn make_among(&mut self, j: usize, chosen: &[usize]) {
        if self.has(j) {
            return;
        }
        let mut column = vec![0.0; self.len()];
        column[j] = if self.is_zero(j) { 0.0 } else { 1.0 };
        for &k in chosen {
            column[k] = self.column(k).get(j).copied().unwrap_or(0.0);
        }
        self.gram.insert(j, column);
    }

    /// Column `j` of the matrix of cosines; empty when it was not made.
    pub fn column(&self, j: usize) -> &[f64] {
        self.gram.get(&j).map_or(&[], Vec::as_slice)
    }
}
