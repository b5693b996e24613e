//! Families of models that compete: which linear terms a model starts from, and which terms may join.

use hysid_dictionary::{Factor, Signal, Term};
use hysid_narx::{Derived, Law};

/// One family.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Family {
    /// What it is called in the report.
    pub name: String,
    /// Output lags 1 to this.
    pub ny: usize,
    /// Input lags up to this.
    pub nu: usize,
    /// The derived inputs.
    pub derived: Vec<Derived>,
    /// The terms that the model starts from.
    pub linear: Vec<Term>,
    /// The terms that may join.
    pub candidates: Vec<Term>,
}

impl Family {
    /// Samples that start a run of any of its models.
    pub(crate) fn given(&self) -> usize {
        let reach = self.linear.iter().chain(&self.candidates).map(Term::reach).max().unwrap_or(0);
        reach.max(1)
    }

    /// What families share that are near copies of each other: their lags and the number of plays.
    pub(crate) fn kind(&self) -> (usize, usize, usize) {
        let plays = self.derived.iter().filter(|d| matches!(d.law, Law::Play { .. })).count();
        (self.ny, self.nu, plays)
    }
}

/// A factor or a product that counts as one, as the magnitude of a difference: its difference times its sign.
pub(crate) type Atom = Vec<Factor>;

/// Products of up to `degree` atoms, without repetition; the square of a sign is 1, and what that leaves is kept once.
pub(crate) fn products(atoms: &[Atom], degree: usize) -> Vec<Term> {
    let mut all: Vec<Term> = vec![Term::constant()];
    let mut last: Vec<(usize, Vec<Factor>)> = vec![(0, Vec::new())];
    for _ in 0..degree {
        let mut next = Vec::new();
        for (from, factors) in &last {
            for (i, atom) in atoms.iter().enumerate().skip(*from) {
                let mut longer = factors.clone();
                longer.extend(atom);
                next.push((i, longer));
            }
        }
        all.extend(next.iter().map(|(_, f)| Term::new(f.iter().copied())));
        last = next;
    }
    let mut seen = std::collections::HashSet::new();
    all.retain(|t| seen.insert(t.clone()));
    all
}

/// The constant and the linear terms of these lags.
pub(crate) fn linear(inputs: usize, ny: usize, nu: std::ops::RangeInclusive<usize>) -> Vec<Term> {
    let mut terms = vec![Term::constant()];
    terms.extend((1..=ny).map(|l| Term::new([Factor::value(Signal::Output, l)])));
    for i in 0..inputs {
        terms.extend(nu.clone().map(|l| Term::new([Factor::value(Signal::Input(i), l)])));
    }
    terms
}

/// Atoms for the lags of all signals.
pub(crate) fn lag_atoms(inputs: usize, ny: usize, nu: std::ops::RangeInclusive<usize>) -> Vec<Atom> {
    linear(inputs, ny, nu).iter().skip(1).map(|t| t.factors().to_vec()).collect()
}

/// The magnitude and the sign of a signal's difference.
pub(crate) fn reversal_atoms(signal: Signal, lag: usize) -> [Atom; 2] {
    [vec![Factor::difference(signal, lag), Factor::sign(signal, lag)], vec![Factor::sign(signal, lag)]]
}

/// The number of products of up to `degree` of `atoms` atoms.
pub(crate) fn count(atoms: usize, degree: usize) -> usize {
    (1..=degree).fold(1usize, |c, d| c.saturating_mul(atoms + d) / d)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_all_monomials_once() {
        for (ny, nu, degree) in [(2, 2, 3), (1, 0, 2), (3, 1, 1)] {
            let atoms = lag_atoms(1, ny, 0..=nu);
            assert_eq!(products(&atoms, degree).len(), count(atoms.len(), degree));
        }
        let [magnitude, sign] = reversal_atoms(Signal::Input(0), 0);
        // 1, m, s, m m, m s (= d), s s = 1 again
        assert_eq!(products(&[magnitude, sign], 2).len(), 5);
    }
}
