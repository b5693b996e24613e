//! The recipe: families compete on the held-out free run.

use hysid_dictionary::{Factor, Signal, SignalName, Signals};
use hysid_narx::{Coefficient, Derived, Fit, Law, NarxModel, Parts, Refine, Trainer, Window};
use hysid_signal::Recording;

use super::data::{Samples, gather, spread};
use super::family::{self, Atom, Family};
use super::growth::{Budget, Stage, grow, start};
use super::options::{Factors, Options};
use super::split::{Split, split};
use super::{Horizon, IdentifyError};

/// What to learn from: recordings and the names of their columns.
#[derive(Debug, Clone, Copy)]
pub struct Source<'a> {
    /// The estimation recordings.
    pub recordings: &'a [Recording],
    /// Columns of the inputs.
    pub inputs: &'a [String],
    /// Column of the output.
    pub output: &'a str,
}

/// What an identification found.
#[derive(Debug, Clone)]
pub struct Identified {
    /// The model.
    pub model: NarxModel,
    /// The linear model of the same kind, identified and refined the same way, as a yardstick.
    pub linear: NarxModel,
    /// What was decided and why, in order.
    pub decisions: Vec<String>,
    /// What the user should be wary of.
    pub warnings: Vec<String>,
    /// Free-run error on the held-out blocks before the final refinement.
    pub held_rmse: f64,
    /// How far ahead it holds on the held-out blocks.
    pub horizon: Horizon,
    /// The path to the model: number of terms, free-run error on the samples that taught it, and on those held out.
    pub path: Vec<(usize, f64, f64)>,
}

/// Samples that the first round of the competition looks at.
const FIRST_LOOK: usize = 4000;
/// Samples that the second round looks at.
const SECOND_LOOK: usize = 9000;
/// Terms of a model whose number nobody has decided.
const MOST_TERMS: usize = 25;

/// From recordings a model whose free run is good and stable on held-out blocks of them.
///
/// # Errors
/// [`IdentifyError`]: what is wrong with the recordings or the options.
pub fn identify(
    source: Source<'_>,
    options: &Options,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Identified, IdentifyError> {
    if let Some(problem) = options.problem() {
        return Err(IdentifyError::Option(problem));
    }
    let samples = gather(source.recordings, source.inputs, source.output)?;
    let y = spread(samples.iter().flat_map(|s| &s.y)).ok_or(IdentifyError::Nothing("sample"))?;
    let desk = Desk { source, samples: &samples, y_size: y.0.abs() + 10.0 * y.1, options };
    desk.identify(progress)
}

struct Desk<'a> {
    source: Source<'a>,
    samples: &'a [Samples],
    y_size: f64,
    options: &'a Options,
}

impl Desk<'_> {
    fn signals(&self, derived: &[Derived]) -> Result<Signals, IdentifyError> {
        let inputs: Vec<&str> = self.source.inputs.iter().map(String::as_str).collect();
        let base = Signals::from_columns(self.source.output, &inputs).map_err(hysid_narx::NarxError::from)?;
        let mut all = base.inputs().to_vec();
        all.extend(derived.iter().map(|d| SignalName {
            symbol: d.symbol.clone(),
            column: d.symbol.clone(),
            threshold: 0.0,
        }));
        Ok(Signals::new(base.output().clone(), all).map_err(hysid_narx::NarxError::from)?)
    }

    fn trainer(&self, derived: &[Derived], given: usize) -> Result<Trainer, IdentifyError> {
        let records: Vec<_> = self.samples.iter().map(Samples::record).collect();
        Ok(Trainer::new(self.signals(derived)?, derived.to_vec(), &records, given, self.y_size)?)
    }

    fn identify(&self, progress: &(dyn Fn(&str) + Sync)) -> Result<Identified, IdentifyError> {
        let inputs = self.source.inputs.len();
        let mut decisions = Vec::new();
        let first_lag = self.options.input_delay.unwrap_or(0);
        // 1. Linear models.
        let mut linear: Vec<(usize, usize, Stage)> = Vec::new();
        for n in [1usize, 2, 3, 5, 8, 12, 20] {
            let (ny, nu) = (self.options.lags_output.unwrap_or(n), self.options.lags_input.unwrap_or(n));
            if linear.iter().any(|l| (l.0, l.1) == (ny, nu)) {
                continue;
            }
            let given = ny.max(nu) + 2;
            let mut trainer = self.trainer(&[], given)?;
            let s = split(&trainer.whole_windows(), given, FIRST_LOOK);
            let family = Family {
                name: "linear".into(),
                ny,
                nu,
                derived: vec![],
                linear: family::linear(inputs, ny, first_lag..=nu),
                candidates: vec![],
            };
            progress(&format!("linear models: lags {ny} and {nu}"));
            let Ok(Some(stage)) = start(&mut trainer, &family, &s.search, &s.hold) else { continue };
            decisions.push(format!(
                "linear, lags {ny} and {nu}: held-out free run {:.5e}, taught {:.5e}",
                stage.held.rmse, stage.taught.rmse
            ));
            let hopeless = linear.last().is_some_and(|l| stage.held.rmse > 0.98 * l.2.held.rmse) && n > 5;
            linear.push((ny, nu, stage));
            if hopeless {
                break;
            }
        }
        let best = linear.iter().map(|l| l.2.held.rmse).fold(f64::INFINITY, f64::min);
        let Some((ny, nu, _)) = linear.iter().find(|l| l.2.held.rmse <= 1.05 * best) else {
            return Err(IdentifyError::Nothing("stable linear model"));
        };
        // 2. Families.
        let mut lags = vec![(2, 2), (3, 3), (5, 5)];
        if self.options.lags_output.is_some() || self.options.lags_input.is_some() {
            lags = vec![(*ny, *nu)];
        } else if !lags.contains(&(*ny, *nu)) {
            lags.push((*ny, *nu));
        }
        let mut families = Vec::new();
        for (ny, nu) in lags {
            families.extend(self.families(ny, nu, first_lag));
        }
        let mut first: Vec<(Family, Stage, Split)> = Vec::new();
        for family in families {
            progress(&format!("family {} of {}", first.len() + 1, family.name));
            let given = family.ny.max(family.nu) + 2;
            let mut trainer = self.trainer(&family.derived, given)?;
            let s = split(&trainer.whole_windows(), given, FIRST_LOOK);
            let Some(stage) = start(&mut trainer, &family, &s.search, &s.hold)? else { continue };
            let budget = Budget { terms: family.linear.len() + 8, patience: 8, steps: 4 };
            let t = std::time::Instant::now();
            let path = grow(&mut trainer, &family, stage, &s.search, &s.hold, budget, Refine::Coefficients)?;
            let Some(best) = path.into_iter().min_by(|a, b| a.held.rmse.total_cmp(&b.held.rmse)) else { continue };
            decisions.push(format!(
                "{}: {} candidates, first look {} terms, held-out {:.5e} taught {:.5e}",
                family.name,
                family.candidates.len(),
                best.fit.terms.len(),
                best.held.rmse,
                best.taught.rmse
            ));
            first.push((family, best, s));
        }
        first.sort_by(|a, b| a.1.held.rmse.total_cmp(&b.1.held.rmse));
        first.truncate(2);
        // 3. Grow on.
        let mut chosen: Option<(Family, Stage)> = None;
        for (family, stage, _) in first {
            let given = family.ny.max(family.nu) + 2;
            let mut trainer = self.trainer(&family.derived, given)?;
            let s = split(&trainer.whole_windows(), given, SECOND_LOOK);
            let most = self.options.terms.unwrap_or(MOST_TERMS.max(family.linear.len() + 12));
            let budget = Budget { terms: most, patience: 6, steps: 6 };
            progress(&format!("growing {}", family.name));
            let t = std::time::Instant::now();
            let (fit, taught) = trainer.refine(stage.fit, &s.search, 8, Refine::Coefficients)?;
            let held = trainer.error(&fit, &s.hold)?;
            let path = grow(
                &mut trainer,
                &family,
                Stage { fit, taught, held },
                &s.search,
                &s.hold,
                budget,
                Refine::Coefficients,
            )?;
            let lowest = path.iter().map(|p| p.held.rmse).fold(f64::INFINITY, f64::min);
            let Some(pick) = path.into_iter().find(|p| p.held.rmse <= 1.01 * lowest) else { continue };
            decisions.push(format!(
                "{}: second look {} terms, held-out {:.5e} taught {:.5e}",
                family.name,
                pick.fit.terms.len(),
                pick.held.rmse,
                pick.taught.rmse
            ));
            if chosen.as_ref().is_none_or(|c| pick.held.rmse < c.1.held.rmse) {
                chosen = Some((family, pick));
            }
        }
        let Some((family, stage)) = chosen else { return Err(IdentifyError::Nothing("stable model")) };
        // 4. Everything.
        let given = family.ny.max(family.nu) + 2;
        let mut trainer = self.trainer(&family.derived, given)?;
        let whole = trainer.whole_windows();
        progress("refining on all samples");
        let (fit, error) = trainer.refine(stage.fit.clone(), &whole, 8, Refine::CoefficientsAndDerived)?;
        decisions.push(format!("refined on everything: {:.5e}", error.rmse));
        let held_rmse = stage.held.rmse;
        let model = self.model(&mut trainer, fit, &whole)?;
        let (lny, lnu, lstage) =
            linear.iter().min_by(|a, b| a.2.held.rmse.total_cmp(&b.2.held.rmse)).expect("checked above");
        let mut trainer = self.trainer(&[], lny.max(lnu) + 2)?;
        let whole = trainer.whole_windows();
        let (fit, _) = trainer.refine(lstage.fit.clone(), &whole, 10, Refine::Coefficients)?;
        let linear = self.model(&mut trainer, fit, &whole)?;
        let horizon = Horizon { steps: 0, whole_run: false };
        Ok(Identified { model, linear, decisions, warnings: vec![], held_rmse, horizon, path: vec![] })
    }

    fn model(&self, trainer: &mut Trainer, fit: Fit, windows: &[Window]) -> Result<NarxModel, IdentifyError> {
        let errors = trainer.standard_errors(&fit, windows)?;
        let coefficients = fit
            .terms
            .iter()
            .zip(&fit.theta)
            .zip(errors)
            .map(|((t, &theta), standard_error)| Coefficient { term: t.clone(), theta, standard_error, err: f64::NAN })
            .collect();
        let clock = self.source.recordings.first().map(|r| r.clock().period_s);
        Ok(NarxModel::new(Parts {
            signals: trainer.signals().clone(),
            derived: fit.derived,
            coefficients,
            noise: vec![],
            limit: self.y_size,
            period_s: clock,
            decimation: 1,
        })?)
    }

    fn families(&self, ny: usize, nu: usize, first_lag: usize) -> Vec<Family> {
        let inputs = self.source.inputs.len();
        let degree = self.options.degree.unwrap_or(3);
        let linear = family::linear(inputs, ny, first_lag..=nu);
        let (nyn, nun) = (ny.min(5), nu.min(5));
        let atoms = family::lag_atoms(inputs, nyn, first_lag..=nun);
        let fitted = |mut atoms: Vec<Atom>, limit: usize| {
            while family::count(atoms.len(), degree) > limit && atoms.len() > 3 {
                atoms.pop();
            }
            atoms
        };
        let mut out = Vec::new();
        let make = |name: String, derived: Vec<Derived>, atoms: Vec<Atom>| Family {
            name,
            ny,
            nu,
            derived,
            linear: linear.clone(),
            candidates: family::products(&atoms, degree),
        };
        if self.options.factors != Factors::Hysteresis {
            out.push(make(format!("polynomial, lags {ny} and {nu}"), vec![], fitted(atoms.clone(), 700)));
        }
        if self.options.factors != Factors::Polynomial && ny <= 3 {
            let mut extra: Vec<Atom> = Vec::new();
            for i in 0..inputs {
                extra.extend(family::reversal_atoms(Signal::Input(i), first_lag));
            }
            let mut with = extra;
            with.extend(atoms.clone());
            out.push(make(format!("input reversals, lags {ny} and {nu}"), vec![], fitted(with, 500)));
            let mut with: Vec<Atom> = (1..=2).flat_map(|l| family::reversal_atoms(Signal::Output, l)).collect();
            with.extend(atoms.clone());
            out.push(make(format!("output reversals, lags {ny} and {nu}"), vec![], fitted(with, 500)));
            let mut derived = Vec::new();
            let mut with: Vec<Atom> = Vec::new();
            for i in 0..inputs {
                let std = spread(self.samples.iter().flat_map(|s| &s.inputs[i])).map_or(1.0, |s| s.1);
                for share in [0.05, 0.2, 0.8] {
                    let symbol = format!("w{}", derived.len() + 1);
                    with.push(vec![Factor::value(Signal::Input(inputs + derived.len()), first_lag)]);
                    derived.push(Derived { symbol, source: i, law: Law::Dahl { length: share * std } });
                }
            }
            for i in 0..inputs {
                with.extend(family::reversal_atoms(Signal::Input(i), first_lag));
            }
            with.extend(family::lag_atoms(inputs, nyn.min(2), first_lag..=nun.min(2)));
            out.push(make(format!("presliding, lags {ny} and {nu}"), derived, fitted(with, 500)));
        }
        out
    }
}
