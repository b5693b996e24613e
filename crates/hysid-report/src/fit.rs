//! The report of an identified model: the equation, the length of the model, the free run beside the recording, the loop, the
//! residual tests, and what was decided and why.

use hysid::identify::{ErrorLine, FitReport, FitSummary, PathPoint, Role, Series};
use hysid_validate::{CorrelationTest, ResidualRecord, by_branch, residual_tests};

use crate::figure::{FigureError, LogAxes, Mark, Plot, Tone, envelope};
use crate::page::{Align, Page, Table, Tenor};
use crate::words::{Provenance, number, p_value, percent, sum};

/// Stretches that a long series is drawn with: about as many as the figure has pixels.
const BUCKETS: usize = 700;
/// Samples of the close-up of a free run.
const CLOSE_UP: usize = 400;
/// Points at most of a loop.
const LOOP_POINTS: usize = 3000;
/// Lags of the residual tests.
const LAGS: usize = 25;
/// Level below which a residual test is said to fail.
const LEVEL: f64 = 0.01;

/// The page as HTML text.
pub fn page(report: &FitReport, provenance: &Provenance) -> String {
    let s = &report.summary;
    let judged = judged(s);
    let mut page = Page::new(format!("Model of {}", s.output), headline(s, judged), lead(s, judged));
    facts(&mut page, s, judged);
    page.notes(Tenor::Warning, &s.warnings);
    equation(&mut page, report);
    for series in shown(report) {
        recording(&mut page, s, series);
    }
    length(&mut page, s);
    residuals(&mut page, report);
    errors(&mut page, s);
    page.section("What was decided, and why", "");
    page.notes(Tenor::Plain, &s.decisions);
    page.section(
        "How to make this page again",
        "The same recordings and the same seed give the same model, whatever the number of threads.",
    );
    page.code(&provenance.command);
    page.foot(format!("hysid {}, seed {}, {}", provenance.version, s.seed, s.schema));
    page.render()
}

/// The line that the page is headed with: the worst hold-out, else the worst estimation recording.
fn judged(s: &FitSummary) -> Option<&ErrorLine> {
    let worst = |role: Role| {
        s.free_run.iter().filter(|l| l.role == role).max_by(|a, b| {
            let key = |l: &ErrorLine| {
                if l.diverged_at.is_some() { f64::INFINITY } else { l.relative.unwrap_or(f64::INFINITY) }
            };
            key(a).total_cmp(&key(b))
        })
    };
    worst(Role::Holdout).or_else(|| worst(Role::Estimation))
}

fn headline(s: &FitSummary, judged: Option<&ErrorLine>) -> String {
    match judged {
        Some(ErrorLine { diverged_at: Some(n), recording, .. }) => {
            format!("A model of {} terms whose free run diverges on {recording} at sample {n}", s.terms.len())
        }
        Some(ErrorLine { relative: Some(r), .. }) => {
            format!(
                "A model of {} terms, in free run within {} of the output's standard deviation",
                s.terms.len(),
                percent(*r)
            )
        }
        _ => format!("A model of {} terms", s.terms.len()),
    }
}

fn lead(s: &FitSummary, judged: Option<&ErrorLine>) -> String {
    let of = judged.map_or(String::new(), |l| match l.role {
        Role::Holdout => format!(" The headline is for {}, which the model has never seen.", l.recording),
        Role::Estimation => format!(" The headline is for {}, from which the model was made.", l.recording),
    });
    format!("{} from {}. Held out: {}.{of}", s.output, s.inputs.join(", "), s.held_out)
}

fn facts(page: &mut Page, s: &FitSummary, judged: Option<&ErrorLine>) {
    let mut facts = vec![(s.terms.len().to_string(), "terms".to_string())];
    if let Some(line) = judged {
        facts.push((line.rmse.map_or("-".into(), number), "free-run error (rms)".into()));
        let linear = s.linear_free_run.iter().find(|l| l.recording == line.recording && l.role == line.role);
        if let (Some(ours), Some(linear)) = (line.rmse, linear.and_then(|l| l.rmse)) {
            facts.push((number(ours / linear), "of the linear model's free-run error".into()));
        }
    }
    let horizon = if s.horizon.whole_run { "whole run".to_string() } else { format!("{} steps", s.horizon.steps) };
    facts.push((horizon, "longest horizon that holds on held-out blocks".into()));
    facts.push((format!("1 : {}", s.decimation), "sampling-rate reduction".into()));
    page.facts(&facts);
}

fn equation(page: &mut Page, report: &FitReport) {
    let s = &report.summary;
    page.section(
        "The equation",
        "ERR, the error reduction ratio: the share of the output's energy that a term explains one step ahead.",
    );
    page.notes(Tenor::Plain, &s.derived);
    let mut table = Table::new(&[
        ("term", Align::Left),
        ("coefficient", Align::Right),
        ("standard error", Align::Right),
        ("ERR", Align::Right),
    ]);
    for t in &s.terms {
        let error = t.standard_error.map(number).unwrap_or_default();
        let err = t.err.map(|e| format!("{} %", number(100.0 * e))).unwrap_or_default();
        table.row([t.term.clone(), number(t.coefficient), error, err]);
    }
    page.table(&table);
    if !s.noise.is_empty() {
        let terms = s.noise.iter().map(|t| (t.coefficient, format!("e[n-{}]", t.residual_lag)));
        page.text(&format!(
            "One step ahead, past one-step residuals e help: {}. They take no part in the free run.",
            sum(terms)
        ));
    }
    page.text("As LaTeX (package amsmath):");
    page.code(&report.latex);
}

/// The recordings that get figures: all hold-outs, else the estimation recordings; at most four.
fn shown(report: &FitReport) -> impl Iterator<Item = &Series> {
    let holdout = report.series.iter().any(|s| s.role == Role::Holdout);
    report.series.iter().filter(move |s| !holdout || s.role == Role::Holdout).take(4)
}

fn recording(page: &mut Page, s: &FitSummary, series: &Series) {
    let role = match series.role {
        Role::Holdout => "hold-out, never used",
        Role::Estimation => "used for the model",
    };
    page.section(&format!("{} ({role})", series.recording), "");
    let whole = 0..series.t.len();
    page.figure(run(s, series, whole), "Free run over the whole recording");
    let start = series.t.len() / 2;
    let close = start..(start + CLOSE_UP).min(series.t.len());
    page.figure(run(s, series, close), "A close-up from the middle of the recording, with the one-step prediction");
    let residual: Vec<f64> = series.y.iter().zip(&series.free_run).map(|(y, p)| y - p).collect();
    let error = Plot::new("time (s)", "residual").sized(860, 220).with(
        "free run",
        Tone::After,
        Mark::Line,
        envelope(&series.t, &residual, BUCKETS),
    );
    page.figure(error.svg(), "Residual of the free run");
    if let Some(u) = series.inputs.first() {
        page.figures(vec![
            (
                loops(&s.inputs[0], &s.output, u, &[(&series.y, Tone::Measured, "recorded")]),
                "The loop as recorded".into(),
            ),
            (
                loops(&s.inputs[0], &s.output, u, &[(&series.free_run, Tone::After, "free run")]),
                "The loop of the free run".into(),
            ),
        ]);
        let errors = by_branch(u, &series.y, &series.free_run, threshold(u));
        let (rising, falling) = (errors.rising, errors.falling);
        if rising.samples > 0 && falling.samples > 0 {
            page.text(&format!(
                "Error by branch: {} while {} rises, {} while it falls.",
                number(rising.rmse),
                s.inputs[0],
                number(falling.rmse)
            ));
        }
    }
}

/// A movement that counts as a change of direction: a hundredth of the range.
fn threshold(u: &[f64]) -> f64 {
    let finite = u.iter().copied().filter(|v| v.is_finite());
    let (low, high) = hysid_signal::range(finite);
    if high > low { 0.01 * (high - low) } else { 0.0 }
}

fn run(s: &FitSummary, series: &Series, range: std::ops::Range<usize>) -> Result<String, FigureError> {
    let line = |y: &[f64]| envelope(&series.t[range.clone()], &y[range.clone()], BUCKETS);
    let mut plot = Plot::new("time (s)", &s.output).with("recorded", Tone::Measured, Mark::Line, line(&series.y)).with(
        "free run",
        Tone::After,
        Mark::Line,
        line(&series.free_run),
    );
    if range.len() <= CLOSE_UP {
        plot = plot.with("one step", Tone::Other, Mark::Dashed, line(&series.one_step));
    }
    plot.svg()
}

fn loops(input: &str, output: &str, u: &[f64], series: &[(&Vec<f64>, Tone, &str)]) -> Result<String, FigureError> {
    let step = u.len().div_ceil(LOOP_POINTS).max(1);
    let mut plot = Plot::new(input, output).sized(430, 340);
    for (y, tone, label) in series {
        let points = u.iter().copied().zip(y.iter().copied()).step_by(step).collect();
        plot = plot.with(label, *tone, Mark::Line, points);
    }
    plot.svg()
}

fn length(page: &mut Page, s: &FitSummary) {
    if s.path.len() < 2 {
        return;
    }
    page.section(
        "How long the model should be",
        "Errors against the number of terms. The free run on held-out blocks chose the length. PRESS, the leave-one-out error of one step ahead, is what a regression would go by: where it still falls and the free run does not, the further terms explain the last sample and not the machine.",
    );
    let points = |f: fn(&PathPoint) -> f64| s.path.iter().map(|p| (p.terms as f64, f(p))).collect::<Vec<_>>();
    let plot = |label: &str| Plot::new("terms", label).sized(430, 300).logarithmic(LogAxes::Y);
    let free = plot("free-run error (rms)")
        .with("estimation blocks", Tone::Faint, Mark::Line, points(|p| p.taught))
        .with("held-out blocks", Tone::After, Mark::Line, points(|p| p.held))
        .with("", Tone::After, Mark::Dots, points(|p| p.held));
    let press = plot("one step, left out (rms)")
        .with("root of PRESS / N", Tone::Other, Mark::Line, points(|p| p.press))
        .with("", Tone::Other, Mark::Dots, points(|p| p.press));
    page.figures(vec![
        (free.svg(), "The free run along the path of the selection".into()),
        (press.svg(), "PRESS of the same terms, one step ahead".into()),
    ]);
}

fn residuals(page: &mut Page, report: &FitReport) {
    let Some(series) = shown(report).next() else { return };
    let residual: Vec<f64> = series.y.iter().zip(&series.one_step).map(|(y, p)| y - p).collect();
    let Some(range) = longest_whole(&residual, &series.inputs) else { return };
    let inputs: Vec<&[f64]> = series.inputs.iter().map(|u| &u[range.clone()]).collect();
    let tests = residual_tests(&[ResidualRecord { inputs: &inputs, residual: &residual[range] }], LAGS);
    if tests.is_empty() {
        return;
    }
    page.section(
        "Residual tests",
        "Correlations of the one-step residual (Billings and Voon). Outside of the dashed 95 % bounds, the residual still holds something that a better model could explain; a good free run matters more.",
    );
    let mut table = Table::new(&[("test", Align::Left), ("p-value", Align::Right), ("", Align::Left)]);
    for t in &tests {
        let said = if t.passes(LEVEL) { "passes" } else { "something is left" };
        table.row([t.name.clone(), p_value(t.p_value), said.into()]);
    }
    page.table(&table);
    let mut figures: Vec<_> = tests.iter().map(|t| (correlogram(t), t.name.clone())).collect();
    while !figures.is_empty() {
        page.figures(figures.drain(..figures.len().min(2)).collect());
    }
}

fn correlogram(test: &CorrelationTest) -> Result<String, FigureError> {
    let points = test.lags.iter().map(|&l| l as f64).zip(test.values.iter().copied()).collect();
    Plot::new("lag (samples)", "correlation")
        .sized(430, 200)
        .with("", Tone::After, Mark::Stems, points)
        .with_levels(&[test.bound, -test.bound])
        .svg()
}

/// The longest stretch without a missing sample.
fn longest_whole(residual: &[f64], inputs: &[Vec<f64>]) -> Option<std::ops::Range<usize>> {
    let whole = |n: usize| residual[n].is_finite() && inputs.iter().all(|u| u.get(n).is_some_and(|v| v.is_finite()));
    let (mut best, mut start) = (0..0, 0);
    for n in 0..=residual.len() {
        if n == residual.len() || !whole(n) {
            if n - start > best.len() {
                best = start..n;
            }
            start = n + 1;
        }
    }
    (best.len() > 4 * LAGS).then_some(best)
}

fn errors(page: &mut Page, s: &FitSummary) {
    page.section(
        "Errors",
        "One step ahead, the model sees the recorded output up to the sample before; in free run, the input only.",
    );
    let mut table = Table::new(&[
        ("recording", Align::Left),
        ("", Align::Left),
        ("free run (rms)", Align::Right),
        ("of the standard deviation", Align::Right),
        ("one step (rms)", Align::Right),
        ("linear model, free run", Align::Right),
        ("remark", Align::Left),
    ]);
    for ((free, one), linear) in s.free_run.iter().zip(&s.one_step).zip(&s.linear_free_run) {
        let some = |v: Option<f64>| v.map(number).unwrap_or_default();
        let role = if free.role == Role::Holdout { "hold-out" } else { "estimation" };
        table.row([
            free.recording.clone(),
            role.into(),
            some(free.rmse),
            free.relative.map(percent).unwrap_or_default(),
            some(one.rmse),
            some(linear.rmse),
            free.diverged_at.map(|n| format!("diverged at sample {n}")).unwrap_or_default(),
        ]);
    }
    page.table(&table);
}
