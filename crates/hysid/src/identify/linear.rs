//! Linear models of growing lags, refined on their free run: they tell the lags and are the yardstick.

use super::IdentifyError;
use super::compete::PER_TERM;
use super::desk::Desk;
use super::family::{Family, linear};
use super::growth::{Stage, start};

/// A linear model with its lags.
#[derive(Debug, Clone)]
pub(crate) struct Linear {
    pub family: Family,
    pub stage: Stage,
}

/// Lags that are tried where the user has not said.
const LADDER: [usize; 9] = [1, 2, 3, 4, 6, 9, 14, 20, 30];
/// A longer model must lower the held-out error by this share at least.
const WORTH: f64 = 0.05;
/// Within this multiple of the lowest held-out error a linear model is a witness of what the machine endures.
const GOOD: f64 = 2.0;
/// Number of parameters beyond which a linear model is not tried.
const MOST_PARAMETERS: usize = 130;
/// Samples that linear models are fitted to.
const LOOK: usize = 6000;

/// The linear models, by lags; those that no stable start was found for are left out.
pub(crate) fn ladder(desk: &Desk<'_>, progress: &(dyn Fn(&str) + Sync)) -> Result<Vec<Linear>, IdentifyError> {
    let first = desk.options.input_delay.unwrap_or(0);
    let mut found: Vec<Linear> = Vec::new();
    let mut refused = None;
    let mut tried = Vec::new();
    let mut worse = 0;
    for n in LADDER {
        let (ny, nu) = (desk.options.lags_output.unwrap_or(n), desk.options.lags_input.unwrap_or(n).max(first));
        if tried.contains(&(ny, nu)) || (!tried.is_empty() && ny + nu * desk.inputs() > MOST_PARAMETERS) {
            continue;
        }
        tried.push((ny, nu));
        progress(&format!("linear models: lags {ny} and {nu}"));
        let family = Family {
            name: format!("linear, lags {ny} and {nu}"),
            ny,
            nu,
            derived: vec![],
            linear: linear(desk.inputs(), ny, first..=nu),
            candidates: vec![],
        };
        match one(desk, family) {
            Ok(Some(l)) => {
                let best = best(&found).map_or(f64::INFINITY, |b| b.stage.held.rmse);
                worse = if l.stage.held.rmse < (1.0 - WORTH) * best { 0 } else { worse + 1 };
                found.push(l);
            }
            Ok(None) => worse += 1,
            Err(e) => {
                refused = refused.or(Some(e));
                break;
            }
        }
        if worse >= 3 {
            break;
        }
    }
    match refused {
        Some(e) if found.is_empty() => Err(e),
        _ => Ok(found),
    }
}

fn one(desk: &Desk<'_>, family: Family) -> Result<Option<Linear>, IdentifyError> {
    let mut trainer = desk.trainer(&[], family.given())?;
    let s = desk.split(&trainer, LOOK.max(PER_TERM * family.linear.len()))?;
    let stage = start(&mut trainer, &family, &s.search, &s.hold)?;
    Ok(stage.map(|stage| Linear { family, stage }))
}

/// The one with the lowest held-out error.
pub(crate) fn best(found: &[Linear]) -> Option<&Linear> {
    found.iter().min_by(|a, b| a.stage.held.rmse.total_cmp(&b.stage.held.rmse))
}

/// Those whose held-out error is not far from the lowest.
pub(crate) fn good(found: &[Linear]) -> impl Iterator<Item = &Linear> {
    let lowest = best(found).map_or(0.0, |b| b.stage.held.rmse);
    found.iter().filter(move |l| l.stage.held.rmse <= GOOD * lowest)
}

/// The shortest one whose held-out error is near the lowest.
pub(crate) fn shortest_good(found: &[Linear]) -> Option<&Linear> {
    let lowest = best(found)?.stage.held.rmse;
    found.iter().find(|l| l.stage.held.rmse <= (1.0 + WORTH) * lowest)
}
