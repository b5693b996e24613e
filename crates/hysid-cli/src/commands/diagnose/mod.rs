//! `hysid diagnose`: what a simulation leaves out, found from recordings.

mod black_box;
mod intake;

use std::path::PathBuf;
use std::sync::OnceLock;
use std::time::Instant;

use hysid_diagnose::file::VerdictKind;
use hysid_diagnose::{DiagnoseError, Diagnosis, Hooks, Options, Question, Request, diagnose, stand_in};
use hysid_plant::Simulation;

use self::intake::Files;
use super::files::{Intake, different_signals, keep_inputs};
use super::folder::Folder;
use super::simulation_file;
use super::threads::pool;
use crate::failure::Failure;

/// The files that go into the folder of the results.
const PAGE: &str = "report.html";
const AUGMENTED: &str = "augmented.sim.toml";
const DIAGNOSIS: &str = "diagnosis.json";
const NAMES: [&str; 3] = [PAGE, AUGMENTED, DIAGNOSIS];

/// Find what physics a simulation leaves out: where it parts from a recording, a name, a sentence, a better simulation
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The simulation (`NAME.sim.toml`)
    #[arg(required_unless_present = "simulated", conflicts_with = "simulated")]
    simulation: Option<PathBuf>,
    /// Instead of a simulation file: the column that your own simulator wrote
    #[arg(long, value_name = "COLUMN", requires = "input", requires = "output")]
    simulated: Option<String>,
    /// With --simulated: the input's column (repeat for several)
    #[arg(long, value_name = "COLUMN", requires = "simulated")]
    input: Vec<String>,
    /// With --simulated: the measured output's column
    #[arg(long, value_name = "COLUMN", requires = "simulated")]
    output: Option<String>,
    /// Recording to estimate from (repeat for several)
    #[arg(long, value_name = "CSV", required = true)]
    recording: Vec<PathBuf>,
    /// Recording that only scores: nothing is fitted or chosen on it (repeat for several)
    #[arg(long, value_name = "CSV")]
    holdout: Vec<PathBuf>,
    /// Folder for diagnosis.json, report.html and augmented.sim.toml
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Weigh this set of effects too, whatever the search finds: `MECHANISM@SLOT`, several joined by `+` (repeat for several sets)
    #[arg(long, value_name = "EFFECTS")]
    consider: Vec<String>,
    /// Level of the mismatch test
    #[arg(long, default_value_t = 0.01)]
    alpha: f64,
    /// Seed of everything random
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads; all cores unless given. The result does not depend on it
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Answer after about so many seconds with what was found until then; nothing is firm where the search was cut short, and the
    /// result depends on the machine
    #[arg(long, value_name = "SECONDS")]
    time_limit: Option<f64>,
    /// Do without the model without physics that is identified from the same recordings and scored beside the simulation
    #[arg(long)]
    no_black_box: bool,
}

/// Diagnoses and writes the folder; prints the verdict on stdout.
pub fn run(args: &Args) -> Result<(), Failure> {
    if let Some(limit) = args.time_limit
        && !(limit > 0.0 && limit.is_finite())
    {
        return Err(Failure::BadInput(format!("--time-limit is {limit}; allowed is a number of seconds above zero")));
    }
    pool(args.threads)?.install(|| work(args))
}

fn work(args: &Args) -> Result<(), Failure> {
    let began = Instant::now();
    let options = Options { alpha: args.alpha, seed: args.seed };
    let questions = args.consider.iter().map(|text| question(text)).collect::<Result<Vec<_>, _>>()?;
    let progress = |step: &str| eprintln!("hysid: {step} ...");
    let expired = |share: f64| args.time_limit.is_some_and(|limit| began.elapsed().as_secs_f64() > share * limit);
    let black_box = match (args.no_black_box, args.time_limit) {
        (true, _) => BlackBox::LeftOut,
        (false, None) => BlackBox::Beside,
        (false, Some(_)) => BlackBox::Last,
    };
    let watch = Watch { progress: &progress, expired: &expired, black_box };
    let files = Files { estimation: &args.recording, holdout: &args.holdout };
    let inputs = args.simulation.iter().chain(&args.recording).chain(&args.holdout);
    keep_inputs(&args.out, &NAMES, inputs)?;
    let (outcome, folder) = match (&args.simulation, &args.simulated) {
        (Some(file), _) => {
            let (simulation, name) = simulation_file::read(file)?;
            let intake = files.of_simulation(&simulation)?;
            let folder = Folder::claim(&args.out, &NAMES)?;
            (answer(&simulation, &name, (&files, &intake), &questions, options, &watch)?, folder)
        }
        (None, Some(column)) => {
            let output = args.output.clone().unwrap_or_default();
            let inputs = args.input.iter().map(|u| ("--input", u.as_str()));
            let given = inputs.chain([("--output", output.as_str()), ("--simulated", column)]);
            different_signals(&given.collect::<Vec<_>>())?;
            let columns: Vec<String> = args.input.iter().cloned().chain([output.clone(), column.clone()]).collect();
            let intake = files.of_columns(&columns)?;
            let folder = Folder::claim(&args.out, &NAMES)?;
            progress("finding a clone of the simulated column");
            let stand_in = stand_in(&args.input, &output, column, &intake.estimation, args.seed)
                .map_err(|e| Failure::bad_input(files.named_in(e, &intake)))?;
            let mut outcome = answer(&stand_in.simulation, column, (&files, &intake), &questions, options, &watch)?;
            if let Some(moved) = stand_in.moved(&outcome.file.calibrated_parameters) {
                if outcome.file.verdict == VerdictKind::NoSignificantMismatch {
                    outcome.file.summary = format!("{} {moved}", outcome.file.summary);
                    if follows(&outcome) {
                        outcome.file.summary += " This is a parameter error, no missing physics.";
                    }
                } else {
                    outcome.file.notes.insert(0, moved);
                }
            }
            outcome.file.notes.insert(0, stand_in.note);
            (outcome, folder)
        }
        (None, None) => {
            return Err(Failure::BadInput("give a simulation file, or --simulated with --input and --output".into()));
        }
    };

    let page = hysid_report::diagnosis::page(&outcome.file, &outcome.picture, &crate::provenance());
    folder.text(PAGE, &page)?;
    match &outcome.augmented {
        Some(augmented) => folder.text(AUGMENTED, &augmented.to_toml())?,
        None => folder.without(AUGMENTED)?,
    }
    folder.json(DIAGNOSIS, &outcome.file)?;
    println!("{}: {}", outcome.file.verdict.word(), outcome.file.summary);
    for f in &outcome.file.fit {
        if let (Some(before), Some(after)) = (f.rmse_before, f.rmse_after) {
            println!("{} {}: rmse {before:.4e} before, {after:.4e} after", f.recording, f.output);
        }
    }
    Ok(())
}

/// Whether nothing speaks against a simulation in which no mismatch was found: it explains the outputs, as well as a model without any physics does.
fn follows(outcome: &Diagnosis) -> bool {
    outcome.picture.unexplained().is_empty() && outcome.file.fit.iter().all(|f| f.outdone().is_none())
}

/// A set of effects as it is typed: `coulomb_friction@state:v+delay@input:u`.
fn question(text: &str) -> Result<Question, Failure> {
    text.split('+')
        .map(|effect| match effect.trim().split_once('@') {
            Some((mechanism, slot)) if !mechanism.is_empty() && !slot.is_empty() => Ok((mechanism.into(), slot.into())),
            _ => Err(Failure::BadInput(format!(
                "--consider {text}: `{effect}` is not of the form MECHANISM@SLOT, such as coulomb_friction@state:v"
            ))),
        })
        .collect()
}

/// How a diagnosis is followed and limited.
struct Watch<'a> {
    progress: &'a (dyn Fn(&str) + Sync),
    /// Whether this share of the time limit is used up.
    expired: &'a (dyn Fn(f64) -> bool + Sync),
    black_box: BlackBox,
}

/// When the black box is learnt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum BlackBox {
    /// While the search goes on: some steps of either leave processors idle.
    Beside,
    /// After it, if there is time: where time is limited, the search comes first.
    Last,
    /// Never.
    LeftOut,
}

/// The diagnosis, with a black box beside it if one is wanted.
fn answer(
    simulation: &Simulation,
    file: &str,
    (files, intake): (&Files<'_>, &Intake),
    questions: &[Question],
    options: Options,
    watch: &Watch<'_>,
) -> Result<Diagnosis, Failure> {
    let request =
        Request { simulation, file, estimation: &intake.estimation, holdout: &intake.holdout, questions, options };
    let told = || (watch.progress)("identifying a black box for comparison");
    let models: OnceLock<black_box::Models> = OnceLock::new();
    let outcome = rayon::scope(|scope| {
        let beside = || {
            let early = black_box::early(simulation, intake, options.seed);
            if let Some(learn) = early.filter(|_| watch.black_box == BlackBox::Beside) {
                told();
                scope.spawn(|_| {
                    // Nobody else sets it.
                    let _ = models.set(learn());
                });
            }
        };
        let hooks = Hooks { progress: watch.progress, expired: watch.expired, accepted: &beside };
        diagnose(&request, &hooks)
    });
    let mut outcome = outcome.map_err(|e| {
        let why = why(&e, &request);
        let error = files.named_in(e, intake);
        Failure::BadInput(why.map_or_else(|| error.to_string(), |why| format!("{error}: {why}")))
    })?;
    if watch.black_box == BlackBox::LeftOut {
        return Ok(outcome);
    }
    let late = || (watch.expired)(1.0);
    let models = models.into_inner().or_else(|| {
        (!late()).then(|| {
            told();
            black_box::late(&outcome.picture, simulation, intake, options.seed, &late)
        })
    });
    match models {
        Some(models) => black_box::score(&mut outcome.file, models, &outcome.picture, simulation, intake),
        None => outcome.file.notes.push("the time limit left no time for a black box beside the simulation".into()),
    }
    Ok(outcome)
}

/// Of a simulation that diverges, which state or output does.
fn why(error: &DiagnoseError, request: &Request<'_>) -> Option<String> {
    let DiagnoseError::Explodes { recording, .. } = error else { return None };
    let found = request.estimation.iter().find(|r| r.name() == recording)?;
    simulation_file::explosion(request.simulation, found)
}
