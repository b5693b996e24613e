//! One scored case: what was concealed, what was said, and whether it is right.

use hysid_concealed::case::{Case, Concealed, Group, Label};

use super::super::rivals::Rivals;
use super::super::trial::Trial;
use super::super::verdict::{Stated, Verdict};

/// One scored case.
#[derive(Debug)]
pub struct Row {
    /// Label.
    pub label: Label,
    /// What the program said.
    pub trial: Trial,
    /// Competitors.
    pub rivals: Rivals,
    /// Whether the proposed experiment settled the tie, where one was proposed with enough separation.
    pub settled: Option<bool>,
}

impl Row {
    /// A row from its parts.
    pub fn new(case: &Case, trial: Trial, rivals: Rivals) -> Self {
        Self { label: case.label.clone(), trial, rivals, settled: None }
    }

    /// The verdict, where there is one.
    pub fn verdict(&self) -> Option<&Verdict> {
        self.trial.verdict.as_ref().ok()
    }

    /// The best guess.
    pub fn guess(&self) -> Vec<Stated> {
        self.verdict().map(Verdict::guess).unwrap_or_default()
    }

    /// Whether the families guessed are the true ones, none more and none less.
    pub fn families_right(&self) -> bool {
        let guess = self.guess();
        guess.len() == self.label.effects.len()
            && self.label.effects.iter().all(|e| guess.iter().any(|g| family_fits(e, g)))
            && guess.iter().all(|g| self.label.effects.iter().any(|e| family_fits(e, g)))
    }

    /// Whether the mechanisms guessed are the true ones.
    pub fn mechanisms_right(&self) -> bool {
        let guess = self.guess();
        guess.len() == self.label.effects.len()
            && self.label.effects.iter().all(|e| guess.iter().any(|g| mechanism_fits(e, g)))
    }

    /// Whether every true mechanism is guessed or is a rival that this record cannot separate from the guess.
    pub(super) fn classes_right(&self) -> bool {
        let guess = self.guess();
        let tied = |e: &Concealed| {
            self.verdict().is_some_and(|v| {
                v.alternatives.iter().any(|a| is(e, &a.mechanism) && a.separation.is_some_and(|s| s < 9.0))
            })
        };
        self.families_right()
            && self.label.effects.iter().all(|e| guess.iter().any(|g| mechanism_fits(e, g)) || tied(e))
    }

    pub(super) fn slots_right(&self) -> bool {
        let guess = self.guess();
        guess.len() == self.label.effects.len()
            && self.label.effects.iter().all(|e| guess.iter().any(|g| e.slots.contains(&g.slot)))
    }

    /// Held-out error of what the user ends up with: the augmented simulation, or the baseline where nothing was added.
    pub fn after(&self) -> f64 {
        self.trial.after.unwrap_or(self.rivals.before)
    }

    pub(super) fn information(&self) -> f64 {
        self.label.samples as f64 * self.label.dnr.powi(2)
    }

    pub(super) fn in_catalogue(&self) -> bool {
        !matches!(self.label.group, Group::Outside)
    }
}

/// Held-out error over the oracle's; both count as a hundredth of the noise at least.
pub(super) fn over_oracle(r: &Row) -> f64 {
    r.after().max(0.01) / r.rivals.oracle.max(0.01)
}

fn is(e: &Concealed, mechanism: &str) -> bool {
    e.mechanism == mechanism || e.same.iter().any(|s| s.0 == mechanism)
}

pub(super) fn mechanism_fits(e: &Concealed, g: &Stated) -> bool {
    is(e, &g.mechanism)
}

pub(super) fn family_fits(e: &Concealed, g: &Stated) -> bool {
    e.family == g.family || e.same.iter().any(|s| s.1 == g.family)
}
