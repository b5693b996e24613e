//! What it was all for: the paper's recipe and the default of `hysid fit`, on the same two systems, without and with the stated noise.

use hysid::identify::{Options as FitOptions, Source, identify};
use hysid_decimate::{Decimator, Phase, examine, recommend};
use hysid_dictionary::{Model, Record, Signals, Term};
use hysid_hysteresis::preisach::PreisachPlane;
use hysid_hysteresis::{BoucWen, Operator, Sampled};
use hysid_select::{Criterion, Options, PressForm, Search};
use hysid_signal::{Channel, Clock, Excitation, Recording, white_noise};
use hysid_validate::{Normaliser, measure};

use super::cell::{Grid, Section};
use super::paper::{choose, compress, in_words, preisach_loop};

/// The variance that the paper states for its noise.
const STATED_VARIANCE: f64 = 0.01;
const PERIOD_S: f64 = 0.01;

/// One of the two systems: its answer to an input, and the amplitude it is driven with.
struct System {
    name: &'static str,
    amplitude: f64,
    run: Box<dyn Fn(&[f64]) -> Vec<f64>>,
}

fn systems() -> anyhow::Result<[System; 2]> {
    let plane = PreisachPlane::of_the_paper().staircase()?;
    let law = Sampled::new(BoucWen::piezo(1.6, 0.9, 0.8, 0.2)?, PERIOD_S, 4)?;
    Ok([
        System { name: "Preisach", amplitude: 0.5, run: Box::new(move |u| plane.run(u)) },
        System { name: "Bouc-Wen (stand-in)", amplitude: 2.0, run: Box::new(move |u| law.run(u)) },
    ])
}

fn multisine(amplitude: f64, samples: usize, seed: u64) -> anyhow::Result<Vec<f64>> {
    let shape = Excitation::Multisine { lowest_hz: 0.1, highest_hz: 1.0, period: 0 };
    Ok(shape.signal(samples, PERIOD_S, amplitude, seed)?)
}

/// The section.
pub fn section() -> anyhow::Result<Section> {
    let mut rows = Vec::new();
    for system in systems()? {
        let fresh_u = multisine(system.amplitude, 2000, 77)?;
        let fresh_y = (system.run)(&fresh_u);
        let rich = multisine(system.amplitude, 4000, 5)?;
        let papers = match system.name {
            "Preisach" => preisach_loop()?.0,
            _ => (0..400).map(|n| 2.03 * (0.0877 * f64::from(n)).sin()).collect(),
        };
        let cases = [
            ("the paper's input, no noise", &papers, 0.0),
            ("multisine, no noise", &rich, 0.0),
            ("multisine, noise of variance 0.01", &rich, STATED_VARIANCE),
        ];
        for (what, u, variance) in cases {
            let clean = (system.run)(u);
            let noise = white_noise(u.len(), variance, 11)?;
            let y: Vec<f64> = clean.iter().zip(&noise).map(|(y, e)| y + e).collect();
            for (label, [terms, text, error]) in [
                ("paper", by_the_paper(u, &y, &fresh_u, &fresh_y)?),
                ("hysid fit", by_default(u, &y, &fresh_u, &fresh_y)),
            ] {
                rows.push(vec![format!("{}: {what}", system.name), label.into(), terms, text, error]);
            }
        }
    }
    Ok(Section {
        title: "The default fit beside the paper's recipe".into(),
        settings: vec![
            "Systems: the paper's Preisach grid; the Bouc-Wen stand-in of the section above. Fresh input for all: a multisine of 0.1 to 1 Hz with other phases, 2000 samples of 10 ms, no noise.".into(),
            "Estimation: the paper's input (one loop of 202 samples; a sine of 400 samples), and a multisine of 0.1 to 1 Hz, 4000 samples.".into(),
            "Paper's recipe: L from its admissible range where it has one (13 for its own loop), else the robust recommendation; 46 terms, matching pursuit, minimum of equation (18) as printed up to 13 terms, least \
             squares. `hysid fit`: no options."
                .into(),
            "Error: free run on the fresh input, RMSE over the standard deviation of the output.".into(),
        ],
        right_label: String::new(),
        cells: Vec::new(),
        grids: vec![Grid {
            caption: "Free run on an input that neither has seen".into(),
            columns: ["system and data", "method", "terms", "model", "free run, RMSE / std(y)"].map(String::from).to_vec(),
            rows,
        }],
        notes: vec![
            "Symbols of `hysid fit`: du[n] = u[n] - u[n-1], sgn its sign, w1, w2, ... outputs of play operators of the input, which the fit made itself.".into(),
            "One loop of 202 samples says little of other inputs: what the operator remembered before it is a guess. The stated variance 0.01 is a standard deviation of 0.1, \
             larger than the Preisach output's own."
                .into(),
        ],
        figures: Vec::new(),
    })
}

fn recording(name: &str, u: &[f64], y: &[f64]) -> anyhow::Result<Recording> {
    let channel = |name: &str, x: &[f64]| Channel { name: name.into(), samples: x.to_vec() };
    let clock = Clock { start_s: 0.0, period_s: PERIOD_S };
    Ok(Recording::new(name, clock, vec![channel("u", u), channel("y", y)])?)
}

/// Terms, model and error of the paper's recipe.
fn by_the_paper(u: &[f64], y: &[f64], fresh_u: &[f64], fresh_y: &[f64]) -> anyhow::Result<[String; 3]> {
    let r = recording("estimation", u, y)?;
    let rows = examine(&r, "y", &["u"], Decimator::Plain, Phase::Lth, 60.min(u.len() / 15))?;
    let advice = recommend(&rows, 0.95);
    let factor = if u.len() == 202 { 13 } else { advice.factor };
    let (u, y) = (compress(u, factor)?, compress(y, factor)?);
    let options = Options {
        search: Search::MatchingPursuit,
        criterion: Criterion::Press(PressForm::AsPrinted),
        max_terms: 13,
        ..Options::default()
    };
    let chosen = choose(&u, &y, &options)?;
    let terms: Vec<Term> =
        chosen.selection.terms.iter().filter_map(|c| chosen.dictionary.terms().get(*c)).cloned().collect();
    let model = Model::new(Signals::siso(), terms, chosen.selection.theta.clone())?;
    let (u, y) = (compress(fresh_u, factor)?, compress(fresh_y, factor)?);
    let run = model.free_run(&[&u], &y[..model.reach().min(y.len())], u.len(), 100.0)?;
    let error = match run.diverged_at {
        Some(n) => format!("diverges at sample {n} of {}", u.len()),
        None => format!("{:.4}", measure(&y, &run.y).nrmse(Normaliser::Std)),
    };
    Ok([chosen.selection.terms.len().to_string(), format!("L = {factor}: {}", in_words(&chosen.terms())), error])
}

/// Terms, model and error of the default fit; where it refuses the data, its words.
fn by_default(u: &[f64], y: &[f64], fresh_u: &[f64], fresh_y: &[f64]) -> [String; 3] {
    let refused = |e: &dyn std::fmt::Display| ["-".to_owned(), e.to_string(), "no model".to_owned()];
    let estimation = match recording("estimation", u, y) {
        Ok(r) => [r],
        Err(e) => return refused(&e),
    };
    let source = Source { recordings: &estimation, inputs: &["u".to_owned()], output: "y" };
    let found = match identify(source, &FitOptions::default(), &|_| {}) {
        Ok(found) => found,
        Err(e) => return refused(&e),
    };
    let error = match found.model.free_run(&Record::siso(fresh_u, fresh_y)) {
        Err(e) => return refused(&e),
        Ok(run) => match run.diverged_at {
            Some(n) => format!("diverges at sample {n} of {}", fresh_u.len()),
            None => format!("{:.4}", measure(fresh_y, &run.y).nrmse(Normaliser::Std)),
        },
    };
    let terms: Vec<String> = found.model.terms().iter().map(|t| found.model.signals().format(t)).collect();
    [terms.len().to_string(), shortened(&terms), error]
}

/// The first ten terms.
fn shortened(terms: &[String]) -> String {
    let shown = in_words(&terms[..terms.len().min(10)]);
    if terms.len() > 10 { format!("{shown}, and {} more", terms.len() - 10) } else { shown }
}
