//! The score broken down: by difficulty, by true and stated family, and beside the competitors.

use std::collections::BTreeMap;

use hysid_concealed::case::Group;

use super::super::stats::quantile;
use super::super::verdict::Verdict;
use super::CELLS;
use super::row::{Row, family_fits, over_oracle};

/// What came of some cases.
#[derive(Debug, Clone)]
pub struct Cell {
    /// By which they were gathered.
    pub at: f64,
    /// How many they are.
    pub n: usize,
    /// How many were detected, and have the right family, mechanism, slot.
    pub hits: [usize; 4],
    /// Median held-out error after over that before.
    pub fall: f64,
    /// Median held-out error after over the oracle's.
    pub over_oracle: f64,
}

impl Cell {
    fn new(at: f64, list: &[&Row]) -> Self {
        let count = |test: &dyn Fn(&Row) -> bool| list.iter().filter(|r| test(r)).count();
        let hits = [
            count(&|r| r.verdict().is_some_and(Verdict::alarmed)),
            count(&Row::families_right),
            count(&Row::mechanisms_right),
            count(&Row::slots_right),
        ];
        let median = |of: &dyn Fn(&Row) -> f64| quantile(&list.iter().map(|r| of(r)).collect::<Vec<_>>(), 0.5);
        let (fall, over_oracle) = (median(&|r| r.after() / r.rivals.before), median(&|r| over_oracle(r)));
        Self { at, n: list.len(), hits, fall, over_oracle }
    }
}

/// The cases of which this is the nearest difficulty.
pub(super) fn nearest(singles: &[&Row], dnr: f64) -> Cell {
    let near = |r: &Row| {
        let by_distance = |a: &f64, b: &f64| distance(*a, r.label.dnr).total_cmp(&distance(*b, r.label.dnr));
        CELLS.iter().copied().min_by(by_distance) == Some(dnr)
    };
    Cell::new(dnr, &singles.iter().copied().filter(|r| near(r)).collect::<Vec<_>>())
}

/// The cases of which this many nats can be seen and fewer than the next class begins with.
pub(super) fn within(singles: &[&Row], from: f64, to: f64) -> Cell {
    let list = singles.iter().copied().filter(|r| (from..to).contains(&r.rivals.visible));
    Cell::new(from, &list.collect::<Vec<_>>())
}

fn distance(a: f64, b: f64) -> f64 {
    (a.ln() - b.max(1e-9).ln()).abs()
}

pub(super) fn confusion(rows: &[Row]) -> BTreeMap<(String, String), usize> {
    let mut table = BTreeMap::new();
    for r in rows.iter().filter(|r| matches!(r.label.group, Group::Single | Group::Control | Group::Outside)) {
        let truth = r.label.effects.first().map_or("nothing", |e| e.family);
        let said = match r.verdict() {
            None => "no verdict".to_string(),
            Some(v) if !v.alarmed() => "nothing".into(),
            Some(v) if v.kind == "not_in_catalogue" => "outside".into(),
            Some(v) => {
                let guess = v.guess();
                match guess.as_slice() {
                    [] => "no name".into(),
                    [one] => one.family.clone(),
                    more if r.label.effects.iter().any(|e| more.iter().any(|g| family_fits(e, g))) => {
                        "true one and more".into()
                    }
                    more => format!("{} and more", more[0].family),
                }
            }
        };
        *table.entry((truth.to_string(), said)).or_insert(0) += 1;
    }
    table
}

/// Median error over that of the recalibrated baseline for each competitor and difficulty; empty where no competitor was run.
pub(super) fn competitors(known: &[&Row]) -> Vec<(String, Vec<f64>)> {
    if known.iter().all(|r| r.rivals.competitors.is_none()) {
        return Vec::new();
    }
    let medians = |error: &dyn Fn(&Row) -> f64| -> Vec<f64> {
        [(0.0, 0.4), (0.4, 0.7), (0.7, 2.0), (2.0, f64::INFINITY)]
            .iter()
            .map(|(low, high)| {
                let list: Vec<f64> = known
                    .iter()
                    .filter(|r| r.label.dnr >= *low && r.label.dnr < *high)
                    .map(|r| error(r) / r.rivals.before)
                    .collect();
                quantile(&list, 0.5)
            })
            .collect()
    };
    vec![
        ("Recalibration only".into(), medians(&|r| r.rivals.before)),
        ("Linear black box".into(), medians(&|r| r.rivals.competitor(|c| c.linear))),
        ("NARX (first output)".into(), medians(&|r| r.rivals.competitor(|c| c.narx.0))),
        ("NARX on the residual (first output)".into(), medians(&|r| r.rivals.competitor(|c| c.narx_on_residual.0))),
        (
            "SINDy-like discrepancy (one mass)".into(),
            medians(&|r| r.rivals.competitor(|c| c.sindy.map_or(f64::NAN, |e| e.min(1e9)))),
        ),
        ("**hysid diagnose**".into(), medians(&Row::after)),
        ("Oracle: true structure, refitted".into(), medians(&|r| r.rivals.oracle)),
    ]
}
