//! Intake: the recordings of a request, checked, as one data set to fit and one that only scores.

use std::collections::BTreeSet;

use hysid_signal::rows_seen;

use super::{DataSet, held_out_blocks};
use crate::error::DiagnoseError;
use crate::mechanism::mechanism;
use crate::request::{Hooks, Request};
use crate::slot::Structure;

/// Most samples that the search works on as they are. What a simulation remembers at the start of a window is unknown, so that only a recording that
/// no search can afford is cut.
const MOST_WHOLE: usize = 26_000;

/// Most samples in the windows of a longer one: a search costs what it reads, and its time is limited.
const MOST_IN_WINDOWS: usize = 12_000;

/// What a diagnosis works on.
pub struct Intake {
    /// To calibrate, search and judge on: in windows where the recordings are long, each row a sample.
    pub whole: DataSet,
    /// The hold-out: scores, and nothing else.
    pub held: DataSet,
    /// What was done to the recordings, for people.
    pub notes: Vec<String>,
}

/// Reads a request.
///
/// # Errors
/// A level that is none, an output that nothing moves, recordings that do not fit the simulation, a hold-out that was to be fitted.
pub fn intake(request: &Request<'_>, hooks: &Hooks<'_>) -> Result<Intake, DiagnoseError> {
    let alpha = request.options.alpha;
    if !(alpha > 0.0 && alpha < 0.5) {
        return Err(DiagnoseError::Option {
            option: "--alpha",
            given: alpha.to_string(),
            allowed: "above 0 and below 0.5",
        });
    }
    let simulation = request.simulation;
    dead_outputs(request)?;
    questions(request)?;
    (hooks.progress)("reading the recordings");
    let free = simulation.parameters.iter().filter(|p| !p.fixed).count();
    let all = DataSet::new(simulation, request.estimation, free)?;
    let (full, held) = if request.holdout.is_empty() {
        split_blocks(&all)
    } else {
        never_seen(request)?;
        (all, DataSet::new(simulation, request.holdout, 0)?)
    };
    let mut notes = full.notes.clone();
    if request.holdout.is_empty() {
        notes.push("no hold-out recording was given: blocks of the recordings were held out and score the fit".into());
    }
    let whole = if full.samples() > MOST_WHOLE { full.within(MOST_IN_WINDOWS) } else { full };
    let fresh: Vec<String> = whole.notes.iter().filter(|n| !notes.contains(n)).cloned().collect();
    notes.extend(fresh);
    Ok(Intake { whole, held, notes })
}

/// Nothing is chosen on a hold-out, so that it must not be learnt from.
fn never_seen(request: &Request<'_>) -> Result<(), DiagnoseError> {
    for h in request.holdout {
        for e in request.estimation {
            if let Some(rows) = rows_seen(h, e) {
                let (recording, learnt) = (h.name().to_owned(), e.name().to_owned());
                return Err(DiagnoseError::SeenBefore { recording, learnt, rows });
            }
        }
    }
    Ok(())
}

/// What is asked must be of the catalogue, and the simulation must have a place for it.
fn questions(request: &Request<'_>) -> Result<(), DiagnoseError> {
    let structure = Structure::of(request.simulation);
    for (id, label) in request.questions.iter().flatten() {
        let why = match mechanism(id) {
            None => format!(
                "no mechanism is called `{id}`; `docs/catalogue.md` lists them, write MECHANISM@SLOT such as coulomb_friction@state:v"
            ),
            Some(m) => {
                let places: Vec<&str> =
                    structure.slots.iter().filter(|s| m.fits(s)).map(|s| s.label.as_str()).collect();
                if places.contains(&label.as_str()) {
                    continue;
                }
                let where_else = match places.as_slice() {
                    [] => "nowhere in this simulation".to_owned(),
                    some => format!("here it can at {}", some.join(", ")),
                };
                format!("`{id}` cannot stand at `{label}`; {where_else}")
            }
        };
        return Err(DiagnoseError::Question { asked: format!("{id}@{label}"), why });
    }
    Ok(())
}

/// An output that nothing moves cannot be diagnosed.
fn dead_outputs(request: &Request<'_>) -> Result<(), DiagnoseError> {
    for o in &request.simulation.outputs {
        let symbols = o.expression.symbols();
        let alive = symbols.iter().any(|s| {
            request.simulation.state(s).is_some()
                || request.simulation.input(s).is_some()
                || s == "t"
                || request.simulation.parameter(s).is_some()
        });
        if !alive {
            return Err(DiagnoseError::DeadOutput { file: request.file.to_owned(), column: o.column.clone() });
        }
    }
    Ok(())
}

/// Blocks of the estimation recordings as hold-out.
fn split_blocks(all: &DataSet) -> (DataSet, DataSet) {
    let weights = held_out_blocks(&all.layout, &all.y);
    let mut out = BTreeSet::new();
    for s in &all.layout.series {
        for (n, row) in s.rows.clone().enumerate() {
            if weights[row] == 0.0 {
                out.insert((s.stretch, s.first + n));
            }
        }
    }
    (all.keep(|s, n, _| !out.contains(&(s, n))), all.keep(|s, n, _| out.contains(&(s, n))))
}
