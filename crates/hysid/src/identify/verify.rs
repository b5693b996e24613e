//! How far the model holds, and what its user should be wary of.

use hysid_narx::{Fit, Window};
use hysid_signal::tell::counted;

use super::desk::Desk;
use super::family::Family;
use super::growth::Stage;
use super::linear::Linear;
use super::{Horizon, IdentifyError};

/// A horizon holds where the error at its end is below this share of the output's standard deviation.
const HOLDS: f64 = 0.2;
/// Horizons that are tried.
const HORIZONS: [usize; 10] = [1, 3, 10, 30, 100, 300, 1000, 3000, 10_000, 30_000];
/// Starts for each horizon, at most.
const STARTS: usize = 40;

/// The longest horizon at whose end the error on the held-out blocks is small.
pub(crate) fn horizon(desk: &Desk<'_>, family: &Family, stage: &Stage) -> Result<Horizon, IdentifyError> {
    let given = family.given();
    let mut trainer = desk.trainer(&stage.fit.derived, given)?;
    let hold = desk.split(&trainer, usize::MAX / 8)?.hold;
    let whole_run = stage.held.rmse <= HOLDS * desk.y.std;
    let mut steps = 0;
    for h in HORIZONS {
        let length = given + h;
        let room: usize = hold.iter().map(|w| w.range.len().saturating_sub(length - 1)).sum();
        if room == 0 {
            break;
        }
        let every = (room / STARTS).max(1);
        let windows: Vec<Window> = hold
            .iter()
            .flat_map(|w| {
                let last = w.range.end.saturating_sub(length);
                (w.range.start..=last).step_by(every).map(|s| Window { record: w.record, range: s..s + length })
            })
            .filter(|w| w.range.len() == length)
            .collect();
        let errors = trainer.last_errors(&stage.fit, &windows)?;
        if errors.is_empty() {
            break;
        }
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        if !(rms <= HOLDS * desk.y.std) {
            break;
        }
        steps = h * desk.decimation;
    }
    Ok(Horizon { steps, whole_run })
}

/// Warnings, a sentence each.
pub(crate) fn warnings(
    desk: &Desk<'_>,
    family: &Family,
    stage: &Stage,
    fit: &Fit,
    linear: &Linear,
    horizon: Horizon,
) -> Result<Vec<String>, IdentifyError> {
    let mut out = Vec::new();
    let relative = stage.held.rmse / desk.y.std;
    if !horizon.whole_run {
        out.push(format!(
            "the free run is off by {:.0} % of the output's standard deviation on held-out blocks; predictions hold for about {} samples ahead",
            100.0 * relative,
            horizon.steps
        ));
    }
    if !(stage.held.rmse < 0.98 * linear.stage.held.rmse) {
        out.push("no model beat the linear one on held-out blocks: the recordings show no nonlinearity that helps a free run".into());
    }
    let failed = desk.failed_trials(fit, family.given())?;
    if failed > 0.0 {
        out.push(format!(
            "in {:.0} % of trials with the input held, halved or enlarged by a quarter the run leaves the range of the recordings; keep to inputs like those of the recordings",
            100.0 * failed
        ));
    }
    let mut periods: Vec<f64> = desk.source.recordings.iter().map(|r| r.clock().period_s).collect();
    periods.sort_by(f64::total_cmp);
    if let (Some(a), Some(b)) = (periods.first(), periods.last())
        && b / a > 1.01
    {
        out.push(format!(
            "the recordings have different sampling periods ({a} s to {b} s); the model takes them sample by sample"
        ));
    }
    let gaps: usize = desk.samples.iter().map(|s| s.record().gap_free().len().saturating_sub(1)).sum();
    if gaps > 0 {
        out.push(format!("the recordings have {}; each gap-free stretch is used on its own", counted(gaps, "gap")));
    }
    Ok(out)
}
