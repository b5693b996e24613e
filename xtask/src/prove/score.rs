//! From trials to the table of targets.

use std::collections::BTreeMap;

use hysid_concealed::case::{Case, Concealed, Group, Label};
use hysid_concealed::noise::Noise;

use super::rivals::Rivals;
use super::stats::{Bin, calibration, quantile, quantile_interval, wilson};
use super::trial::Trial;
use super::verdict::{Stated, Verdict};

/// One scored case.
#[derive(Debug)]
pub struct Row {
    /// Label.
    pub label: Label,
    /// What the program said.
    pub trial: Trial,
    /// Competitors.
    pub rivals: Rivals,
    /// Whether the proposed experiment settled the tie, where one was proposed with enough separation.
    pub settled: Option<bool>,
}

/// How a line compares with its target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    /// Met.
    Met,
    /// Missed.
    Missed,
    /// Too few cases to say.
    Open,
}

/// One line of the table.
#[derive(Debug, Clone)]
pub struct Line {
    /// What is measured.
    pub what: String,
    /// The target in words.
    pub target: String,
    /// The figure.
    pub value: f64,
    /// Its 95 % interval.
    pub interval: (f64, f64),
    /// Number of cases or statements.
    pub n: usize,
    /// Comparison.
    pub standing: Standing,
    /// Whether it is one of the first five.
    pub gate: bool,
    /// Whether the figure is a share (printed in percent).
    pub share: bool,
}

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

impl Row {
    /// A row from its parts.
    pub fn new(case: &Case, trial: Trial, rivals: Rivals) -> Self {
        Self { label: case.label.clone(), trial, rivals, settled: None }
    }

    /// The verdict, where there is one.
    pub fn verdict(&self) -> Option<&Verdict> {
        self.trial.verdict.as_ref().ok()
    }

    /// The best guess.
    pub fn guess(&self) -> Vec<Stated> {
        self.verdict().map(Verdict::guess).unwrap_or_default()
    }

    /// Whether the families guessed are the true ones, none more and none less.
    pub fn families_right(&self) -> bool {
        let guess = self.guess();
        guess.len() == self.label.effects.len()
            && self.label.effects.iter().all(|e| guess.iter().any(|g| family_fits(e, g)))
            && guess.iter().all(|g| self.label.effects.iter().any(|e| family_fits(e, g)))
    }

    /// Whether the mechanisms guessed are the true ones.
    pub fn mechanisms_right(&self) -> bool {
        let guess = self.guess();
        guess.len() == self.label.effects.len()
            && self.label.effects.iter().all(|e| guess.iter().any(|g| mechanism_fits(e, g)))
    }

    /// Whether every true mechanism is guessed or is a rival that this record cannot separate from the guess.
    fn classes_right(&self) -> bool {
        let guess = self.guess();
        let tied = |e: &Concealed| {
            self.verdict().is_some_and(|v| {
                v.alternatives.iter().any(|a| is(e, &a.mechanism) && a.separation.is_some_and(|s| s < 9.0))
            })
        };
        self.families_right()
            && self.label.effects.iter().all(|e| guess.iter().any(|g| mechanism_fits(e, g)) || tied(e))
    }

    fn slots_right(&self) -> bool {
        let guess = self.guess();
        guess.len() == self.label.effects.len()
            && self.label.effects.iter().all(|e| guess.iter().any(|g| e.slots.contains(&g.slot)))
    }

    /// Held-out error of what the user ends up with: the augmented simulation, or the baseline where nothing was added.
    pub fn after(&self) -> f64 {
        self.trial.after.unwrap_or(self.rivals.before)
    }

    fn information(&self) -> f64 {
        self.label.samples as f64 * self.label.dnr.powi(2)
    }

    fn in_catalogue(&self) -> bool {
        !matches!(self.label.group, Group::Outside)
    }
}

/// Held-out error over the oracle's; both count as a hundredth of the noise at least.
fn over_oracle(r: &Row) -> f64 {
    r.after().max(0.01) / r.rivals.oracle.max(0.01)
}

fn is(e: &Concealed, mechanism: &str) -> bool {
    e.mechanism == mechanism || e.same.iter().any(|s| s.0 == mechanism)
}

fn mechanism_fits(e: &Concealed, g: &Stated) -> bool {
    is(e, &g.mechanism)
}

fn family_fits(e: &Concealed, g: &Stated) -> bool {
    e.family == g.family || e.same.iter().any(|s| s.1 == g.family)
}

fn share(what: &str, target: &str, hits: usize, n: usize, limit: f64, most: bool, gate: bool) -> Line {
    let value = if n == 0 { f64::NAN } else { hits as f64 / n as f64 };
    let standing = match n {
        0 => Standing::Open,
        _ if (most && value <= limit) || (!most && value >= limit) => Standing::Met,
        _ => Standing::Missed,
    };
    Line { what: what.into(), target: target.into(), value, interval: wilson(hits, n), n, standing, gate, share: true }
}

fn figure(what: &str, target: &str, values: &[f64], q: f64, limit: f64, gate: bool) -> Line {
    let value = quantile(values, q);
    let standing = match values.len() {
        0 => Standing::Open,
        _ if value <= limit => Standing::Met,
        _ => Standing::Missed,
    };
    Line {
        what: what.into(),
        target: target.into(),
        value,
        interval: quantile_interval(values, q),
        n: values.len(),
        standing,
        gate,
        share: false,
    }
}

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

    let parameters: Vec<(f64, bool, f64)> = known.iter().flat_map(|r| parameters(r)).collect();
    let middle: Vec<f64> = parameters.iter().filter(|p| (0.4..0.7).contains(&p.2)).map(|p| p.0).collect();
    lines.push(figure("Parameters: median relative error at DNR 0.5", "<= 5 %", &middle, 0.5, 0.05, false));
    let covered = parameters.iter().filter(|p| p.1).count();
    let mut line =
        share("Parameters: 95 % intervals cover", "90 to 97 %", covered, parameters.len(), 0.90, false, false);
    if line.value > 0.97 {
        line.standing = Standing::Missed;
    }
    lines.push(line);

    let settled: Vec<bool> = rows.iter().filter_map(|r| r.settled).collect();
    let hits = settled.iter().filter(|s| **s).count();
    lines.push(share(
        "Proposed experiment (separation >= 25) settles the tie",
        ">= 80 %",
        hits,
        settled.len(),
        0.80,
        false,
        false,
    ));
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

fn plain(what: &str, target: &str, value: f64, n: usize, limit: f64) -> Line {
    let standing = if n == 0 {
        Standing::Open
    } else if value <= limit {
        Standing::Met
    } else {
        Standing::Missed
    };
    Line {
        what: what.into(),
        target: target.into(),
        value,
        interval: (f64::NAN, f64::NAN),
        n,
        standing,
        gate: false,
        share: false,
    }
}

fn told(what: &str, hits: usize, n: usize) -> Line {
    let mut line = share(what, "-", hits, n, 0.0, false, false);
    line.standing = Standing::Open;
    line
}

/// A statement of an effect with its probabilities.
struct Statement {
    probability: f64,
    family_probability: f64,
    right: bool,
    family_right: bool,
}

fn statements(rows: &[Row]) -> Vec<Statement> {
    let mut list = Vec::new();
    for r in rows {
        let Some(v) = r.verdict().filter(|v| v.alarmed()) else { continue };
        for s in &v.effects {
            list.push(Statement {
                probability: s.probability,
                family_probability: s.family_probability,
                right: r.label.effects.iter().any(|e| mechanism_fits(e, s)),
                family_right: r.label.effects.iter().any(|e| family_fits(e, s)),
            });
        }
    }
    list
}

/// A sentence where a case has a firm statement that is wrong.
fn firm_and_wrong(r: &Row) -> Option<String> {
    let v = r.verdict().filter(|v| v.alarmed())?;
    let wrong: Vec<String> = v
        .effects
        .iter()
        .filter(|s| {
            let mechanism = s.probability >= 0.9 && !r.label.effects.iter().any(|e| mechanism_fits(e, s));
            let family = s.family_probability >= 0.9 && !r.label.effects.iter().any(|e| family_fits(e, s));
            mechanism || family
        })
        .map(|s| {
            if s.probability >= 0.9 {
                format!("{} ({:.2})", s.mechanism, s.probability)
            } else {
                format!("family {} ({:.2})", s.family, s.family_probability)
            }
        })
        .collect();
    let truth: Vec<&str> = r.label.effects.iter().map(|e| e.mechanism).collect();
    (!wrong.is_empty()).then(|| {
        format!(
            "{}: said {}; true: {} on {:?}, DNR {:.2}, {} samples, {} noise",
            r.label.id,
            wrong.join(", "),
            if truth.is_empty() { "nothing".into() } else { truth.join(" + ") },
            r.label.plant,
            r.label.dnr,
            r.label.samples,
            r.label.noise.name()
        )
    })
}

/// Error of the time of an abrupt change over the record's length, and overlap of the region stated.
fn jump(r: &Row) -> Option<(f64, f64)> {
    let e = r.label.effects.first().filter(|e| e.mechanism == "abrupt_change")?;
    let v = r.verdict()?;
    let s = v.effects.iter().find(|s| s.mechanism == "abrupt_change")?;
    let truth = e.parameters.iter().find(|p| p.0 == "t_0")?.1;
    let found = s.parameters.iter().find(|p| p.0 == "t_0")?.1;
    let length = r.label.samples as f64 * r.label.period;
    let inside: f64 = v.time_s.iter().map(|i| (i[1].min(length) - i[0].max(truth)).max(0.0)).sum();
    let stated: f64 = v.time_s.iter().map(|i| (i[1] - i[0]).max(0.0)).sum();
    let overlap = if stated > 0.0 { inside / (stated + (length - truth) - inside) } else { 0.0 };
    Some(((found - truth).abs() / length, overlap))
}

/// Names of a parameter in the bank and in a diagnosis, where both mean the same number; compared by size, since conventions of sign differ.
const SAME_NUMBER: &[(&str, &str, &str)] = &[
    ("coulomb_friction", "F_c", "F_c"),
    ("load_dependent_friction", "mu", "mu"),
    ("dahl_friction", "F_c", "F_c"),
    ("dahl_friction", "z_s", "z_s"),
    ("elastoplastic_friction", "F_c", "F_c"),
    ("quadratic_damping", "c_2", "c_2"),
    ("displacement_dependent_damping", "c_x", "c_x"),
    ("cubic_stiffness", "k_3", "k_3"),
    ("quintic_stiffness", "k_5", "k_5"),
    ("gap_stop", "k_g", "k_g"),
    ("gap_stop", "g", "g"),
    ("quadratic_stiffness", "k_2", "k_2"),
    ("bilinear_stiffness", "k_d", "k_b"),
    ("spring_clearance", "g", "g"),
    ("bouc_wen", "F_z", "F_h"),
    ("backlash", "r", "r"),
    ("dead_zone", "d", "d_z"),
    ("input_saturation", "limit", "s"),
    ("output_saturation", "limit", "s"),
    ("input_polynomial", "b_2", "b_2"),
    ("input_polynomial", "b_3", "b_3"),
    ("delay", "tau", "tau"),
    ("actuator_lag", "tau", "tau"),
    ("sensor_lag", "tau", "tau"),
    ("parameter_drift", "delta", "epsilon"),
    ("abrupt_change", "delta", "delta"),
    ("unmodelled_mode", "m_a", "m_a"),
    ("unmodelled_mode", "f_a", "f_a"),
    ("input_offset", "u_0", "u_0"),
    ("output_offset", "y_0", "y_0"),
    ("gravity", "mgl", "G"),
    ("cogging", "A", "A"),
    ("cogging", "period", "p_x"),
    ("position_dependent_inertia", "m_1", "m_1"),
    ("viscoelastic", "k_m", "k_m"),
    ("viscoelastic", "tau", "tau_m"),
    ("quantisation", "lsb", "q"),
    ("sensor_drift", "rate", "d_1"),
    ("back_emf", "c_e", "k_e"),
    ("back_emf", "tau_e", "tau_e"),
    ("leakage", "c_l", "c_l"),
    ("overflow", "c_o", "c_o"),
    ("periodic_disturbance", "A", "A"),
    ("periodic_disturbance", "f", "f_d"),
];

/// Relative error, coverage and difficulty of every number that truth and diagnosis share, where the mechanism was right.
fn parameters(r: &Row) -> Vec<(f64, bool, f64)> {
    let mut list = Vec::new();
    for e in &r.label.effects {
        let guess = r.guess();
        let Some(s) = guess.iter().find(|s| s.mechanism == e.mechanism && e.slots.first() == Some(&s.slot)) else {
            continue;
        };
        for (mechanism, ours, theirs) in SAME_NUMBER {
            let truth = e.parameters.iter().find(|p| p.0 == *ours).map(|p| p.1.abs());
            let found = s.parameters.iter().find(|p| p.0 == *theirs);
            if let (true, Some(truth), Some(&(_, value, low, high))) = (*mechanism == e.mechanism, truth, found) {
                if truth > 0.0 {
                    let (a, b) = if value < 0.0 { (-high, -low) } else { (low, high) };
                    list.push(((value.abs() / truth - 1.0).abs(), a <= truth && truth <= b, r.label.dnr));
                }
            }
        }
    }
    list
}

fn cell(singles: &[&Row], dnr: f64) -> (f64, usize, [usize; 4], f64, f64) {
    let list: Vec<&&Row> = singles
        .iter()
        .filter(|r| {
            let at =
                CELLS.iter().copied().min_by(|a, b| distance(*a, r.label.dnr).total_cmp(&distance(*b, r.label.dnr)));
            at == Some(dnr)
        })
        .collect();
    let count = |test: &dyn Fn(&Row) -> bool| list.iter().filter(|r| test(r)).count();
    let hits = [
        count(&|r| r.verdict().is_some_and(Verdict::alarmed)),
        count(&Row::families_right),
        count(&Row::mechanisms_right),
        count(&Row::slots_right),
    ];
    let fall: Vec<f64> = list.iter().map(|r| r.after() / r.rivals.before).collect();
    let over: Vec<f64> = list.iter().map(|r| over_oracle(r)).collect();
    (dnr, list.len(), hits, quantile(&fall, 0.5), quantile(&over, 0.5))
}

fn distance(a: f64, b: f64) -> f64 {
    (a.ln() - b.max(1e-9).ln()).abs()
}

fn confusion(rows: &[Row]) -> BTreeMap<(String, String), usize> {
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

/// Median error over that of the recalibrated baseline for each competitor and difficulty.
fn competitors(known: &[&Row]) -> Vec<(String, Vec<f64>)> {
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
        ("Linear black box".into(), medians(&|r| r.rivals.linear)),
        ("NARX (first output)".into(), medians(&|r| r.rivals.narx.0)),
        ("NARX on the residual (first output)".into(), medians(&|r| r.rivals.narx_on_residual.0)),
        ("SINDy-like discrepancy (one mass)".into(), medians(&|r| r.rivals.sindy.map_or(f64::NAN, |e| e.min(1e9)))),
        ("**hysid diagnose**".into(), medians(&Row::after)),
        ("Oracle: true structure, refitted".into(), medians(&|r| r.rivals.oracle)),
    ]
}

#[cfg(test)]
mod tests {
    use hysid_concealed::bank;
    use hysid_concealed::seed::Stream;

    use super::*;

    fn row(group: Group, diagnosis: &dyn Fn(&Label) -> String, after: Option<f64>) -> Row {
        let index = (0..100).find(|i| bank::plan(Stream::Development, 1, *i).group == group).unwrap();
        let case = bank::case(Stream::Development, 1, index);
        let verdict = Ok(Verdict::read(&diagnosis(&case.label)).unwrap());
        let trial = Trial { seconds: 1.0, verdict, after, after_louder: None };
        let rivals = Rivals {
            before: 1.0,
            oracle: 0.1,
            linear: 0.7,
            linear_louder: None,
            sindy: None,
            narx: (0.6, None),
            narx_on_residual: (0.6, None),
            separation: Some(100.0),
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
            let mechanism = if l.effects.iter().any(|e| e.family == "dry_friction") {
                "cubic_stiffness"
            } else {
                "coulomb_friction"
            };
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
}
