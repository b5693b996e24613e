//! From trials to the table of targets.

mod breakdown;
mod line;
mod numbers;
mod row;
mod statements;
#[cfg(test)]
mod tests;

pub use line::{Line, Standing};
pub use row::Row;
pub use statements::{Statement, statements};

use std::collections::BTreeMap;

use hysid_concealed::case::Group;
use hysid_concealed::noise::Noise;

pub use self::breakdown::Cell;
use self::breakdown::{competitors, confusion, nearest, within};
use self::line::Target::{self, AtLeast, AtMost, Within};
use self::numbers::jump;
pub use self::numbers::shared;
use self::row::over_oracle;
use self::statements::firm_and_wrong;
use super::experiment::Settled;
use super::stats::{Bin, calibration, calibration_by_chance};
use super::verdict::Verdict;

/// The whole score.
#[derive(Debug)]
pub struct Score {
    /// Lines of the target table.
    pub lines: Vec<Line>,
    /// Counts of (true family, stated family) over single effects and controls.
    pub confusion: BTreeMap<(String, String), usize>,
    /// Statements with probability 0.9 or more that are wrong.
    pub firm_wrong: Vec<String>,
    /// Single effects by difficulty.
    pub cells: Vec<Cell>,
    /// Single effects by what could be seen of them at most: from so many nats on to the next.
    pub seen: Vec<Cell>,
    /// Reliability diagram of the mechanisms' probabilities.
    pub bins: Vec<Bin>,
    /// Median held-out error of each competitor over that of the recalibrated baseline, by difficulty.
    pub competitors: Vec<(String, Vec<f64>)>,
    /// Cases that did not end in a verdict.
    pub broken: Vec<String>,
    /// Wall seconds of each case.
    pub seconds: Vec<f64>,
}

/// The difficulties of the table.
pub const CELLS: [f64; 5] = [0.1, 0.2, 0.5, 1.0, 3.0];
/// Where the classes of what could be seen begin, in nats.
const SEEN: [f64; 5] = [0.0, 10.0, 20.0, 40.0, 100.0];

/// How many of some things pass a test, and how many there are.
fn hits<T>(list: &[T], test: impl Fn(&T) -> bool) -> (usize, usize) {
    (list.iter().filter(|x| test(x)).count(), list.len())
}

/// The lines of the false alarms, in all and under each kind of noise, from every control's noise and whether there was an alarm.
pub fn false_alarms(controls: &[(Noise, bool)]) -> Vec<Line> {
    let line = |what: &str, limit: f64, of: &dyn Fn(Noise) -> bool| {
        let list: Vec<bool> = controls.iter().filter(|c| of(c.0)).map(|c| c.1).collect();
        Line::share(what, hits(&list, |alarm| *alarm), AtMost(limit)).gate()
    };
    let mut lines = vec![line("False alarms on controls", 0.015, &|_| true)];
    for kind in Noise::ALL {
        let what = format!("- under {} noise", kind.name().replace('_', " "));
        lines.push(line(&what, 0.03, &|noise| noise == kind));
    }
    lines
}

/// The rows by what they are.
struct Rows<'r> {
    all: &'r [Row],
    controls: Vec<&'r Row>,
    /// One effect of the catalogue.
    singles: Vec<&'r Row>,
    /// The same at a difficulty of 0.5 and above, and at 0.1 and 0.2.
    strong: Vec<&'r Row>,
    weak: Vec<&'r Row>,
    /// One effect of the catalogue and more.
    known: Vec<&'r Row>,
}

impl<'r> Rows<'r> {
    fn new(all: &'r [Row]) -> Self {
        let of = |test: &dyn Fn(&Row) -> bool| -> Vec<&'r Row> { all.iter().filter(|r| test(r)).collect() };
        let single = |r: &Row| r.label.group == Group::Single;
        Self {
            all,
            controls: of(&|r| r.label.group == Group::Control),
            singles: of(&single),
            strong: of(&|r| single(r) && r.label.dnr > 0.4),
            weak: of(&|r| single(r) && r.label.dnr < 0.4),
            known: of(&|r| r.in_catalogue() && r.label.group != Group::Control),
        }
    }

    fn of(&self, test: impl Fn(&Row) -> bool) -> Vec<&'r Row> {
        self.all.iter().filter(|r| test(r)).collect()
    }
}

fn alarmed(r: &Row) -> bool {
    r.verdict().is_some_and(Verdict::alarmed)
}

/// The lines that pass or fail.
fn gates(rows: &Rows<'_>, firm_wrong: usize) -> Vec<Line> {
    let heard: Vec<(Noise, bool)> = rows.controls.iter().map(|r| (r.label.noise, alarmed(r))).collect();
    let over: Vec<f64> = rows.known.iter().copied().map(over_oracle).collect();
    let worse = |r: &Row| r.after() > 1.02 * r.rivals.before + 1e-3;
    let family = |list: &[&Row]| hits(list, |r| r.families_right());
    let mut lines = false_alarms(&heard);
    let others = [
        Line::share("Firm and wrong, of all cases", (firm_wrong, rows.all.len()), AtMost(0.02)),
        Line::share("Family right, DNR >= 0.5", family(&rows.strong), AtLeast(0.97)),
        Line::share("Family right, DNR 0.1-0.2", family(&rows.weak), AtLeast(0.9)),
        Line::figure("Held-out error after / oracle, median", &over, 0.5, AtMost(1.05)),
        Line::figure("Held-out error after / oracle, 90th percentile", &over, 0.9, AtMost(1.3)),
        Line::share("Held-out error made worse", hits(rows.all, worse), AtMost(0.01)),
    ];
    lines.extend(others.map(Line::gate));
    lines
}

/// Mechanism and slot of single effects.
fn singles(rows: &Rows<'_>) -> [Line; 4] {
    let mechanism = |list: &[&Row]| hits(list, |r| r.mechanisms_right());
    let slot = |list: &[&Row]| hits(list, |r| r.slots_right());
    [
        Line::share("Mechanism right, DNR >= 0.5", mechanism(&rows.strong), AtLeast(0.9)),
        Line::share("Mechanism right, DNR 0.1-0.2", mechanism(&rows.weak), AtLeast(0.75)),
        Line::share("Slot right, DNR >= 0.5", slot(&rows.strong), AtLeast(0.95)),
        Line::share("Slot right, DNR 0.1-0.2", slot(&rows.weak), AtLeast(0.9)),
    ]
}

/// What probabilities are worth, with the bins of their reliability.
fn probabilities(statements: &[Statement]) -> ([Line; 4], Vec<Bin>) {
    let firm: Vec<&Statement> = statements.iter().filter(|s| s.probability >= 0.9).collect();
    let firm_family: Vec<&Statement> = statements.iter().filter(|s| s.family_probability >= 0.9).collect();
    let pairs: Vec<(f64, bool)> = statements.iter().map(|s| (s.probability, s.right)).collect();
    let ((error, bins), chance) = (calibration(&pairs), calibration_by_chance(&pairs));
    let lines = [
        Line::share("Firm mechanisms right", hits(&firm, |s| s.right), AtLeast(0.95)),
        Line::share("Firm families right", hits(&firm_family, |s| s.family_right), AtLeast(0.99)),
        Line::plain("Expected calibration error (mechanisms)", error, pairs.len(), AtMost(0.05)),
        Line::plain("- of as many that are right as often as they say, by chance", chance, pairs.len(), Target::None),
    ];
    (lines, bins)
}

/// What was seen, and what it helped.
fn detection(rows: &Rows<'_>) -> Vec<Line> {
    let missing = |r: &Row| r.label.group != Group::Control;
    let seen = rows.of(|r| missing(r) && r.information() >= 100.0);
    let hardly = rows.of(|r| missing(r) && r.information() < 60.0);
    let mut lines = vec![
        Line::share("Detected, N DNR^2 >= 100", hits(&seen, |r| alarmed(r)), AtLeast(0.95)),
        Line::share("Detected, N DNR^2 25-60", hits(&hardly, |r| alarmed(r)), AtLeast(0.85)),
    ];
    for (at, low, high, limit) in
        [("DNR 3", 2.0, f64::INFINITY, 0.03), ("DNR 0.5", 0.4, 0.7, 0.1), ("DNR 0.1-0.2", 0.0, 0.4, 0.35)]
    {
        let there = rows.singles.iter().filter(|r| r.label.dnr >= low && r.label.dnr < high);
        let list: Vec<f64> = there.map(|r| r.after() / r.rivals.before).collect();
        lines.push(Line::figure(&format!("Held-out error after / before, {at}, median"), &list, 0.5, AtMost(limit)));
    }
    lines
}

/// Several effects, and laws outside the catalogue.
fn sets(rows: &Rows<'_>) -> [Line; 5] {
    let pairs = rows.of(|r| r.label.group == Group::Pair);
    let triples = rows.of(|r| r.label.group == Group::Triple);
    let unknown = |r: &&Row| r.verdict().is_some_and(|v| v.kind == "not_in_catalogue");
    let strange = rows.of(|r| {
        r.label.group == Group::Outside
            && r.rivals.separation.is_some_and(|s| s >= 25.0)
            && r.label.effects.iter().all(|e| e.same.is_empty())
    });
    let inside = rows.of(Row::in_catalogue);
    let families = |list: &[&Row]| hits(list, |r| r.families_right());
    [
        Line::share("Pairs: all families right", families(&pairs), AtLeast(0.85)),
        Line::share("Pairs: classes right", hits(&pairs, |r| r.classes_right()), AtLeast(0.75)),
        Line::share("Triples: all families right", families(&triples), Target::None),
        Line::share("Outside the catalogue, separable: said so", hits(&strange, unknown), AtLeast(0.75)),
        Line::share("False claims of it", hits(&inside, unknown), AtMost(0.02)),
    ]
}

/// The numbers that are told of an effect.
fn told(rows: &Rows<'_>) -> [Line; 4] {
    let jumps: Vec<(f64, f64)> = rows.singles.iter().filter_map(|r| jump(r)).collect();
    let overlap: Vec<f64> = jumps.iter().map(|j| j.1).collect();
    let parameters: Vec<_> = rows.known.iter().flat_map(|r| shared(r).into_iter().map(|p| (p, r.label.dnr))).collect();
    let middle = parameters.iter().filter(|(_, dnr)| (0.4..0.7).contains(dnr));
    let errors: Vec<f64> = middle.map(|(p, _)| p.error()).collect();
    let covered = hits(&parameters, |(p, _)| p.is_covered());
    let in_time = hits(&jumps, |j| j.0 <= 0.01);
    [
        Line::share("Abrupt change named: time within 1 % of the record", in_time, AtLeast(0.95)),
        Line::figure("Abrupt change named: overlap of the time region, median", &overlap, 0.5, AtLeast(0.6)),
        Line::figure("Parameters: median relative error at DNR 0.5", &errors, 0.5, AtMost(0.05)),
        Line::share("Parameters: 95 % intervals cover", covered, Within(0.9, 0.97)),
    ]
}

/// What a further experiment tells, and other inputs than the recorded ones.
fn elsewhere(rows: &Rows<'_>) -> [Line; 3] {
    let settled: Vec<Settled> = rows.all.iter().filter_map(|r| r.settled).collect();
    let better =
        |r: &&Row| Some(r.trial.after_louder? <= 0.5 * r.rivals.competitors.as_ref()?.best_black_box_louder()?);
    let louder: Vec<bool> = rows.known.iter().filter_map(better).collect();
    let proposed = "Proposed experiment (separation >= 25) settles the tie";
    let by_chance = "- an input drawn at random, of the same length and level";
    let amplitude = "At 1.5 times the amplitude: error at most half of the best black box's";
    [
        Line::share(proposed, hits(&settled, |s| s.proposed), AtLeast(0.8)),
        Line::share(by_chance, hits(&settled, |s| s.random), Target::None),
        Line::share(amplitude, hits(&louder, |half| *half), AtLeast(0.8)),
    ]
}

/// Scores the rows.
pub fn score(rows: &[Row]) -> Score {
    let all = Rows::new(rows);
    let firm_wrong: Vec<String> = rows.iter().filter_map(firm_and_wrong).collect();
    let (probabilities, bins) = probabilities(&statements(rows));
    let mut lines = gates(&all, firm_wrong.len());
    lines.extend(singles(&all));
    lines.extend(probabilities);
    lines.extend(detection(&all));
    lines.extend(sets(&all));
    lines.extend(told(&all));
    lines.extend(elsewhere(&all));
    let broken = |r: &Row| r.trial.verdict.as_ref().err().map(|e| format!("{}: {e}", r.label.id));
    Score {
        lines,
        confusion: confusion(rows),
        firm_wrong,
        cells: CELLS.iter().map(|&dnr| nearest(&all.singles, dnr)).collect(),
        seen: SEEN
            .iter()
            .zip(SEEN[1..].iter().chain([&f64::INFINITY]))
            .map(|(from, to)| within(&all.singles, *from, *to))
            .collect(),
        bins,
        competitors: competitors(&all.known),
        broken: rows.iter().filter_map(broken).collect(),
        seconds: rows.iter().map(|r| r.trial.seconds).collect(),
    }
}
