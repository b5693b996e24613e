//! One scored case: what was concealed, what was said, and whether it is right.

use hysid_concealed::case::{Case, Concealed, Group, Label};

use super::super::experiment::Settled;
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
    pub settled: Option<Settled>,
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

    /// Whether a tie between these mechanisms is resolved, and correctly: the guess is right, and whatever of the tie is wrong has odds of at
    /// most 1 to 9 against it, which is what makes a statement firm. That a verdict is `named` would ask for more: that no rule keeps the
    /// member from being firm, and that no third mechanism, between which nobody was asked to decide, ties with it.
    pub fn resolves(&self, tie: &[String]) -> bool {
        let Some(v) = self.verdict() else { return false };
        let right = |name: &str| self.label.effects.iter().any(|e| is(e, name));
        let least = v.effects.iter().map(|e| e.probability).fold(1.0, f64::min);
        let refuted = |name: &str| {
            let list = v.alternatives.iter().filter(|a| a.mechanism == name);
            9.0 * list.map(|a| a.probability).fold(0.0, f64::max) <= least
        };
        self.mechanisms_right() && tie.iter().all(|name| right(name) || refuted(name))
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
