//! One evaluator: the design matrix, the one-step prediction and the free run agree on every term.

use hysid_dictionary::{Design, Dictionary, Factor, Model, Quantity, Record, Signal, Signals, Term};
use hysid_linalg::Columns;
use proptest::prelude::*;

fn signals() -> Signals {
    Signals::from_columns("y", &["a", "b"]).unwrap().with_threshold(Signal::Input(0), 0.2)
}

fn factor() -> impl Strategy<Value = Factor> {
    let signal = prop_oneof![Just(Signal::Output), Just(Signal::Input(0)), Just(Signal::Input(1))];
    (signal, 0usize..3, 0usize..4).prop_map(|(s, kind, lag)| {
        let lag = if s == Signal::Output { lag + 1 } else { lag };
        Factor { quantity: [Quantity::Value(s), Quantity::Difference(s), Quantity::Sign(s)][kind], lag }
    })
}

fn terms() -> impl Strategy<Value = Vec<Term>> {
    prop::collection::vec(prop::collection::vec(factor(), 0..5).prop_map(Term::new), 1..8).prop_map(|mut t| {
        t.sort();
        t.dedup();
        t
    })
}

fn samples(n: usize) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-1.0..1.0f64, n)
}

/// The value of a factor by its definition, on a record without gaps.
fn by_definition(f: Factor, n: usize, y: &[f64], inputs: [&[f64]; 2]) -> f64 {
    let at = n - f.lag;
    let (x, threshold) = match f.quantity.signal() {
        Signal::Output => (y, 0.0),
        Signal::Input(0) => (inputs[0], 0.2),
        Signal::Input(_) => (inputs[1], 0.0),
    };
    match f.quantity {
        Quantity::Value(_) => x[at],
        Quantity::Difference(_) => x[at] - x[at - 1],
        Quantity::Sign(_) => {
            (1..=at).rev().map(|m| x[m] - x[m - 1]).find(|d| d.abs() > threshold).map_or(1.0, f64::signum)
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn columns_are_products_of_factors(terms in terms(), y in samples(40), a in samples(40), b in samples(40)) {
        let dictionary = Dictionary::from_terms(signals(), terms).unwrap();
        let design = Design::new(&dictionary, &[Record::new(&y, vec![&a, &b])]).unwrap();
        let rows: Vec<usize> = design.samples().map(|(_, n)| n).collect();
        prop_assert_eq!(rows.len(), 40 - dictionary.reach());
        let mut column = vec![0.0; rows.len()];
        for (j, term) in dictionary.terms().iter().enumerate() {
            design.fill(j, 0..rows.len(), &mut column);
            for (&n, &c) in rows.iter().zip(&column) {
                prop_assert_eq!(c, term.evaluate(|f| by_definition(f, n, &y, [&a, &b])));
            }
        }
    }

    #[test]
    fn a_free_run_is_a_chain_of_one_step_predictions(
        terms in terms(), theta in prop::collection::vec(-0.3..0.3f64, 8), start in samples(6), a in samples(60), b in samples(60),
    ) {
        let theta = theta[..terms.len()].to_vec();
        let model = Model::new(signals(), terms, theta).unwrap();
        let run = model.free_run(&[&a, &b], &start, 60, 1e3).unwrap();
        let end = run.diverged_at.unwrap_or(60);
        prop_assert_eq!(&run.y[..6.min(end)], &start[..6.min(end)]);
        // Fed with its own output, one step ahead gives the same output again.
        let (y, a, b) = (&run.y[..end], &a[..end], &b[..end]);
        let again = model.one_step(&Record::new(y, vec![a, b])).unwrap();
        for n in 6..end {
            prop_assert!((again[n] - y[n]).abs() <= 1e-13 * (1.0 + y[n].abs()), "{}: {} {}", n, again[n], y[n]);
        }
    }

    #[test]
    fn gaps_cut_a_record_as_separate_records_do(terms in terms(), y in samples(60), a in samples(60), b in samples(60), gap in 10usize..50) {
        let dictionary = Dictionary::from_terms(signals(), terms).unwrap();
        let mut holed = y.clone();
        holed[gap] = f64::NAN;
        let one = Design::new(&dictionary, &[Record::new(&holed, vec![&a, &b])]).unwrap();
        let two = Design::new(&dictionary, &[
            Record::new(&y[..gap], vec![&a[..gap], &b[..gap]]),
            Record::new(&y[gap + 1..], vec![&a[gap + 1..], &b[gap + 1..]]),
        ]).unwrap();
        prop_assert_eq!(one.target(), two.target());
        let rows = one.rows();
        prop_assert_eq!(rows, two.rows());
        let (mut left, mut right) = (vec![0.0; rows], vec![0.0; rows]);
        for j in 0..dictionary.len() {
            one.fill(j, 0..rows, &mut left);
            two.fill(j, 0..rows, &mut right);
            prop_assert_eq!(&left, &right);
        }
    }
}

#[test]
fn divergence_is_a_result() {
    let model = Model::new(Signals::siso(), vec![Signals::siso().parse("y[n-1]^2").unwrap()], vec![1.0]).unwrap();
    let u = [0.0; 50];
    let run = model.free_run(&[&u], &[2.0], 50, 1e6).unwrap();
    // 2, 4, 16, 256, 65536, and then beyond a million.
    assert_eq!(run.diverged_at, Some(5));
    assert!(run.y[5..].iter().all(|v| v.is_nan()));
    assert_eq!(run.y[4], 65536.0);
}

/// The design as a stored matrix, whose products are the plain ones.
fn stored(design: &Design<'_>) -> hysid_linalg::Matrix {
    let columns: Vec<Vec<f64>> = (0..design.cols())
        .map(|j| {
            let mut c = vec![0.0; design.rows()];
            design.fill(j, 0..design.rows(), &mut c);
            c
        })
        .collect();
    hysid_linalg::Matrix::from_columns(&columns).unwrap()
}

fn close(name: &str, found: &[f64], expected: &[f64], scale: f64) -> Result<(), TestCaseError> {
    for (j, (a, b)) in found.iter().zip(expected).enumerate() {
        prop_assert!((a - b).abs() <= 1e-13 * scale, "{name}[{j}]: {a} {b}");
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]
    #[test]
    fn fused_products_equal_those_of_the_stored_matrix(
        terms in terms(), n in 10usize..700, seed in 0u64..1000, which in prop::collection::vec(0usize..8, 1..12),
    ) {
        let mut state = seed;
        let mut noise = move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        let mut series = || (0..n).map(|_| noise()).collect::<Vec<f64>>();
        let (mut y, a, b) = (series(), series(), series());
        y[n / 3] = f64::NAN;
        let dictionary = Dictionary::from_terms(signals(), terms).unwrap();
        let Ok(design) = Design::new(&dictionary, &[Record::new(&y, vec![&a, &b])]) else { return Ok(()) };
        let (stored, target) = (stored(&design), design.target());
        let (found, expected) = (design.start(&target), stored.start(&target));
        close("norms", &found.norms, &expected.norms, n as f64)?;
        close("cross", &found.cross, &expected.cross, n as f64)?;
        close("target", &[found.target], &[expected.target], n as f64)?;
        let which: Vec<usize> = which.into_iter().map(|j| j % design.cols()).collect();
        close("gram", design.gram_columns(&which).as_slice(), stored.gram_columns(&which).as_slice(), n as f64)?;
        // On few samples the ends may be too large beside the sums.
        let whole = design.gram(&target, usize::MAX);
        prop_assert!(whole.is_some() || n < 100);
        if let Some(whole) = whole {
            let all: Vec<usize> = (0..design.cols()).collect();
            close("whole", whole.matrix.as_slice(), stored.gram_columns(&all).as_slice(), n as f64)?;
            close("whole cross", &whole.cross, &expected.cross, n as f64)?;
            close("whole target", &[whole.target], &[expected.target], n as f64)?;
            prop_assert_eq!(whole.rows, design.rows());
        }
    }
}

/// One pass for all inner products: where sizes say so, for the design's own output, and where no digits are lost.
#[test]
fn one_pass_is_taken_where_it_is_cheaper_and_as_exact() {
    let wave = |n: usize, p: f64| (0..n).map(|i| (i as f64 * p).sin()).collect::<Vec<f64>>();
    let narx = |lags: usize| hysid_dictionary::Spec::narx(Signals::siso(), lags, 1..=lags, 3).build().unwrap();
    // (lags, samples, columns wanted, whether one pass is cheaper)
    let cases = [
        (3, 60_000, 40, true),
        (3, 60_000, 4, false),
        (3, 2_000, 40, false),
        (3, 2_000, usize::MAX, true),
        (5, 200_000, 10, false),
        (5, 200_000, 20, true),
    ];
    for (lags, samples, columns, expected) in cases {
        let (u, y, dictionary) = (wave(samples, 0.37), wave(samples, 0.11), narx(lags));
        let design = Design::new(&dictionary, &[Record::siso(&u, &y)]).unwrap();
        let taken = design.gram(&design.target(), columns).is_some();
        assert_eq!(taken, expected, "{} candidates, {samples} samples, {columns} columns", dictionary.len());
    }
    let (u, mut y, dictionary) = (wave(3_000, 0.37), wave(3_000, 0.11), narx(3));
    let another = |design: &Design<'_>| design.target().iter().map(|y| y + 1.0).collect::<Vec<f64>>();
    let design = Design::new(&dictionary, &[Record::siso(&u, &y)]).unwrap();
    assert_eq!(design.gram(&another(&design), usize::MAX), None);
    // A sample so large that nothing is left of the sums without it.
    y[0] = 1e5;
    let design = Design::new(&dictionary, &[Record::siso(&u, &y)]).unwrap();
    assert_eq!(design.gram(&design.target(), usize::MAX), None);
}

#[test]
fn the_number_of_threads_changes_not_a_bit() {
    let wave = |p: f64| (0..30_000).map(|i| (i as f64 * p).sin()).collect::<Vec<f64>>();
    let (u, y) = (wave(0.37), wave(0.11));
    let dictionary = hysid_dictionary::Spec::narx(Signals::siso(), 4, 0..=4, 3).build().unwrap();
    let design = Design::new(&dictionary, &[Record::siso(&u, &y)]).unwrap();
    let target = design.target();
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| (design.start(&target), design.gram_columns(&[0, 5, 77]), design.gram(&target, usize::MAX)))
    };
    assert!(on(1).2.is_some());
    assert_eq!(on(1), on(3));
}
