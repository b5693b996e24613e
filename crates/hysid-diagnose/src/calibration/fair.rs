//! The user's simulation, calibrated fairly: from every start, and under its own noise as far as that explains no less.

use super::global::starts;
use crate::error::DiagnoseError;
use crate::model::base::Base;
use crate::model::hypothesis::Setting;
use crate::model::{Model, Values};
use crate::request::Request;

/// Error (rms), over that of the calibration, at which a fit under a noise model has given up explaining.
const WORSE: f64 = 1.05;

/// Whether a fit under a noise model has not given up explaining what another one explains. Noise of any colour may not explain what the simulation
/// can. Where it is a force through the plant the plain squares are no judge: parameters follow its slow wander, and an effect that is fitted under
/// the noise would win by undoing that.
pub fn explains_no_less(fit: &Base<'_>, than: &Base<'_>) -> bool {
    fit.driven() || fit.unexplained() < WORSE.powi(2) * than.unexplained()
}

/// The user's simulation, calibrated fairly: from the user's values and, where that is not enough, from others within the bounds.
pub fn calibrate<'d>(setting: &mut Setting<'d>, request: &Request<'_>) -> Result<Base<'d>, DiagnoseError> {
    let simulation = request.simulation;
    let bad =
        |e: hysid_plant::Error| DiagnoseError::Simulation { file: request.file.to_owned(), problem: e.to_string() };
    let model = Model::new(simulation, setting.data, setting.substeps).map_err(bad)?;
    let start = model.theta(&Values::default());
    let diverged = model.simulate(&start).1;
    let mut best: Option<Base<'d>> = None;
    let (froms, substeps) = starts(&model, simulation, request.options.seed);
    setting.substeps = substeps;
    for from in froms {
        let Some(b) = setting.fit(simulation, &from, None, 1, 25) else { continue };
        let cost = |b: &Base<'_>| setting.data.relative_squares(&b.fit.residual);
        if best.as_ref().is_none_or(|x| cost(&b) < cost(x)) {
            best = Some(b);
        }
    }
    let Some(best) = best else {
        let (stretch, sample) = diverged.unwrap_or((0, 0));
        let s = &setting.data.stretches[stretch];
        return Err(DiagnoseError::Explodes {
            file: request.file.to_owned(),
            recording: setting.data.recordings[s.recording].clone(),
            at_s: s.start_s + sample as f64 * s.drive.period_s(),
        });
    };
    // Under its own noise, twice.
    let polished = setting.further(&best, Some(&best.whitener), 2, 20);
    Ok(match polished {
        Some(p) if p.log_likelihood > best.log_likelihood && explains_no_less(&p, &best) => p,
        _ => best,
    })
}
