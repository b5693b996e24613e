//! What is told of an identification: `fit.json`, and the series that a page draws.

use hysid_dictionary::Record;
use hysid_narx::NarxModel;
use hysid_signal::Recording;
use hysid_signal::tell::digits;
use hysid_validate::{Normaliser, measure};
use serde::Serialize;

use super::{Identified, IdentifyError, PathPoint};

/// Relative difference from a model's sampling period up to which a recording has the same.
const SAME_RATE: f64 = 1e-4;

/// Whether a model that was made at a sampling period of `made` seconds may run on a recording with one of `found`: its terms count samples,
/// not seconds.
pub fn same_rate(made: f64, found: f64) -> bool {
    (found - made).abs() <= SAME_RATE * made
}

/// How often a model that moves in steps of so many samples moves.
pub fn every(samples: usize) -> String {
    if samples == 1 { "every sample".to_owned() } else { format!("every {samples} samples") }
}

/// Which part a recording played.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// The model was made from it.
    Estimation,
    /// The model has never seen it.
    Holdout,
}

/// One term of the model.
#[derive(Debug, Clone, Serialize)]
pub struct TermLine {
    /// As text: `y[n-1]^2*u[n]`.
    pub term: String,
    /// Coefficient.
    pub coefficient: f64,
    /// Its standard error, where it is known.
    pub standard_error: Option<f64>,
    /// Error reduction ratio, one step ahead, in the order of the terms.
    pub err: Option<f64>,
}

/// One term of the noise model, which takes part in one-step predictions only.
#[derive(Debug, Clone, Serialize)]
pub struct NoiseLine {
    /// What multiplies the residual, as text; `1` in a linear noise model.
    pub term: String,
    /// How many steps ago the residual was.
    pub residual_lag: usize,
    /// Coefficient.
    pub coefficient: f64,
}

/// An error over one recording.
#[derive(Debug, Clone, Serialize)]
pub struct ErrorLine {
    /// The recording.
    pub recording: String,
    /// Its part.
    pub role: Role,
    /// Root mean square error in the output's unit, over the samples up to a divergence.
    pub rmse: Option<f64>,
    /// The same over the standard deviation of the recorded output.
    pub relative: Option<f64>,
    /// Samples compared.
    pub samples: usize,
    /// The sample at which the run diverged.
    pub diverged_at: Option<usize>,
}

/// The lags that the model uses.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Lags {
    /// The largest output lag.
    pub output: usize,
    /// The largest input lag.
    pub input: usize,
    /// The smallest input lag.
    pub input_delay: usize,
}

/// How far ahead the model holds on the held-out blocks.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Horizon {
    /// The longest number of steps that was tried and held.
    pub steps: usize,
    /// Whether that is the whole free run.
    pub whole_run: bool,
}

/// `fit.json`.
#[derive(Debug, Clone, Serialize)]
pub struct FitSummary {
    /// `hysid.fit/1`.
    pub schema: &'static str,
    /// Column of the output.
    pub output: String,
    /// Columns of the inputs.
    pub inputs: Vec<String>,
    /// The model as one line.
    pub equation: String,
    /// What the derived inputs are, one sentence each.
    pub derived: Vec<String>,
    /// The terms.
    pub terms: Vec<TermLine>,
    /// The noise model; empty where none pays.
    pub noise: Vec<NoiseLine>,
    /// The model moves in steps of so many samples.
    pub decimation: usize,
    /// Lags.
    pub lags: Lags,
    /// Free-run error of each recording.
    pub free_run: Vec<ErrorLine>,
    /// One-step error of each recording.
    pub one_step: Vec<ErrorLine>,
    /// Free-run error of each recording by the linear model that was identified the same way.
    pub linear_free_run: Vec<ErrorLine>,
    /// The first sample at which a free run diverged, of the first recording where one did.
    pub diverged_at: Option<usize>,
    /// Whether the hold-out errors are of recordings of their own, or of blocks of the estimation recordings.
    pub held_out: String,
    /// Free-run error on the held-out blocks of the estimation recordings, before the final refinement on all samples.
    pub held_out_rmse: f64,
    /// How far ahead the model holds.
    pub horizon: Horizon,
    /// The errors against the number of terms on the path to the model.
    pub path: Vec<PathPoint>,
    /// What was decided and why.
    pub decisions: Vec<String>,
    /// What to be wary of.
    pub warnings: Vec<String>,
    /// The seed.
    pub seed: u64,
}

/// The series of one recording, on its own clock.
#[derive(Debug, Clone)]
pub struct Series {
    /// The recording.
    pub recording: String,
    /// Its part.
    pub role: Role,
    /// Time in seconds.
    pub t: Vec<f64>,
    /// The inputs.
    pub inputs: Vec<Vec<f64>>,
    /// The recorded output.
    pub y: Vec<f64>,
    /// The free run.
    pub free_run: Vec<f64>,
    /// One step ahead.
    pub one_step: Vec<f64>,
    /// The linear model's free run.
    pub linear: Vec<f64>,
}

/// Everything that a page about a fit shows.
#[derive(Debug, Clone)]
pub struct FitReport {
    /// `fit.json`.
    pub summary: FitSummary,
    /// The model as a LaTeX equation.
    pub latex: String,
    /// The series of each recording, estimation first.
    pub series: Vec<Series>,
}

impl FitReport {
    /// The report of `identified` on the recordings it was made from and on those it has never seen.
    ///
    /// # Errors
    /// A recording that lacks a column of the model.
    pub fn new(
        identified: &Identified,
        estimation: &[Recording],
        holdout: &[Recording],
        seed: u64,
    ) -> Result<Self, IdentifyError> {
        let model = &identified.model;
        let (mut free, mut one, mut linear, mut series) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let all = estimation.iter().map(|r| (r, Role::Estimation)).chain(holdout.iter().map(|r| (r, Role::Holdout)));
        for (recording, role) in all {
            let columns = Columns::of(model, recording)?;
            let record = columns.record();
            let run = model.free_run(&record)?;
            let step = model.one_step(&record)?;
            let base = identified.linear.free_run(&record)?;
            let line =
                |y: &[f64], diverged_at: Option<usize>| error_line(recording.name(), role, columns.y, y, diverged_at);
            free.push(line(&run.y, run.diverged_at));
            one.push(line(&step, None));
            linear.push(line(&base.y, base.diverged_at));
            series.push(Series {
                recording: recording.name().to_string(),
                role,
                t: (0..recording.len()).map(|n| recording.clock().time(n)).collect(),
                inputs: columns.inputs.iter().map(|u| u.to_vec()).collect(),
                y: columns.y.to_vec(),
                free_run: run.y,
                one_step: step,
                linear: base.y,
            });
        }
        let parts = model.parts();
        let mut warnings = identified.warnings.clone();
        warnings.extend(holdout.iter().zip(&free[estimation.len()..]).filter_map(|(r, line)| doubt(model, r, line)));
        let known = |x: f64| x.is_finite().then_some(x);
        let inputs = parts.signals.inputs();
        let summary = FitSummary {
            schema: "hysid.fit/1",
            output: parts.signals.output().column.clone(),
            inputs: model.input_columns().iter().map(|c| (*c).to_string()).collect(),
            equation: model.equation(),
            derived: parts
                .derived
                .iter()
                .map(|d| format!("{} is {}", d.symbol, d.law.describe(&inputs[d.source].symbol)))
                .collect(),
            terms: parts
                .coefficients
                .iter()
                .map(|c| TermLine {
                    term: parts.signals.format(&c.term),
                    coefficient: c.theta,
                    standard_error: known(c.standard_error),
                    err: known(c.err),
                })
                .collect(),
            noise: parts
                .noise
                .iter()
                .map(|t| NoiseLine { term: parts.signals.format(&t.term), residual_lag: t.lag, coefficient: t.theta })
                .collect(),
            decimation: parts.decimation,
            lags: lags(model),
            diverged_at: free.iter().find_map(|l| l.diverged_at),
            free_run: free,
            one_step: one,
            linear_free_run: linear,
            held_out: if holdout.is_empty() {
                "blocks of the estimation recordings".into()
            } else {
                "recordings of their own; blocks of the estimation recordings chose the model".into()
            },
            held_out_rmse: identified.held_rmse,
            horizon: identified.horizon,
            path: identified.path.clone(),
            decisions: identified.decisions.clone(),
            warnings,
            seed,
        };
        Ok(Self { summary, latex: model.latex(), series })
    }
}

/// Why the errors on a recording that the model has never seen tell little of it.
fn doubt(model: &NarxModel, holdout: &Recording, line: &ErrorLine) -> Option<String> {
    let (name, found) = (holdout.name(), holdout.clock().period_s);
    match model.parts().period_s {
        Some(made) if !same_rate(made, found) => Some(format!(
            "hold-out {name}: its sampling period is {} s, that of the recordings that the model was made from {} s; the model takes it sample by sample, and its errors there tell nothing",
            digits(found, 6),
            digits(made, 6)
        )),
        _ if line.samples == 0 => Some(format!(
            "hold-out {name}: not one sample could be judged; no stretch of it is longer than the model's past"
        )),
        _ => None,
    }
}

fn error_line(recording: &str, role: Role, y: &[f64], prediction: &[f64], diverged_at: Option<usize>) -> ErrorLine {
    let e = measure(y, prediction);
    let known = |x: f64| x.is_finite().then_some(x);
    ErrorLine {
        recording: recording.into(),
        role,
        rmse: known(e.rmse),
        relative: known(e.nrmse(Normaliser::Std)),
        samples: e.samples,
        diverged_at,
    }
}

fn lags(model: &NarxModel) -> Lags {
    use hysid_dictionary::Signal;
    let (mut output, mut input, mut delay) = (0, 0, usize::MAX);
    for f in model.parts().coefficients.iter().flat_map(|c| c.term.factors()) {
        let reach = f.reach();
        match f.quantity.signal() {
            Signal::Output => output = output.max(reach),
            Signal::Input(_) => {
                input = input.max(reach);
                delay = delay.min(f.lag);
            }
        }
    }
    Lags { output, input, input_delay: if delay == usize::MAX { 0 } else { delay } }
}

/// The columns of one recording that a model needs.
pub struct Columns<'a> {
    /// The output.
    pub y: &'a [f64],
    /// The inputs, in the model's order.
    pub inputs: Vec<&'a [f64]>,
}

impl<'a> Columns<'a> {
    /// The columns that `model` names.
    ///
    /// # Errors
    /// A column that the recording lacks.
    pub fn of(model: &NarxModel, recording: &'a Recording) -> Result<Self, IdentifyError> {
        let column = |name: &str| {
            recording.channel(name).map(|c| c.samples.as_slice()).ok_or_else(|| IdentifyError::MissingColumn {
                recording: recording.name().to_string(),
                column: name.to_string(),
            })
        };
        Ok(Self {
            y: column(&model.signals().output().column)?,
            inputs: model.input_columns().iter().map(|c| column(c)).collect::<Result<_, _>>()?,
        })
    }

    /// The same as the model takes it.
    pub fn record(&self) -> Record<'a> {
        Record::new(self.y, self.inputs.clone())
    }
}
