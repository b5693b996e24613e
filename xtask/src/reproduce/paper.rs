//! What the paper's tables were computed from: the Preisach loop, the 46 terms, the matching pursuit. See `docs/reproduction.md` for how this is known.

use anyhow::Context;
use hysid_decimate::{Decimator, Phase};
use hysid_dictionary::{Constant, Design, Dictionary, Factor, Record, Rule, Signal, Signals, Spec, Term};
use hysid_hysteresis::Operator;
use hysid_hysteresis::preisach::PreisachPlane;
use hysid_linalg::Columns;
use hysid_select::{Criterion, Options, PressForm, Search, Selection, select};

/// The loop: input and output, 202 samples, the peak twice.
pub fn preisach_loop() -> anyhow::Result<(Vec<f64>, Vec<f64>)> {
    let up = (0..=100).map(|m| f64::from(m - 50) / 100.0);
    let u: Vec<f64> = up.chain((0..=100).map(|n| f64::from(50 - n) / 100.0)).collect();
    let y = PreisachPlane::of_the_paper().grid()?.run(&u);
    Ok((u, y))
}

/// The samples that the paper kept: L, 2L, ... counted from 1, without a filter.
pub fn compress(x: &[f64], factor: usize) -> anyhow::Result<Vec<f64>> {
    Ok(Decimator::Plain.apply(x, factor, Phase::Lth)?)
}

/// The authors' 46 candidates: y(t-3), u(t) to u(t-3), all 28 products of two of the seven lagged variables, and the 13 products of three with equal lags.
pub fn dictionary() -> anyhow::Result<Dictionary> {
    let absent = [1, 2].map(|lag| Term::new([Factor::value(Signal::Output, lag)]));
    Spec::narx(Signals::siso(), 3, 0..=3, 3)
        .constant(Constant::Omitted)
        .rule(Rule::EqualLags { from_degree: 3 })
        .rule(Rule::Exclude(absent.to_vec()))
        .build()
        .context("the paper's dictionary")
}

/// A selection and the dictionary it was made from.
pub struct Chosen {
    /// The candidates.
    pub dictionary: Dictionary,
    /// The outcome.
    pub selection: Selection,
    /// Rows of the regression.
    pub rows: usize,
    /// The regression's targets.
    pub target: Vec<f64>,
    /// The predictions of the targets.
    pub fitted: Vec<f64>,
}

impl Chosen {
    /// The coefficient of this term (`y[n-1]^2`), if it was chosen.
    pub fn theta(&self, term: &str) -> Option<f64> {
        let wanted = self.dictionary.signals().parse(term).ok()?;
        let column = self.dictionary.find(&wanted)?;
        let at = self.selection.terms.iter().position(|c| *c == column)?;
        self.selection.theta.get(at).copied()
    }

    /// The chosen terms in order.
    pub fn terms(&self) -> Vec<String> {
        self.selection.terms.iter().map(|c| self.dictionary.text(*c)).collect()
    }
}

/// Selects from the paper's dictionary on this record.
pub fn choose(u: &[f64], y: &[f64], options: &Options) -> anyhow::Result<Chosen> {
    let dictionary = dictionary()?;
    choose_from(dictionary, &[Record::siso(u, y)], options)
}

/// Selects from any dictionary on these records.
pub fn choose_from(dictionary: Dictionary, records: &[Record<'_>], options: &Options) -> anyhow::Result<Chosen> {
    let (selection, target, fitted) = {
        let design = Design::new(&dictionary, records)?;
        let target = design.target();
        let selection = select(&design, &target, options)?;
        let rows = target.len();
        let mut fitted = vec![0.0; rows];
        for (column, theta) in selection.terms.iter().zip(&selection.theta) {
            let mut values = vec![0.0; rows];
            design.fill(*column, 0..rows, &mut values);
            fitted.iter_mut().zip(&values).for_each(|(f, v)| *f += theta * v);
        }
        (selection, target, fitted)
    };
    Ok(Chosen { dictionary, selection, rows: target.len(), target, fitted })
}

/// The authors' selection: plain matching pursuit, so many terms.
pub fn pursuit(terms: usize) -> Options {
    Options {
        search: Search::MatchingPursuit,
        criterion: Criterion::Terms(terms),
        max_terms: terms,
        ..Options::default()
    }
}

/// The right selection: every candidate orthogonalised, exact leave-one-out PRESS.
pub fn orthogonal(largest: usize) -> Options {
    Options {
        search: Search::Greedy,
        criterion: Criterion::Press(PressForm::Exact),
        max_terms: largest,
        ..Options::default()
    }
}

/// `y[n-1]^2` as the paper writes it: `y^2(t-1)`.
pub fn in_words(terms: &[String]) -> String {
    terms.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loop_is_the_closed_form() {
        let (u, y) = preisach_loop().unwrap();
        assert_eq!(u.len(), 202);
        for m in 0..=100_i32 {
            let rise = f64::from(m * (m - 1)) / 39600.0;
            assert!((y[m as usize] - rise).abs() < 1e-12, "up at {m}");
            assert!((y[101 + m as usize] - (0.25 - rise)).abs() < 1e-12, "down at {m}");
        }
    }

    #[test]
    fn the_dictionary_has_46_terms() {
        let d = dictionary().unwrap();
        assert_eq!(d.len(), 46);
        assert!(d.dropped().is_empty());
    }
}
