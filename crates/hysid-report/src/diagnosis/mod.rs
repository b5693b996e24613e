//! The report of a diagnosis: one page that an engineer shows to a colleague.
//!
//! Order of the page: the verdict in one sentence, the figures of merit, what is missing, what to do next (with the proposed
//! experiment), the errors on the hold-out, recording and simulations over time, the residual over frequency, where the
//! mismatch lives, the law that was found, the candidates, the parameters, what the recording could not have shown (further
//! up where nothing was found), how to make the page again.

mod figures;
mod words;

use hysid_diagnose::Interval;
use hysid_diagnose::answer::picture::{ParameterPicture, Picture};
use hysid_diagnose::file::{AlternativeRecord, DiagnosisFile, VerdictKind};

use crate::page::{Align, Page, Table, Tenor};
use crate::words::{Provenance, interval, number, p_value, percent, probability};

/// How many of the smallest detectable effects are listed.
const MOST_DETECTABLE: usize = 60;
/// How many rivals are listed.
const MOST_RIVALS: usize = 12;

/// The page as HTML text.
pub fn page(file: &DiagnosisFile, picture: &Picture, provenance: &Provenance) -> String {
    let mut page = Page::new(
        format!("Diagnosis: {}", picture.title),
        words::headline(file, picture),
        words::told(&file.summary, file),
    );
    merit(&mut page, file);
    // What is missing comes first: of what the catalogue does not hold that is the correction.
    let (first, last): (Section, Section) =
        if is_foreign(file) { (correction, effects) } else { (effects, correction) };
    first(&mut page, file);
    next(&mut page, file, picture);
    fits(&mut page, file);
    page.notes(Tenor::Warning, &file.notes);
    if file.verdict == VerdictKind::NoSignificantMismatch {
        limits(&mut page, file);
    }
    time(&mut page, picture);
    residual(&mut page, picture);
    location(&mut page, file, picture);
    laws(&mut page, picture);
    candidates(&mut page, file);
    last(&mut page, file);
    parameters(&mut page, &picture.parameters);
    if file.verdict != VerdictKind::NoSignificantMismatch {
        limits(&mut page, file);
    }
    page.section(
        "How to make this page again",
        "The same recordings and the same seed give the same verdict, whatever the number of threads.",
    );
    page.code(&provenance.command);
    page.foot(format!("hysid {}, seed {}, {}", provenance.version, file.seed, file.schema));
    page.render()
}

/// A section of the page.
type Section = fn(&mut Page, &DiagnosisFile);

/// Whether what is missing is not of the catalogue.
fn is_foreign(file: &DiagnosisFile) -> bool {
    file.verdict == VerdictKind::NotInCatalogue
}

fn merit(page: &mut Page, file: &DiagnosisFile) {
    let mut facts = vec![(
        file.mismatch.p_value.map_or_else(|| "not tested".into(), p_value),
        "p-value: the chance of a mismatch score this large with nothing missing".to_string(),
    )];
    if let Some(first) = file.effects.first().filter(|_| !is_foreign(file)) {
        facts.push((probability(first.probability), format!("probability of {}", words::plain(&first.mechanism))));
        facts.push((
            probability(first.family_probability),
            format!("probability of the family {}", words::plain(&first.family)),
        ));
        if let Some(c) = first.concealment {
            facts.push((percent(c), "of its response could be absorbed by wrong parameters".into()));
        }
    }
    if let [one] = file.fit.as_slice()
        && let Some(before) = one.rmse_before
    {
        let found = one.rmse_after.filter(|_| file.verdict != VerdictKind::NoSignificantMismatch);
        facts.push(match found {
            Some(after) => {
                (format!("{} \u{2192} {}", number(before), number(after)), "hold-out error, before and after".into())
            }
            None => (number(before), "hold-out error of the recalibrated simulation".into()),
        });
        if let Some(black) = one.rmse_black_box {
            facts.push((number(black), "hold-out error of a black box without any physics".into()));
        }
    }
    let best = file.fit.iter().filter_map(|f| f.ratio).fold(None, |m: Option<f64>, r| Some(m.map_or(r, |m| m.max(r))));
    if let Some(ratio) = best.filter(|_| file.verdict != VerdictKind::NoSignificantMismatch) {
        facts.push((number(ratio), "hold-out error after over before (the worst record)".into()));
    }
    if let Some(remaining) = &file.remaining {
        facts.push((percent(remaining.share), "of the original mismatch remains".into()));
    }
    page.facts(&facts);
}

fn effects(page: &mut Page, file: &DiagnosisFile) {
    if file.effects.is_empty() {
        return;
    }
    let intro = match file.verdict {
        VerdictKind::Named => "",
        VerdictKind::Family => "The family is firm, the member is not; the likeliest member is shown.",
        VerdictKind::Ambiguous => {
            "The likeliest explanation is shown, not all of it firm; what else was weighed is below."
        }
        _ => "It does not explain what is missing, and stands here so that you see what was tried.",
    };
    page.section(if is_foreign(file) { "What the catalogue comes nearest with" } else { "What is missing" }, intro);
    for effect in &file.effects {
        page.text(&effect.sentence);
        let mut table = Table::new(&[
            ("parameter", Align::Left),
            ("value", Align::Right),
            ("95 % interval", Align::Right),
            ("unit", Align::Left),
        ]);
        for p in &effect.parameters {
            table.row([p.name.clone(), number(p.value), interval(p.low, p.high), p.unit.clone()]);
        }
        page.table(&table);
    }
}

fn time(page: &mut Page, picture: &Picture) {
    if picture.records.is_empty() {
        return;
    }
    page.section(
        "Recording and simulation over time",
        if picture.records.iter().any(|r| r.after.is_some()) {
            "Both simulations run free: they see the input only. Before: the simulation with its parameters calibrated again. After: with the effect in it."
        } else {
            "The simulation runs free: it sees the input only. Its parameters are calibrated again."
        },
    );
    for record in &picture.records {
        let role = figures::role(record.role);
        page.figure(figures::over_time(record), &format!("{}, {} ({role})", record.recording, record.output));
        page.figure(
            figures::residual_over_time(record),
            &format!("Residual of {} before and after; dashed: two standard deviations of the noise", record.output),
        );
    }
}

fn residual(page: &mut Page, picture: &Picture) {
    if picture.spectra.is_empty() {
        return;
    }
    page.section(
        "The residual over frequency",
        "Where the residual stands above the noise floor, something is left out.",
    );
    for spectrum in &picture.spectra {
        page.figure(figures::spectrum(spectrum), &format!("Amplitude spectra of {}", spectrum.output));
    }
}

fn location(page: &mut Page, file: &DiagnosisFile, picture: &Picture) {
    let Some(location) = &file.location else { return };
    page.section("Where they part", "");
    let list = |pairs: &[[f64; 2]], unit: &str| {
        let parts: Vec<String> = pairs
            .iter()
            .map(|[a, b]| {
                if a == b {
                    format!("near {} {unit}", number(*a))
                } else {
                    format!("{} to {} {unit}", number(*a), number(*b))
                }
            })
            .collect();
        if parts.is_empty() { "throughout".to_string() } else { parts.join(", ") }
    };
    let mut table = Table::new(&[("", Align::Left), ("", Align::Left)]);
    table.row(["place in the simulation".into(), words::place(&location.slot)]);
    table.row(["block".into(), words::plain(&location.block)]);
    table.row(["time".into(), list(&location.time_s, "s")]);
    table.row(["frequency".into(), list(&location.band_hz, "Hz")]);
    table.row(["operating region".into(), location.region.clone()]);
    page.table(&table);
    for map in &picture.maps {
        let mut pair = vec![(
            figures::map(map, &map.before),
            format!("{}: mean residual before, in units of the noise", map.output),
        )];
        if let Some(after) = &map.after {
            pair.push((figures::map(map, after), "The same after, in its own colours".into()));
        }
        page.figures(pair);
    }
}

fn laws(page: &mut Page, picture: &Picture) {
    if picture.laws.is_empty() {
        return;
    }
    page.section("The law that was found", "As the augmented simulation runs through it on the recording.");
    page.figures(picture.laws.iter().map(|law| (figures::law(law), law.title.clone())).collect());
}

fn candidates(page: &mut Page, file: &DiagnosisFile) {
    if file.effects.is_empty() && file.alternatives.is_empty() {
        return;
    }
    page.section(
        "Candidates",
        "Evidence: how much twice the log evidence falls short of the best. Separation: squared distance to the best one's response in units of the noise, after the rival's own refit; below 9 the two cannot be told apart on this recording.",
    );
    let mut table = Table::new(&[
        ("mechanism", Align::Left),
        ("family", Align::Left),
        ("place", Align::Left),
        ("probability", Align::Right),
        ("evidence short by", Align::Right),
        ("separation", Align::Right),
        ("concealment", Align::Right),
    ]);
    for e in &file.effects {
        let concealed = e.concealment.map(percent).unwrap_or_default();
        let p = probability(e.probability);
        table.row([
            words::plain(&e.mechanism),
            words::plain(&e.family),
            words::place(&e.slot),
            p,
            "0".into(),
            String::new(),
            concealed,
        ]);
    }
    // What is told has its row already.
    let told = |a: &&AlternativeRecord| file.effects.iter().any(|e| e.mechanism == a.mechanism && e.slot == a.slot);
    for a in file.alternatives.iter().filter(|a| !told(a)).take(MOST_RIVALS) {
        table.row([
            words::plain(&a.mechanism),
            words::plain(&a.family),
            words::place(&a.slot),
            probability(a.probability),
            number(a.evidence_gap),
            a.separation.map(number).unwrap_or_default(),
            String::new(),
        ]);
    }
    page.table(&table);
}

fn correction(page: &mut Page, file: &DiagnosisFile) {
    let Some(correction) = &file.correction else { return };
    let s = &correction.signature;
    page.section(
        if is_foreign(file) { "What is missing: a correction without a name" } else { "A correction without a name" },
        "A sparse model of what no mechanism of the catalogue explains. It improves the prediction; it is not physics.",
    );
    let rate = if s.rate_dependent { "depends on the rate" } else { "does not depend on the rate" };
    page.text(&format!("Memory: {}; {rate}; symmetry: {}; side: {}.", words::plain(&s.memory), s.symmetry, s.side));
    let columns = [("term", Align::Left), ("at", Align::Left), ("coefficient", Align::Right), ("ERR", Align::Right)];
    let mut table = Table::new(&columns);
    for t in &correction.terms {
        table.row([t.term.clone(), t.slot.clone(), number(t.coefficient), percent(t.err)]);
    }
    page.table(&table);
}

fn fits(page: &mut Page, file: &DiagnosisFile) {
    if file.fit.is_empty() {
        return;
    }
    let black_box = file.fit.iter().any(|f| f.rmse_black_box.is_some());
    let mut words =
        "Before is the recalibrated simulation, never the first guess; after, with the effects in it.".to_owned();
    if black_box {
        words += " The black box is a NARX model without physics, identified from the same recordings and run on the same samples: where it is clearly better than the simulation after, something is still missing.";
    }
    page.section("Free-run error on recordings that were never used", &words);
    let mut columns = vec![
        ("recording", Align::Left),
        ("output", Align::Left),
        ("before", Align::Right),
        ("after", Align::Right),
        ("after / before", Align::Right),
        ("95 % interval", Align::Right),
    ];
    columns.extend(black_box.then_some(("black box", Align::Right)));
    let mut table = Table::new(&columns);
    let some = |v: Option<f64>| v.map(number).unwrap_or_default();
    for f in &file.fit {
        let mut row = vec![
            f.recording.clone(),
            f.output.clone(),
            some(f.rmse_before),
            some(f.rmse_after),
            some(f.ratio),
            interval(f.ratio_low, f.ratio_high),
        ];
        row.extend(black_box.then(|| some(f.rmse_black_box)));
        table.row(row);
    }
    page.table(&table);
}

fn parameters(page: &mut Page, parameters: &[ParameterPicture]) {
    if parameters.is_empty() {
        return;
    }
    let found = parameters.iter().any(|p| p.after.is_some());
    let fitted = |i: &Option<Interval>| {
        let of = |i: &Interval| {
            let (low, high) = i.low_and_high();
            [number(i.value), interval(low, high)]
        };
        i.as_ref().map(of).unwrap_or_default()
    };
    let range_heading = ("95 % interval", Align::Right);
    let mut columns = vec![("parameter", Align::Left), ("given", Align::Right)];
    if found {
        page.section("Parameters", "A parameter that moves far when the effect is put in had been absorbing it.");
        columns.extend([("before", Align::Right), range_heading, ("after", Align::Right), range_heading]);
    } else {
        page.section("Parameters", "As the file gives them, and as the recordings do.");
        columns.extend([("recalibrated", Align::Right), range_heading]);
    }
    columns.extend([("unit", Align::Left), ("remark", Align::Left)]);
    let mut table = Table::new(&columns);
    for p in parameters {
        let mut cells = vec![p.name.clone(), p.given.map(number).unwrap_or_default()];
        cells.extend(fitted(&p.before));
        if found {
            cells.extend(fitted(&p.after));
        }
        cells.extend([p.unit.clone(), p.remark.clone()]);
        table.row(cells);
    }
    page.table(&table);
}

fn limits(page: &mut Page, file: &DiagnosisFile) {
    if file.mismatch.detectable.is_empty() {
        return;
    }
    page.section(
        "What the recording would have shown",
        "The smallest strength of each effect that would have been seen here. Below it, this recording cannot say.",
    );
    let mut table = Table::new(&[
        ("mechanism", Align::Left),
        ("place", Align::Left),
        ("smallest", Align::Right),
        ("unit", Align::Left),
    ]);
    // What stands inside the plant is looked for first.
    let mut sorted: Vec<_> = file.mismatch.detectable.iter().collect();
    sorted.sort_by_key(|d| match d.slot.split(':').next() {
        Some("state") => 0,
        Some("input") => 1,
        Some("output") => 2,
        _ => 3,
    });
    for d in sorted.into_iter().take(MOST_DETECTABLE) {
        table.row([words::plain(&d.mechanism), words::place(&d.slot), number(d.smallest), d.unit.clone()]);
    }
    page.table(&table);
    let more = file.mismatch.detectable.len().saturating_sub(MOST_DETECTABLE);
    if more > 0 {
        page.text(&format!("{more} more are in diagnosis.json."));
    }
}

fn next(page: &mut Page, file: &DiagnosisFile, picture: &Picture) {
    page.section("What to do next", "");
    page.text(words::next_step(file, picture));
    let Some(experiment) = &file.experiment else { return };
    page.text(&experiment.sentence);
    if let (Some(expected), Some(present)) = (experiment.expected_separation, experiment.present_separation)
        && experiment.separable
    {
        let text = format!(
            "Separation expected: {} (25 settles it); on this recording: {}.",
            number(expected),
            number(present)
        );
        page.text(&text);
    }
}
