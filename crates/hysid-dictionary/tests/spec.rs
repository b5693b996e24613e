//! Which candidates a specification gives, and what is dropped as collinear.

use hysid_dictionary::{Constant, Design, DictionaryError, DroppedReason, Record, Rule, Signal, Signals, Spec};
use hysid_linalg::{Columns, Matrix, lstsq};

const U: Signal = Signal::Input(0);

#[test]
fn sizes_of_dictionaries() {
    let s = Signals::siso;
    let two = || Signals::from_columns("y", &["a", "b"]).unwrap();
    let cases = [
        ("NARX 3/3", Spec::narx(s(), 3, 1..=3, 3), 84),
        ("NARX 3/3 with u[n]", Spec::narx(s(), 3, 0..=3, 3), 120),
        ("NARX 5/5", Spec::narx(s(), 5, 1..=5, 3), 286),
        ("NARX 10/10", Spec::narx(s(), 10, 1..=10, 3), 1771),
        ("ARX", Spec::narx(s(), 2, 1..=2, 1).constant(Constant::Omitted), 4),
        ("Volterra", Spec::narx(s(), 0, 0..=2, 2), 10),
        ("NAR", Spec::new(s()).lags(Signal::Output, 1..=2).degree(2), 6),
        ("two inputs", Spec::narx(two(), 1, 0..=0, 2), 10),
        ("pure powers", Spec::narx(s(), 1, 0..=0, 3).rule(Rule::PurePowers { from_degree: 2 }), 7),
        ("at most one y", Spec::narx(s(), 1, 0..=0, 2).rule(Rule::AtMost { signal: Signal::Output, factors: 1 }), 5),
        // sgn: 1, s; y, ys, yy, yys, yyy (degree 3), less the squares of s.
        ("one sign", Spec::new(s()).lags(Signal::Output, [1]).signs(U, [0]).degree(3), 7),
        // du beside u[n] and u[n-1] adds nothing, with or without the sign.
        ("difference beside its lags", Spec::new(s()).lags(U, 0..=1).hysteresis(U, [0]).degree(2), 9),
        ("difference beside one lag", Spec::new(s()).lags(U, [0]).hysteresis(U, [0]).degree(2), 9),
    ];
    for (name, spec, expected) in cases {
        let dictionary = spec.build().unwrap();
        let texts: Vec<String> = (0..dictionary.len()).map(|j| dictionary.text(j)).collect();
        assert_eq!(dictionary.len(), expected, "{name}: {texts:?}");
    }
}

#[test]
fn what_is_dropped_is_said() {
    let spec = Spec::new(Signals::siso()).lags(U, 0..=1).hysteresis(U, [0]).degree(2);
    let dictionary = spec.build().unwrap();
    let reason = |text: &str| dictionary.dropped().iter().find(|d| d.text == text).map(|d| d.reason.clone());
    let within = |terms: &[&str]| DroppedReason::Collinear { within: terms.iter().map(|t| t.to_string()).collect() };
    assert_eq!(reason("du[n]"), Some(within(&["u[n]", "u[n-1]"])));
    assert_eq!(reason("du[n]^2"), Some(within(&["u[n]^2", "u[n]*u[n-1]", "u[n-1]^2"])));
    assert_eq!(reason("du[n]*sgn(du[n])"), Some(within(&["u[n]*sgn(du[n])", "u[n-1]*sgn(du[n])"])));
    let squared = DroppedReason::SignSquared { same_as: "1".into() };
    assert_eq!(reason("sgn(du[n])*sgn(du[n])"), Some(squared));
}

#[test]
fn no_column_of_a_hysteresis_dictionary_depends_on_the_others() {
    let mut state = 12345u64;
    let mut noise = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let u: Vec<f64> = (0..600).map(|_| noise()).collect();
    let y: Vec<f64> = (0..600).map(|_| noise()).collect();
    let specs = [
        Spec::narx(Signals::siso(), 1, 0..=1, 3).hysteresis(U, [0]),
        Spec::narx(Signals::siso(), 2, 0..=0, 3).hysteresis(U, [0, 1]),
        Spec::narx(Signals::siso(), 2, 1..=2, 2).hysteresis(U, [0, 1, 2]).hysteresis(Signal::Output, [1]),
    ];
    for spec in specs {
        let dictionary = spec.build().unwrap();
        let design = Design::new(&dictionary, &[Record::siso(&u, &y)]).unwrap();
        let mut columns = vec![vec![0.0; design.rows()]; design.cols()];
        for (j, c) in columns.iter_mut().enumerate() {
            design.fill(j, 0..design.rows(), c);
        }
        let fit = lstsq(&Matrix::from_columns(&columns).unwrap(), &design.target()).unwrap();
        assert!(
            fit.dependent.is_empty(),
            "{:?}",
            fit.dependent.iter().map(|&j| dictionary.text(j)).collect::<Vec<_>>()
        );
        assert!(!dictionary.dropped().is_empty());
    }
}

#[test]
fn bad_specifications_are_refused() {
    let s = Signals::siso;
    let cases = [
        Spec::new(s()).lags(Signal::Output, [0]),
        Spec::new(s()).lags(Signal::Input(1), [1]),
        Spec::narx(s(), 2, 0..=2, 0),
        Spec::narx(s(), 2, 0..=2, 10),
        Spec::narx(s(), 1, 1..=999_999_999, 1).lags(U, [1]),
        Spec::narx(s(), 100, 1..=100, 3),
        Spec::new(s()).constant(Constant::Omitted),
    ];
    for (i, spec) in cases.into_iter().enumerate() {
        assert!(spec.build().is_err(), "case {i}");
    }
}

#[test]
fn bad_records_are_refused() {
    let dictionary = Spec::narx(Signals::siso(), 3, 0..=3, 2).build().unwrap();
    let (long, short) = ([1.0; 20], [1.0; 3]);
    assert!(matches!(Design::new(&dictionary, &[Record::siso(&short, &long)]), Err(DictionaryError::BadRecord { .. })));
    assert!(matches!(Design::new(&dictionary, &[Record::new(&long, vec![])]), Err(DictionaryError::BadRecord { .. })));
    let message = Design::new(&dictionary, &[Record::siso(&short, &short)]).unwrap_err().to_string();
    assert!(message.contains("3 samples") && message.contains("lag is 3"), "{message}");
}
