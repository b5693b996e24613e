//! The score as Markdown (docs/proof.md) and as a page with figures.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Context;
use hysid_report::figure::{Mark, Plot, Tone};
use hysid_report::page::{Align, Page, Table};

use super::rivals::PATIENCE;
use super::score::{CELLS, Cell, Line, Row, Score, Standing, shared};
use super::stats::quantile;
use super::verdict::Verdict;

fn number(v: f64, share: bool) -> String {
    match (v.is_finite(), share) {
        (false, _) => "-".into(),
        (true, true) => format!("{:.1} %", 100.0 * v),
        (true, false) => format!("{v:.3}"),
    }
}

fn interval(line: &Line) -> String {
    let (low, high) = line.interval;
    if line.n == 0 || !low.is_finite() {
        return "-".into();
    }
    format!("{} to {}", number(low, line.share), number(high, line.share))
}

fn standing(line: &Line) -> &'static str {
    match line.standing {
        Standing::Met => "met",
        Standing::Missed => "**missed**",
        Standing::Open => "-",
    }
}

/// Lines of the score as a table in Markdown.
pub fn lines(text: &mut String, lines: &[Line]) {
    table(text, &HEAD, lines.iter().map(cells));
}

const HEAD: [&str; 6] = ["", "target", "reached", "95 % interval", "n", ""];

fn cells(line: &Line) -> Vec<String> {
    let name = if line.gate { format!("{} (gate)", line.what) } else { line.what.clone() };
    vec![
        name,
        line.target.clone(),
        number(line.value, line.share),
        interval(line),
        line.n.to_string(),
        standing(line).into(),
    ]
}

fn table(text: &mut String, head: &[&str], rows: impl IntoIterator<Item = Vec<String>>) {
    let _ = writeln!(text, "| {} |", head.join(" | "));
    let _ = writeln!(text, "|{}", "---|".repeat(head.len()));
    for row in rows {
        let _ = writeln!(text, "| {} |", row.join(" | "));
    }
    text.push('\n');
}

fn gathered(list: &[Cell]) -> Vec<Vec<String>> {
    list.iter()
        .map(|c| {
            let mut row = vec![format!("{}", c.at), c.n.to_string()];
            row.extend(c.hits.iter().map(|h| number(*h as f64 / c.n as f64, true)));
            row.extend([number(c.fall, false), number(c.over_oracle, false)]);
            row
        })
        .collect()
}

/// The head of a table of single effects that were gathered by this.
fn gathered_by(what: &str) -> [&str; 8] {
    [what, "n", "detected", "family", "mechanism", "slot", "after/before", "after/oracle"]
}

const SEEN: &str = "nats from";
const SEEN_MEANS: &str = "Single effects by the log likelihood ratio that the exact law with its true parameters has over the best baseline: what can be seen at most.";

/// How long a diagnosis takes, from the seconds of each.
pub fn times(seconds: &[f64]) -> String {
    format!(
        "median {:.1} s, 90th percentile {:.1} s, longest {:.1} s (one thread each, two processes side by side)",
        quantile(seconds, 0.5),
        quantile(seconds, 0.9),
        quantile(seconds, 1.0)
    )
}

/// Head of the table of competitors.
const COMPETITORS: [&str; 5] = ["", "DNR < 0.4", "0.5", "1", "3"];

/// One line of that table for each competitor.
fn competitors(score: &Score) -> impl Iterator<Item = Vec<String>> {
    let medians = |m: &[f64]| m.iter().map(|v| number(*v, false)).collect::<Vec<_>>();
    score.competitors.iter().map(move |(name, m)| [vec![name.clone()], medians(m)].concat())
}

/// The result as Markdown.
pub fn markdown(score: &Score, command: &str, took: f64, rows: &[Row]) -> String {
    let cut = rows.iter().filter(|r| !r.rivals.oracle_complete).count();
    let cut = if cut > 0 {
        let seconds = PATIENCE.as_secs();
        format!(
            " The oracle of {cut} cases was cut short after {seconds} s; it starts at the truth, so that its error may be too small."
        )
    } else {
        String::new()
    };
    let mut text = format!(
        "`{command}`: {} cases in {took:.0} s; a diagnosis takes {}.{cut}\n\n",
        rows.len(),
        times(&score.seconds)
    );
    lines(&mut text, &score.lines);
    text.push_str("By difficulty, single effects:\n\n");
    table(&mut text, &gathered_by("DNR"), gathered(&score.cells));
    let _ = writeln!(text, "{SEEN_MEANS}\n");
    table(&mut text, &gathered_by(SEEN), gathered(&score.seen));
    if !score.competitors.is_empty() {
        text.push_str("Median held-out error over that of the recalibrated simulation, effects of the catalogue:\n\n");
        table(&mut text, &COMPETITORS, competitors(score));
    }
    text.push_str("What single effects, laws outside the catalogue and controls were taken for (true family, said, cases), errors only:\n\n");
    let mut wrong: Vec<(&(String, String), &usize)> =
        score.confusion.iter().filter(|((a, b), _)| a != b && !(a == "nothing" && b == "nothing")).collect();
    wrong.sort_by(|a, b| b.1.cmp(a.1).then(a.0.cmp(b.0)));
    table(
        &mut text,
        &["true family", "said", "cases"],
        wrong.iter().map(|((a, b), n)| vec![a.clone(), b.clone(), n.to_string()]),
    );
    let _ = writeln!(text, "Firm and wrong ({}):\n", score.firm_wrong.len());
    for line in &score.firm_wrong {
        let _ = writeln!(text, "- {line}");
    }
    if !score.broken.is_empty() {
        let _ = writeln!(text, "\nWithout a verdict ({}):\n", score.broken.len());
        for line in &score.broken {
            let _ = writeln!(text, "- {line}");
        }
    }
    text
}

/// A verdict in one line.
pub fn said(verdict: &Result<Verdict, String>) -> String {
    match verdict {
        Err(e) => format!("BROKEN {e}"),
        Ok(v) => {
            let list: Vec<String> = v
                .effects
                .iter()
                .map(|s| format!("{}@{} {:.2}/{:.2}", s.mechanism, s.slot, s.probability, s.family_probability))
                .collect();
            format!("{} [{}] p={:?}", v.kind, list.join(", "), v.p_value)
        }
    }
}

/// One line for each case.
pub fn cases(rows: &[Row]) -> String {
    let mut text = String::new();
    for r in rows {
        let truth: Vec<String> = r.label.effects.iter().map(|e| format!("{}@{}", e.mechanism, e.slots[0])).collect();
        let said = said(&r.trial.verdict);
        let own = r.verdict().and_then(|v| v.own_fit);
        let mark = if r.mechanisms_right() {
            "ok "
        } else if r.families_right() {
            "fam"
        } else {
            "BAD"
        };
        let _ = writeln!(
            text,
            "{mark} {} {:?} {:?} {:?} N={} dnr={:.2} seen={:.0} {} {:.1}% truth=[{}] said={said} before={:.3} after={:.3} oracle={:.3} linear={:.3} own={:?}/{:?} sep={:?} {:.1}s{}",
            r.label.id,
            r.label.group,
            r.label.plant,
            r.label.excitation,
            r.label.samples,
            r.label.dnr,
            r.rivals.visible,
            r.label.noise.name(),
            100.0 * r.label.noise_level,
            truth.join(" + "),
            r.rivals.before,
            r.after(),
            r.rivals.oracle,
            r.rivals.competitor(|c| c.linear),
            own.map(|f| (f.1 / f.0).sqrt()),
            r.verdict().and_then(|v| v.own_black_box),
            r.rivals.separation,
            r.trial.seconds,
            asides(r)
        );
    }
    text
}

/// What came of a proposed experiment, and the numbers whose interval does not hold the truth.
fn asides(r: &Row) -> String {
    let mut text = String::new();
    if let Some(s) = r.settled {
        let word = |settles: bool| if settles { "settles" } else { "does not settle" };
        let _ = write!(text, " experiment {}, a random input {}", word(s.proposed), word(s.random));
    }
    for p in shared(r).iter().filter(|p| !p.is_covered()) {
        let (value, low, high) = p.told;
        let _ = write!(text, " {}={value:.4e} ({low:.3e} to {high:.3e}) is {:.4e}", p.name, p.truth);
    }
    text
}

/// The result as a page with figures.
pub fn html(score: &Score, command: &str, took: f64, rows: &[Row]) -> String {
    let gates = super::gates(score).count();
    let met = super::gates(score).filter(|l| l.standing == Standing::Met).count();
    let mut page = Page::new(
        "Proof of the diagnosis",
        format!("{met} of {gates} pass-or-fail figures met on {} cases", rows.len()),
        "An effect is concealed in every recording but the controls; the program saw the simulation file and the recordings only.",
    );
    let tabled = |head: &[&str], body: Vec<Vec<String>>| {
        let columns: Vec<(&str, Align)> =
            head.iter().enumerate().map(|(i, h)| (*h, if i == 0 { Align::Left } else { Align::Right })).collect();
        let mut t = Table::new(&columns);
        for row in body {
            t.row(row.into_iter().map(|c| c.replace("**", "")));
        }
        t
    };
    page.section("Targets", "");
    page.table(&tabled(&HEAD, score.lines.iter().map(cells).collect()));
    page.section("By difficulty", "Single effects. DNR: what the best baseline leaves, over the noise.");
    page.table(&tabled(&gathered_by("DNR"), gathered(&score.cells)));
    let mut plot = Plot::new("log10 of the difficulty DNR", "share right");
    for (i, (name, tone)) in
        [("detected", Tone::Other), ("family", Tone::Before), ("mechanism", Tone::After)].into_iter().enumerate()
    {
        let points = score
            .cells
            .iter()
            .zip(CELLS)
            .filter(|(c, _)| c.n > 0)
            .map(|(c, dnr)| (dnr.log10(), c.hits[i] as f64 / c.n as f64))
            .collect();
        plot = plot.with(name, tone, Mark::Line, points);
    }
    page.figure(plot.svg(), "Share of single effects detected, and with the right family and mechanism.");
    page.section("By what can be seen", SEEN_MEANS);
    page.table(&tabled(&gathered_by(SEEN), gathered(&score.seen)));
    let diagonal = vec![(0.0, 0.0), (1.0, 1.0)];
    let reliability = Plot::new("probability stated", "share right")
        .with("perfect", Tone::Faint, Mark::Line, diagonal)
        .with("stated", Tone::After, Mark::Dots, score.bins.iter().map(|b| (b.0, b.1)).collect());
    page.figure(reliability.svg(), "Calibration of the mechanisms' probabilities.");
    if !score.competitors.is_empty() {
        page.section(
            "Competitors",
            "Median held-out error over that of the recalibrated simulation, against outputs without noise.",
        );
        page.table(&tabled(&COMPETITORS, competitors(score).collect()));
    }
    page.section("Confusion", "True family, what was said, number of cases.");
    let body = score.confusion.iter().map(|((a, b), n)| vec![a.clone(), b.clone(), n.to_string()]).collect();
    page.table(&tabled(&["true family", "said", "cases"], body));
    page.section("Firm and wrong", "");
    for line in &score.firm_wrong {
        page.text(line);
    }
    page.foot(format!("{command}; {took:.0} s; a diagnosis takes {}", times(&score.seconds)));
    page.render()
}

const BEGIN: &str = "<!-- latest result: begin -->";
const END: &str = "<!-- latest result: end -->";
const SEQUENCE: &str = "<!-- sequence: next row above this line -->";

/// Replaces the latest result in `docs/proof.md` and appends a row to the sequence of reported results.
pub fn record(path: &Path, result: &str, score: &Score, command: &str, took: f64) -> anyhow::Result<()> {
    let text = std::fs::read_to_string(path).with_context(|| format!("{}", path.display()))?;
    std::fs::write(path, recorded(&text, result, score, command, took)?)?;
    Ok(())
}

fn recorded(text: &str, result: &str, score: &Score, command: &str, took: f64) -> anyhow::Result<String> {
    let begin = text.find(BEGIN).context("docs/proof.md has no mark for the latest result")? + BEGIN.len();
    let end = text.find(END).context("docs/proof.md has no end of the latest result")?;
    let mut out = format!("{}\n\n{result}\n{}", &text[..begin], &text[end..]);
    let at = out.find(SEQUENCE).context("docs/proof.md has no mark for the sequence")?;
    let mut row = format!("| `{command}` | {took:.0} s |");
    for line in super::gates(score) {
        let _ = write!(row, " {} |", number(line.value, line.share));
    }
    row.push('\n');
    out.insert_str(at, &row);
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_keeps_every_result() {
        let score = super::super::score::score(&[]);
        let text = format!("# Proof\n{BEGIN}\nold\n{END}\n| a |\n|---|\n| earlier |\n{SEQUENCE}\n");
        let once = recorded(&text, "new", &score, "c1", 1.0).unwrap();
        let twice = recorded(&once, "newer", &score, "c2", 1.0).unwrap();
        assert!(twice.contains("newer") && !twice.contains("old\n"));
        let order: Vec<usize> = ["earlier", "`c1`", "`c2`", SEQUENCE].iter().map(|s| twice.find(s).unwrap()).collect();
        assert!(order.is_sorted());
        let real = std::fs::read_to_string(crate::root().join("docs/proof.md")).unwrap();
        assert!(recorded(&real, "x", &score, "c", 1.0).is_ok());
    }
}
