//! Terms as text, both ways.

use hysid_dictionary::{Factor, Quantity, Signal, Signals, Term};
use proptest::prelude::*;

fn two() -> Signals {
    Signals::from_columns("force_N", &["position_mm", "temperature_C"]).unwrap()
}

#[test]
fn texts_and_the_terms_they_say() {
    let cases = [
        ("1", "1"),
        ("y[n-1]^2*u1[n]", "y[n-1]^2*u1[n]"),
        (" u1[ n ] * y [n - 1] * y[n-1] ", "y[n-1]^2*u1[n]"),
        ("1*u2[k-3]", "u2[n-3]"),
        ("position_mm[n-2]", "u1[n-2]"),
        ("`position_mm`[n-2]*d`force_N`[n-1]", "dy[n-1]*u1[n-2]"),
        ("du1[n]*sgn(du1[n])", "du1[n]*sgn(du1[n])"),
        ("sgn(du1[n])^3", "sgn(du1[n])"),
        ("sgn(du1[n])^2", "1"),
        ("sgn(dposition_mm[t-1])", "sgn(du1[n-1])"),
    ];
    for (text, expected) in cases {
        let term = two().parse(text).unwrap_or_else(|e| panic!("{text}: {e}"));
        assert_eq!(two().format(&term), expected, "{text}");
    }
}

#[test]
fn bad_texts_are_refused_with_the_place() {
    let cases = [
        "",
        "y",
        "y[n]",
        "y[n-1]*",
        "x[n]",
        "u1[n+1]",
        "2*u1[n]",
        "u1[n]^0",
        "sgn(u1[n])",
        "u1[m]",
        "`y[n]",
        "u1[n-1",
        "u3[n]",
        "y[n-1]u1[n]",
        "u1[n-999999999]",
        "du1[n]^",
    ];
    for text in cases {
        assert!(two().parse(text).is_err(), "{text}");
    }
    let message = two().parse("y[n-1]*x[n]").unwrap_err().to_string();
    assert!(message.contains("no signal `x`") && message.contains("character 9"), "{message}");
}

#[test]
fn ambiguous_names_are_refused() {
    let cases: [(&str, &[&str]); 2] = [("a", &["a"]), ("a", &["b", "b"])];
    for (output, inputs) in cases {
        assert!(Signals::from_columns(output, inputs).is_err(), "{output} {inputs:?}");
    }
}

fn factor() -> impl Strategy<Value = Factor> {
    let signal = prop_oneof![Just(Signal::Output), Just(Signal::Input(0)), Just(Signal::Input(1))];
    (signal, 0usize..3, 1usize..5).prop_map(|(s, kind, lag)| {
        let quantity = [Quantity::Value(s), Quantity::Difference(s), Quantity::Sign(s)][kind];
        Factor { quantity, lag }
    })
}

proptest! {
    #[test]
    fn writing_and_reading_a_term_gives_it_back(factors in prop::collection::vec(factor(), 0..6)) {
        let term = Term::new(factors);
        prop_assert_eq!(two().parse(&two().format(&term)).unwrap(), term);
    }
}
