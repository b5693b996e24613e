//! Selection from a streamed Gram matrix against selection from the samples.

use hysid_dictionary::{Design, Dictionary, GramSums, Record, Signal, Signals, Spec};
use hysid_linalg::{Gram, Matrix};
use hysid_select::{Criterion, Options, PressForm, Search, SelectError, Selection, select, select_gram};

fn streamed(dictionary: &Dictionary, u: &[f64], y: &[f64], block: usize) -> Gram {
    let mut sums = GramSums::new(dictionary).unwrap();
    for (u, y) in u.chunks(block).zip(y.chunks(block)) {
        sums.push(&Record::siso(u, y)).unwrap();
    }
    sums.finish().unwrap()
}

fn both(dictionary: &Dictionary, u: &[f64], y: &[f64], options: &Options) -> (Selection, Selection) {
    let design = Design::new(dictionary, &[Record::siso(u, y)]).unwrap();
    let samples = select(&design, &design.target(), options).unwrap();
    (samples, select_gram(&streamed(dictionary, u, y, 1000), options).unwrap())
}

#[test]
fn the_same_terms_and_coefficients_as_from_the_samples() {
    let greedy = |n| Options { search: Search::Greedy, criterion: Criterion::Terms(n), ..Options::default() };
    let beam = Options { search: Search::Beam { width: 5 }, criterion: Criterion::Terms(9), ..Options::default() };
    let pursuit = Options { search: Search::MatchingPursuit, ..greedy(6) };
    let err = Options { criterion: Criterion::ErrTolerance(1e-3), ..Options::default() };
    let bic = Options { criterion: Criterion::Bic, ..Options::default() };
    let wide = Spec::narx(Signals::siso(), 5, 1..=5, 3).build().unwrap();
    let low = Spec::narx(Signals::siso(), 3, 0..=3, 2).build().unwrap();
    let signs = Spec::narx(Signals::siso(), 2, 0..=2, 2).hysteresis(Signal::Input(0), [0, 1]).build().unwrap();
    let (bu, by) = crate::common::boucwen(60_000);
    let thin = |x: &[f64]| x.iter().step_by(20).copied().collect::<Vec<f64>>();
    let (bu, by) = (thin(&bu), thin(&by));
    let squared = Options { criterion: Criterion::Press(PressForm::Squared), ..Options::default() };
    let options = [greedy(15), beam, pursuit, err, bic, squared, Options::default()];
    for (dictionary, which) in [(&wide, "narx"), (&low, "narx"), (&low, "boucwen"), (&signs, "boucwen")] {
        for seed in 1..3 {
            let (u, y) = if which == "narx" { crate::common::narx(6000, seed, 0.05) } else { (bu.clone(), by.clone()) };
            for options in &options {
                // Where residuals are large where leverages are, the exact PRESS may stop a term earlier.
                if which == "boucwen" && *options == Options::default() {
                    continue;
                }
                let (samples, gram) = both(dictionary, &u, &y, options);
                let what = format!("{which} {} {options:?}", dictionary.len());
                assert_eq!(samples.terms, gram.terms, "{what}");
                assert_eq!(samples.stop, gram.stop, "{what}");
                for (a, b) in samples.theta.iter().zip(&gram.theta) {
                    assert!((a - b).abs() <= 1e-9 * a.abs().max(b.abs()), "{what}: {a} {b}");
                }
                for (a, b) in samples.steps.iter().zip(&gram.steps) {
                    assert!((a.err - b.err).abs() <= 1e-9 * a.err, "{what}: {} {}", a.err, b.err);
                    // Leverages of 3000 or more samples differ little, though where they are large residuals are large here.
                    assert!((a.press / b.press - 1.0).abs() < 0.05, "{what}: {} {}", a.press, b.press);
                }
            }
        }
    }
}

#[test]
fn an_exact_model_is_found_and_not_overdone() {
    let dictionary = Spec::narx(Signals::siso(), 3, 1..=3, 3).build().unwrap();
    let (u, y) = crate::common::narx(10_000, 1, 0.0);
    let found = select_gram(&streamed(&dictionary, &u, &y, 4096), &Options::default()).unwrap();
    let mut terms: Vec<_> = found.terms.iter().map(|&j| dictionary.terms()[j].clone()).collect();
    terms.sort();
    assert_eq!(terms, crate::common::true_terms());
    for (&j, theta) in found.terms.iter().zip(&found.theta) {
        let truth =
            crate::common::TRUTH.iter().find(|(_, t)| Signals::siso().parse(t).unwrap() == dictionary.terms()[j]);
        assert!((truth.unwrap().0 - theta).abs() < 1e-9);
    }
}

/// Undecimated Bouc-Wen data, condition near 1e14: no inner product can order all of 36 terms, and the report says from where on.
#[test]
fn where_digits_run_out_it_says_so() {
    let dictionary = Spec::narx(Signals::siso(), 3, 0..=3, 3).build().unwrap();
    let (u, y) = crate::common::boucwen(10_000);
    let options = Options { search: Search::Greedy, criterion: Criterion::Terms(36), ..Options::default() };
    let (samples, gram) = both(&dictionary, &u, &y, &options);
    let sure = gram.precision.doubtful_from.unwrap();
    assert!(sure >= 3, "{sure}");
    assert_eq!(samples.terms[..sure], gram.terms[..sure]);
    // And where it vouches for all, all agree: the first terms alone.
    let options = Options { criterion: Criterion::Terms(3), ..options };
    let (samples, gram) = both(&dictionary, &u, &y, &options);
    assert_eq!(gram.precision.doubtful_from, None);
    assert_eq!(samples.terms, gram.terms);
}

#[test]
fn what_needs_samples_or_does_not_fit_is_refused() {
    let gram = |m: usize, cross: usize, target: f64| Gram {
        matrix: Matrix::zeros(m, m),
        cross: vec![0.0; cross],
        target,
        rows: 9,
    };
    let blocks = Options { criterion: Criterion::Blocks(vec![0..4, 4..9]), ..Options::default() };
    let press = Options { criterion: Criterion::Press(PressForm::Exact), ..Options::default() };
    assert!(matches!(select_gram(&gram(2, 2, 1.0), &blocks), Err(SelectError::Option { .. })));
    assert!(matches!(select_gram(&gram(2, 3, 1.0), &press), Err(SelectError::Shape { .. })));
    assert!(matches!(select_gram(&gram(0, 0, 1.0), &press), Err(SelectError::Empty { .. })));
    assert!(matches!(select_gram(&gram(2, 2, 0.0), &press), Err(SelectError::ZeroTarget)));
    assert!(matches!(select_gram(&gram(2, 2, f64::NAN), &press), Err(SelectError::NotFinite(_))));
    assert_eq!(select_gram(&gram(2, 2, 1.0), &press).unwrap().terms, [] as [usize; 0]);
}
