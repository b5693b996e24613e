//! The time that a search may take: asked between fits, and a record of what was left out for want of it.
//!
//! The engine reads no clock; the caller says whether a share of the time is up. A search that was cut short knows fewer rivals than a whole
//! one, so that nothing it says is firm: [`Budget::unfinished`] tells.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

/// Share of the time after which the search ends: what was found must still be judged.
const SEARCH: f64 = 0.75;
/// Share after which what remains is not tested: that takes as long as the first screening.
const TESTS: f64 = 0.85;
/// Share after which what refines the verdict is left out.
const WHOLE: f64 = 1.0;

/// A step that can be left out, in the words of the note.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// Fits of the likeliest effects and pairs, to the end.
    Fits,
    /// Rivals of the best effect.
    Rivals,
    /// Variants of the simulation's own numerics.
    Numerics,
    /// Further effects and swaps.
    Composition,
    /// The set without each of its effects.
    Drops,
    /// Sets fitted under another noise model.
    OtherNoise,
    /// The second look on simulated recordings.
    Rehearsal,
    /// Scores of rivals on held-out blocks.
    Blocks,
    /// The test of what remains.
    Remains,
    /// Generic terms in the place of the effects.
    Imitation,
    /// The search once more, from better parameters or with shorter steps.
    Again,
    /// A written correction without each of its terms; the verdict does not rest on it.
    Terms,
    /// The experiment; the verdict does not rest on it.
    Experiment,
}

impl Step {
    fn words(self) -> &'static str {
        match self {
            Self::Fits => "fits of likely effects",
            Self::Rivals => "rivals of the best effect",
            Self::Numerics => "the simulation's own numerics",
            Self::Composition => "further effects",
            Self::Drops => "whether each effect is needed",
            Self::OtherNoise => "fits under another noise model",
            Self::Rehearsal => "the second look on simulated recordings",
            Self::Blocks => "rivals on held-out blocks",
            Self::Remains => "the test of what remains",
            Self::Imitation => "whether generic terms explain more than the effects",
            Self::Again => "the search once more, from better parameters or with shorter steps",
            Self::Terms => "whether each term of the correction is needed",
            Self::Experiment => "an experiment",
        }
    }
}

/// The time that a diagnosis may take.
pub struct Budget<'a> {
    expired: &'a (dyn Fn(f64) -> bool + Sync),
    left_out: Mutex<BTreeSet<Step>>,
}

impl std::fmt::Debug for Budget<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Budget").field("left_out", &self.left_out).finish_non_exhaustive()
    }
}

impl<'a> Budget<'a> {
    /// With this answer to whether a share of the time is up.
    pub fn new(expired: &'a (dyn Fn(f64) -> bool + Sync)) -> Self {
        Self { expired, left_out: Mutex::default() }
    }

    /// Whether a step of the search must be left out; it is remembered.
    pub fn omits(&self, step: Step) -> bool {
        let share = match step {
            Step::Remains | Step::Drops => TESTS,
            Step::Blocks | Step::Imitation | Step::Terms | Step::Experiment => WHOLE,
            _ => SEARCH,
        };
        let late = (self.expired)(share);
        if late {
            self.remember(step);
        }
        late
    }

    /// Whether the search can be begun again where what was done of it so far takes so many times as long from here on.
    pub fn affords(&self, times: f64) -> bool {
        !(self.expired)(SEARCH / (1.0 + times))
    }

    /// Remembers that the search was not begun again for want of time.
    pub fn not_again(&self) {
        self.remember(Step::Again);
    }

    fn remember(&self, step: Step) {
        self.left_out.lock().unwrap_or_else(PoisonError::into_inner).insert(step);
    }

    /// Whether something was left out on which the verdict rests.
    pub fn unfinished(&self) -> bool {
        self.list().iter().any(|step| !matches!(step, Step::Terms | Step::Experiment))
    }

    fn list(&self) -> Vec<Step> {
        self.left_out.lock().unwrap_or_else(PoisonError::into_inner).iter().copied().collect()
    }

    /// What was left out, as a sentence; `None` where nothing was.
    pub fn note(&self) -> Option<String> {
        let list = self.list();
        if list.is_empty() {
            return None;
        }
        let words: Vec<&str> = list.iter().map(|step| step.words()).collect();
        let firm = if self.unfinished() {
            "; the search is not complete, so nothing here is firm, and a mismatch may have gone unseen"
        } else {
            ""
        };
        Some(format!(
            "the time limit left out, wholly or in part: {}{firm}. The result depends on the machine",
            words.join(", ")
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_left_out_is_told_and_an_experiment_alone_leaves_the_verdict_alone() {
        let time = |up: f64| move |share: f64| up > share;
        let whole = time(0.5);
        let in_time = Budget::new(&whole);
        assert!(!in_time.omits(Step::Fits) && !in_time.omits(Step::Blocks));
        assert_eq!((in_time.unfinished(), in_time.note()), (false, None));

        let half = time(0.9);
        let cut = Budget::new(&half);
        assert!(cut.omits(Step::Rivals) && cut.omits(Step::Fits) && !cut.omits(Step::Blocks));
        let note = cut.note().unwrap();
        assert!(cut.unfinished() && note.contains("fits of likely effects, rivals of the best effect; "), "{note}");

        let none = time(2.0);
        let last = Budget::new(&none);
        assert!(last.omits(Step::Experiment) && !last.unfinished());
        assert!(last.note().unwrap().contains("an experiment. "));
    }
}
