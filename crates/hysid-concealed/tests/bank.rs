//! The bank: deterministic, difficulty as asked for, every file there.

use hysid_concealed::bank;
use hysid_concealed::case::Group;
use hysid_concealed::seed::Stream;
use hysid_concealed::strength::residual;

#[test]
fn cases_reach_their_difficulty_and_come_again() {
    let cases = bank::cases(Stream::Development, 7, 0..10, usize::MAX);
    let again = bank::case(Stream::Development, 7, 3);
    assert_eq!(cases[3].csv(&cases[3].est, &cases[3].est.y), again.csv(&again.est, &again.est.y));
    assert_eq!(cases[3].simulation, again.simulation);
    for case in &cases {
        let label = &case.label;
        // The difficulty, computed anew from the stored record with more rounds than the search took.
        let left =
            residual(&case.design, &case.machine.effects, &case.est.input, &case.est.clean, &label.sigma, 40).unwrap();
        if label.group == Group::Control {
            assert!(left.rms < 1e-3, "{}: a control leaves {}", label.id, left.rms);
        } else {
            assert!(
                (left.rms / label.dnr_asked - 1.0).abs() < 0.05,
                "{} asked {} has {}",
                label.id,
                label.dnr_asked,
                left.rms
            );
        }
    }
}

#[test]
fn a_bank_of_short_recordings_has_the_plan_of_the_whole() {
    for case in bank::cases(Stream::Development, 7, 0..8, 1000) {
        assert_eq!(case.label.samples, 1000, "{}", case.label.id);
        assert_eq!(case.label.group, bank::plan(Stream::Development, 7, case.label.id[5..].parse().unwrap()).group);
    }
}

#[test]
fn shares_hold_in_a_block() {
    let plans: Vec<_> = (0..100).map(|i| bank::plan(Stream::Reporting, 5, i)).collect();
    let count = |g| plans.iter().filter(|p| p.group == g).count();
    assert_eq!(
        [Group::Control, Group::Single, Group::Pair, Group::Triple, Group::Outside].map(count),
        [15, 47, 21, 4, 13]
    );
}
