//! The default finds every term of the known 11-term system and no other, for every seed.

use crate::common::{TRUTH, narx, true_terms};
use hysid_dictionary::{Design, Record, Signals, Spec, Term};
use hysid_select::{Options, Search, Selection, select};

fn run(n: usize, seed: u64, noise: f64, options: &Options) -> (Selection, Vec<Term>) {
    let (u, y) = narx(n, seed, noise);
    let dictionary = Spec::narx(Signals::siso(), 3, 1..=3, 3).build().unwrap();
    assert_eq!(dictionary.len(), 84);
    let design = Design::new(&dictionary, &[Record::siso(&u, &y)]).unwrap();
    let selection = select(&design, &design.target(), options).unwrap();
    let mut terms: Vec<Term> = selection.terms.iter().map(|&j| dictionary.terms()[j].clone()).collect();
    terms.sort();
    (selection, terms)
}

#[test]
fn the_default_finds_exactly_the_true_terms_without_noise() {
    for seed in 1..=20 {
        let (selection, terms) = run(10_000, seed, 0.0, &Options::default());
        assert_eq!(terms, true_terms(), "seed {seed}: {} terms, {:?}", terms.len(), selection.stop);
        for (coefficient, text) in TRUTH {
            let term = Signals::siso().parse(text).unwrap();
            let dictionary = Spec::narx(Signals::siso(), 3, 1..=3, 3).build().unwrap();
            let at = selection.terms.iter().position(|&j| dictionary.terms()[j] == term).unwrap();
            assert!((selection.theta[at] - coefficient).abs() < 1e-10, "seed {seed}, {text}");
        }
    }
}

#[test]
fn the_default_keeps_the_true_terms_and_hardly_another_with_noise() {
    let press = hysid_select::Criterion::Press(hysid_select::PressForm::Exact);
    let (mut spurious, mut spurious_by_press) = (0, 0);
    for seed in 1..=5 {
        let (_, terms) = run(10_000, seed, 0.01, &Options::default());
        let missed: Vec<Term> = true_terms().into_iter().filter(|t| !terms.contains(t)).collect();
        assert!(missed.is_empty(), "seed {seed}: {missed:?}");
        spurious += terms.len() - 11;
        let plain = Options { criterion: press.clone(), ..Options::default() };
        spurious_by_press += run(10_000, seed, 0.01, &plain).1.len() - 11;
    }
    assert!(spurious <= 2, "{spurious} spurious terms over 5 seeds");
    assert!(spurious_by_press > 10 * spurious.max(1), "PRESS alone: {spurious_by_press}");
}

#[test]
fn plain_greedy_loses_terms_that_the_beam_keeps() {
    let found = |search| {
        let options = Options { search, criterion: hysid_select::Criterion::Terms(11), ..Options::default() };
        (1..=5).map(|seed| run(10_000, seed, 0.0, &options).1.iter().filter(|t| true_terms().contains(t)).count()).min()
    };
    assert!(found(Search::Greedy) < Some(11));
    assert_eq!(found(Search::Beam { width: 10 }), Some(11));
    assert_eq!(found(Search::Floating), Some(11));
}
