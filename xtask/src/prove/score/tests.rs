//! Invented trials whose score is known.

use hysid_concealed::bank;
use hysid_concealed::case::Label;
use hysid_concealed::seed::Stream;

use super::super::rivals::Rivals;
use super::super::trial::Trial;
use super::super::verdict::Verdict;
use super::*;

fn row(group: Group, diagnosis: &dyn Fn(&Label) -> String, after: Option<f64>) -> Row {
    let index = (0..100).find(|i| bank::plan(Stream::Development, 1, *i).group == group).unwrap();
    let case = bank::case(Stream::Development, 1, index);
    let verdict = Ok(Verdict::read(&diagnosis(&case.label)).unwrap());
    let trial = Trial { seconds: 1.0, verdict, after, after_louder: None };
    let rivals = Rivals {
        before: 1.0,
        oracle: 0.1,
        oracle_complete: true,
        visible: 200.0,
        separation: Some(100.0),
        competitors: None,
    };
    Row::new(&case, trial, rivals)
}

fn named(mechanism: &str, family: &str, slot: &str, probability: f64) -> String {
    format!(
        r#"{{"verdict":"named","effects":[{{"mechanism":"{mechanism}","family":"{family}","slot":"{slot}","probability":{probability}}}]}}"#
    )
}

fn value(score: &Score, what: &str) -> f64 {
    score.lines.iter().find(|l| l.what == what).unwrap().value
}

#[test]
fn right_answers_score_full_marks() {
    let truth = |l: &Label| {
        let e = &l.effects[0];
        named(e.mechanism, e.family, &e.slots[0], 0.95)
    };
    let rows = vec![
        row(Group::Single, &truth, Some(0.1)),
        row(Group::Control, &|_| r#"{"verdict":"no_significant_mismatch"}"#.into(), None),
        row(Group::Outside, &|_| r#"{"verdict":"not_in_catalogue","effects":[]}"#.into(), Some(0.5)),
    ];
    let s = score(&rows);
    assert_eq!(value(&s, "False alarms on controls"), 0.0);
    assert_eq!(value(&s, "Firm and wrong, of all cases"), 0.0);
    assert_eq!(value(&s, "Firm mechanisms right"), 1.0);
    assert_eq!(value(&s, "Held-out error after / oracle, median"), 1.0);
    assert_eq!(value(&s, "Outside the catalogue, separable: said so"), 1.0);
    assert!((value(&s, "Expected calibration error (mechanisms)") - 0.05).abs() < 1e-12);
    assert!(rows[0].mechanisms_right() && rows[0].slots_right());
}

#[test]
fn wrong_answers_are_counted_where_they_belong() {
    // No case of the bank conceals both of these, so that one of the two is wrong everywhere.
    let wrong = |l: &Label| {
        let mechanism =
            if l.effects.iter().any(|e| e.family == "dry_friction") { "cubic_stiffness" } else { "coulomb_friction" };
        let family = if mechanism == "cubic_stiffness" { "hardening_stiffness" } else { "dry_friction" };
        named(mechanism, family, "state:v", 0.95)
    };
    let rows = vec![
        row(Group::Single, &wrong, Some(1.5)),
        row(Group::Control, &wrong, None),
        row(Group::Outside, &wrong, None),
        row(Group::Pair, &wrong, None),
    ];
    let s = score(&rows);
    assert_eq!(value(&s, "False alarms on controls"), 1.0);
    assert_eq!(s.firm_wrong.len(), 4);
    assert_eq!(value(&s, "Held-out error made worse"), 0.25);
    assert_eq!(value(&s, "Outside the catalogue, separable: said so"), 0.0);
    assert_eq!(value(&s, "Pairs: all families right"), 0.0);
}

#[test]
fn an_unsure_guess_is_not_firm() {
    let unsure = |_: &Label| {
        r#"{"verdict":"ambiguous","effects":[],"alternatives":[{"mechanism":"delay","family":"signal_path_lag","slot":"input:u","probability":0.5}]}"#.to_string()
    };
    let s = score(&[row(Group::Outside, &unsure, None)]);
    assert!(s.firm_wrong.is_empty());
    assert_eq!(value(&s, "Outside the catalogue, separable: said so"), 0.0);
}
