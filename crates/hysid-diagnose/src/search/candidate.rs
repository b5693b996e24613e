//! What could be missing: a mechanism at a slot, with the points of its shape grid and what each explains.

use crate::evidence::FeatureGroup;
use crate::mechanism::{Mechanism, Rewritten};
use crate::model::hypothesis::Key;
use crate::slot::Slot;

/// One joint point of a candidate's shape grids.
#[derive(Debug, Clone)]
pub struct Point {
    /// The shapes.
    pub shapes: Vec<(String, f64)>,
    /// Its columns in the evidence space; kept for a spread of points, chosen without looking at the residual.
    pub group: Option<FeatureGroup>,
    /// Its columns, kept for the best points: pairs of candidates are judged by these and by those of `group`.
    pub joint: Option<FeatureGroup>,
    /// Share of its response that the simulation's own parameters absorb.
    pub concealment: f64,
    /// Norm of its first amplitude's response outside the tangent space.
    pub norm: f64,
    /// The amplitudes that explain the residual best, by name.
    pub amplitudes: Vec<(String, f64)>,
    /// Its score.
    pub score: f64,
}

/// A mechanism at a slot.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// The mechanism.
    pub mechanism: &'static Mechanism,
    /// The slot.
    pub slot: Slot,
    /// The simulation with it, in physical parameters.
    pub refit: Rewritten,
    /// The points of its shape grid, best score first.
    pub points: Vec<Point>,
    /// What the recording lacks for it to be seen.
    pub lacking: Option<String>,
}

impl Candidate {
    /// The statement that it makes alone.
    pub fn key(&self) -> Key {
        vec![(self.mechanism.id, self.slot.identity())]
    }

    /// Whether the recording shows by itself that something of this kind is there.
    pub fn is_shown(&self) -> bool {
        self.lacking.is_none() && self.mechanism.needs.iter().any(|n| n.is_telling())
    }

    /// Its largest score.
    pub fn score(&self) -> f64 {
        self.points.first().map_or(f64::NEG_INFINITY, |p| p.score)
    }

    /// Forgets the columns of its points, which take most of the memory.
    pub fn drop_columns(&mut self) {
        for point in &mut self.points {
            (point.group, point.joint) = (None, None);
        }
    }

    /// Share of its response that the simulation's own parameters absorb, at its best point.
    pub fn concealment(&self) -> Option<f64> {
        self.points.first().map(|p| p.concealment)
    }
}

/// What becomes of the columns of candidates, which take most of the memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Columns {
    /// They are kept for tests and pairs.
    Kept,
    /// Each candidate is judged by its own and forgets them.
    Dropped,
}

/// Most candidates that are taken of those which were found another way, and the score from which one is.
const MOST_FURTHER: usize = 6;
const SCORE_OF_FURTHER: f64 = 25.0;

/// What promises most of candidates that were found another way, best score first.
pub fn promising(found: Vec<Candidate>) -> Vec<Candidate> {
    found.into_iter().take_while(|c| c.score() > SCORE_OF_FURTHER).take(MOST_FURTHER).collect()
}

/// Puts what was found another way among candidates: what is there already is fitted from where that way points first.
pub fn include(candidates: &mut Vec<Candidate>, others: Vec<Candidate>) {
    for mut c in others {
        if let Some(place) = candidates.iter().position(|known| known.key() == c.key()) {
            c.points.extend(candidates.swap_remove(place).points);
        }
        candidates.push(c);
    }
    candidates.sort_by(|a, b| b.score().total_cmp(&a.score()));
}
