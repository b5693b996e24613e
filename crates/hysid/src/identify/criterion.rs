//! The number of terms by a criterion of one-step regression, where the user asks for one.
//!
//! Orthogonal forward regression over the winning family's terms on all samples; the criterion decides the length, and the
//! free run only refines the coefficients, where the model free-runs at all.

use hysid_dictionary::{Design, Dictionary, Record};
use hysid_narx::{Bank, Derived, Fit, Refine};

use super::IdentifyError;
use super::desk::Desk;
use super::family::Family;
use super::growth::Stage;
use super::options::Criterion;

/// Terms that a criterion may take, where the user has not said.
const MOST_TERMS: usize = 40;
/// Refinement steps.
const STEPS: usize = 12;
/// Samples on which the coefficients are refined.
const LOOK: usize = 9000;

/// The model that the criterion chooses, with the derived inputs as they were refined; `None` where the free run decides.
pub(crate) fn by_criterion(
    desk: &Desk<'_>,
    family: &Family,
    derived: &[Derived],
) -> Result<Option<Stage>, IdentifyError> {
    let criterion = match desk.options.criterion {
        Criterion::FreeRun => return Ok(None),
        Criterion::Press => hysid_select::Criterion::SearchedPress,
        Criterion::Aic => hysid_select::Criterion::Aic,
        Criterion::Bic => hysid_select::Criterion::Bic,
        Criterion::Err(e) => hysid_select::Criterion::ErrTolerance(e),
    };
    let mut trainer = desk.trainer(derived, family.given())?;
    let windows = desk.split(&trainer, LOOK)?;
    let all = family.linear.iter().chain(&family.candidates).cloned();
    let dictionary = Dictionary::from_terms(trainer.signals().clone(), all)?;
    let records: Vec<Record<'_>> = trainer.banks().iter().map(Bank::record).collect();
    let design = Design::new(&dictionary, &records)?;
    let max_terms = desk.options.terms.unwrap_or(MOST_TERMS);
    let how = hysid_select::Options { criterion, max_terms, ..hysid_select::Options::default() };
    let chosen =
        hysid_select::select(&design, &design.target(), &how).map_err(|e| IdentifyError::Option(e.to_string()))?;
    let fit = Fit {
        terms: chosen.terms.iter().filter_map(|&j| dictionary.terms().get(j).cloned()).collect(),
        theta: chosen.theta,
        derived: derived.to_vec(),
    };
    drop(records);
    let (fit, taught) = trainer.refine(fit, &windows.search, STEPS, Refine::Coefficients)?;
    let held = trainer.error(&fit, &windows.hold)?;
    Ok(Some(Stage { fit, taught, held }))
}
