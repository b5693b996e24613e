//! What was seen around sets of effects. Backward search comes back to sets that were extended before: what could be missing around them is known, and what
//! was fitted beside them need not be fitted again.

use super::candidate::Candidate;
use crate::model::hypothesis::{Hypothesis, Key};

/// Log evidence within which two fits of one statement are the same fit.
const SAME: f64 = 0.15;

/// What was seen around one set.
pub struct Look {
    set: Key,
    log_evidence: f64,
    /// What could be missing, best score first.
    pub candidates: Vec<Candidate>,
    /// What was fitted beside the set.
    pub fitted: Vec<Key>,
}

impl Look {
    fn is_of(&self, h: &Hypothesis<'_>) -> bool {
        (self.log_evidence - h.log_evidence).abs() < SAME && self.set == h.key()
    }
}

/// What one more look at a set brings.
#[derive(Default)]
pub struct Seen<'d> {
    /// What could be missing, where that was not known.
    pub fresh: Option<Vec<Candidate>>,
    /// What was fitted beside the set.
    pub fitted: Vec<Key>,
    /// The sets that were fitted, beside it or in the place of one of its members.
    pub found: Vec<Hypothesis<'d>>,
}

/// All that was seen, in the order in which it was.
#[derive(Default)]
pub struct Looks(Vec<Look>);

impl Looks {
    /// What was seen around this fit of a set.
    pub fn around(&self, h: &Hypothesis<'_>) -> Option<&Look> {
        self.0.iter().find(|look| look.is_of(h))
    }

    /// Keeps what was seen, together with what is known of the same fit; the sets that came of it are given back.
    pub fn keep<'d>(&mut self, h: &Hypothesis<'_>, seen: Seen<'d>) -> Vec<Hypothesis<'d>> {
        let Seen { fresh, fitted, found } = seen;
        match (self.0.iter_mut().find(|look| look.is_of(h)), fresh) {
            (Some(known), _) => known.fitted.extend(fitted),
            (None, Some(candidates)) => {
                self.0.push(Look { set: h.key(), log_evidence: h.log_evidence, candidates, fitted });
            }
            (None, None) => {}
        }
        found
    }
}
