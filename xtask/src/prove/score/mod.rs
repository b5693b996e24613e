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

use self::breakdown::{cell, competitors, confusion};
use self::line::{beside, figure, plain, share, told};
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
    /// Per difficulty: cases, detected, family right, mechanism right, slot right, median after/before, median after/oracle.
    pub cells: Vec<(f64, usize, [usize; 4], f64, f64)>,
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

/// The lines of the false alarms, in all and under each kind of noise, from every control's noise and whether there was an alarm.
pub fn false_alarms(controls: &[(Noise, bool)]) -> Vec<Line> {
    let line = |what: &str, target: &str, limit: f64, of: &dyn Fn(Noise) -> bool| {
        let list: Vec<bool> = controls.iter().filter(|c| of(c.0)).map(|c| c.1).collect();
        share(what, target, list.iter().filter(|a| **a).count(), list.len(), limit, true, true)
    };
    let mut lines = vec![line("False alarms on controls", "<= 1.5 %", 0.015, &|_| true)];
    for kind in Noise::ALL {
        let what = format!("- under {} noise", kind.name().replace('_', " "));
        lines.push(line(&what, "<= 3 %", 0.03, &|noise| noise == kind));
    }
    lines
}

/// Scores the rows.
pub fn score(rows: &[Row]) -> Score {
    let count = |list: &[&Row], test: &dyn Fn(&Row) -> bool| list.iter().filter(|r| test(r)).count();
    let of = |test: &dyn Fn(&Row) -> bool| -> Vec<&Row> { rows.iter().filter(|r| test(r)).collect() };
    let alarmed = |r: &Row| r.verdict().is_some_and(Verdict::alarmed);
    let controls = of(&|r| r.label.group == Group::Control);
    let singles = of(&|r| r.label.group == Group::Single);
    let known = of(&|r| r.in_catalogue() && r.label.group != Group::Control);
    let strong: Vec<&Row> = singles.iter().copied().filter(|r| r.label.dnr > 0.4).collect();
    let weak: Vec<&Row> = singles.iter().copied().filter(|r| r.label.dnr < 0.4).collect();

    let heard: Vec<(Noise, bool)> = controls.iter().map(|r| (r.label.noise, alarmed(r))).collect();
    let mut lines = false_alarms(&heard);
    let firm_wrong: Vec<String> = rows.iter().filter_map(firm_and_wrong).collect();
    lines.push(share("Firm and wrong, of all cases", "<= 2 %", firm_wrong.len(), rows.len(), 0.02, true, true));
    lines.push(share(
        "Family right, DNR >= 0.5",
        ">= 97 %",
        count(&strong, &Row::families_right),
        strong.len(),
        0.97,
        false,
        true,
    ));
    lines.push(share(
        "Family right, DNR 0.1-0.2",
        ">= 90 %",
        count(&weak, &Row::families_right),
        weak.len(),
        0.90,
        false,
        true,
    ));
    let over: Vec<f64> = known.iter().copied().map(over_oracle).collect();
    lines.push(figure("Held-out error after / oracle, median", "<= 1.05", &over, 0.5, 1.05, true));
    lines.push(figure("Held-out error after / oracle, 90th percentile", "<= 1.3", &over, 0.9, 1.3, true));
    let worse = |r: &Row| r.after() > 1.02 * r.rivals.before + 1e-3;
    lines.push(share(
        "Held-out error made worse",
        "<= 1 %",
        count(&of(&|_| true), &worse),
        rows.len(),
        0.01,
        true,
        true,
    ));

    lines.push(share(
        "Mechanism right, DNR >= 0.5",
        ">= 90 %",
        count(&strong, &Row::mechanisms_right),
        strong.len(),
        0.90,
        false,
        false,
    ));
    lines.push(share(
        "Mechanism right, DNR 0.1-0.2",
        ">= 75 %",
        count(&weak, &Row::mechanisms_right),
        weak.len(),
        0.75,
        false,
        false,
    ));
    lines.push(share(
        "Slot right, DNR >= 0.5",
        ">= 95 %",
        count(&strong, &Row::slots_right),
        strong.len(),
        0.95,
        false,
        false,
    ));
    lines.push(share(
        "Slot right, DNR 0.1-0.2",
        ">= 90 %",
        count(&weak, &Row::slots_right),
        weak.len(),
        0.90,
        false,
        false,
    ));

    let statements = statements(rows);
    let firm: Vec<&Statement> = statements.iter().filter(|s| s.probability >= 0.9).collect();
    let firm_family: Vec<&Statement> = statements.iter().filter(|s| s.family_probability >= 0.9).collect();
    lines.push(share(
        "Firm mechanisms right",
        ">= 95 %",
        firm.iter().filter(|s| s.right).count(),
        firm.len(),
        0.95,
        false,
        false,
    ));
    let right = firm_family.iter().filter(|s| s.family_right).count();
    lines.push(share("Firm families right", ">= 99 %", right, firm_family.len(), 0.99, false, false));
    let pairs_of: Vec<(f64, bool)> = statements.iter().map(|s| (s.probability, s.right)).collect();
    let (ece, bins) = calibration(&pairs_of);
    lines.push(plain("Expected calibration error (mechanisms)", "<= 0.05", ece, pairs_of.len(), 0.05));
    let chance = calibration_by_chance(&pairs_of);
    lines.push(beside("- of as many that are right as often as they say, by chance", chance, pairs_of.len()));

    let seen = of(&|r| r.label.group != Group::Control && r.information() >= 100.0);
    lines.push(share("Detected, N DNR^2 >= 100", ">= 95 %", count(&seen, &alarmed), seen.len(), 0.95, false, false));
    let hardly = of(&|r| r.label.group != Group::Control && r.information() < 60.0);
    lines.push(share("Detected, N DNR^2 25-60", ">= 85 %", count(&hardly, &alarmed), hardly.len(), 0.85, false, false));

    for (what, target, low, high, limit) in [
        ("Held-out error after / before, DNR 3, median", "<= 0.03", 2.0, f64::INFINITY, 0.03),
        ("Held-out error after / before, DNR 0.5, median", "<= 0.10", 0.4, 0.7, 0.10),
        ("Held-out error after / before, DNR 0.1-0.2, median", "<= 0.35", 0.0, 0.4, 0.35),
    ] {
        let list: Vec<f64> = singles
            .iter()
            .filter(|r| r.label.dnr >= low && r.label.dnr < high)
            .map(|r| r.after() / r.rivals.before)
            .collect();
        lines.push(figure(what, target, &list, 0.5, limit, false));
    }

    let pairs = of(&|r| r.label.group == Group::Pair);
    lines.push(share(
        "Pairs: all families right",
        ">= 85 %",
        count(&pairs, &Row::families_right),
        pairs.len(),
        0.85,
        false,
        false,
    ));
    lines.push(share(
        "Pairs: classes right",
        ">= 75 %",
        count(&pairs, &Row::classes_right),
        pairs.len(),
        0.75,
        false,
        false,
    ));
    let triples = of(&|r| r.label.group == Group::Triple);
    lines.push(told("Triples: all families right", count(&triples, &Row::families_right), triples.len()));

    let unknown = |r: &Row| r.verdict().is_some_and(|v| v.kind == "not_in_catalogue");
    let strange = of(&|r| {
        r.label.group == Group::Outside
            && r.rivals.separation.is_some_and(|s| s >= 25.0)
            && r.label.effects.iter().all(|e| e.same.is_empty())
    });
    lines.push(share(
        "Outside the catalogue, separable: said so",
        ">= 75 %",
        count(&strange, &unknown),
        strange.len(),
        0.75,
        false,
        false,
    ));
    let inside = of(&|r| r.in_catalogue());
    lines.push(share("False claims of it", "<= 2 %", count(&inside, &unknown), inside.len(), 0.02, true, false));

    let jumps: Vec<(f64, f64)> = singles.iter().filter_map(|r| jump(r)).collect();
    let near = jumps.iter().filter(|j| j.0 <= 0.01).count();
    lines.push(share(
        "Abrupt change named: time within 1 % of the record",
        ">= 95 %",
        near,
        jumps.len(),
        0.95,
        false,
        false,
    ));
    let overlap: Vec<f64> = jumps.iter().map(|j| -j.1).collect();
    let mut line =
        figure("Abrupt change named: overlap of the time region, median", ">= 0.6", &overlap, 0.5, -0.6, false);
    (line.value, line.interval) = (-line.value, (-line.interval.1, -line.interval.0));
    lines.push(line);

    let parameters: Vec<_> = known.iter().flat_map(|r| shared(r).into_iter().map(|p| (p, r.label.dnr))).collect();
    let middle: Vec<f64> =
        parameters.iter().filter(|(_, dnr)| (0.4..0.7).contains(dnr)).map(|(p, _)| p.error()).collect();
    lines.push(figure("Parameters: median relative error at DNR 0.5", "<= 5 %", &middle, 0.5, 0.05, false));
    let covered = parameters.iter().filter(|(p, _)| p.is_covered()).count();
    let mut line =
        share("Parameters: 95 % intervals cover", "90 to 97 %", covered, parameters.len(), 0.90, false, false);
    if line.value > 0.97 {
        line.standing = Standing::Missed;
    }
    lines.push(line);

    let settled: Vec<Settled> = rows.iter().filter_map(|r| r.settled).collect();
    let hits = settled.iter().filter(|s| s.proposed).count();
    lines.push(share(
        "Proposed experiment (separation >= 25) settles the tie",
        ">= 80 %",
        hits,
        settled.len(),
        0.80,
        false,
        false,
    ));
    let by_chance = settled.iter().filter(|s| s.random).count();
    lines.push(told("- an input drawn at random, of the same length and level", by_chance, settled.len()));
    let louder: Vec<bool> =
        known.iter().filter_map(|r| Some(r.trial.after_louder? <= 0.5 * r.rivals.best_black_box_louder()?)).collect();
    let hits = louder.iter().filter(|s| **s).count();
    lines.push(share(
        "At 1.5 times the amplitude: error at most half of the best black box's",
        ">= 80 %",
        hits,
        louder.len(),
        0.80,
        false,
        false,
    ));

    let cells = CELLS.iter().map(|&dnr| cell(&singles, dnr)).collect();
    Score {
        lines,
        confusion: confusion(rows),
        firm_wrong,
        cells,
        bins,
        competitors: competitors(&known),
        broken: rows
            .iter()
            .filter_map(|r| r.trial.verdict.as_ref().err().map(|e| format!("{}: {e}", r.label.id)))
            .collect(),
        seconds: rows.iter().map(|r| r.trial.seconds).collect(),
    }
}
