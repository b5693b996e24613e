//! The user's simulation, calibrated fairly: from every start, and under its own noise as far as that explains no less.

use super::global::starts;
use crate::error::DiagnoseError;
use crate::evidence::Whitener;
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

/// A calibrated simulation fitted on from where it is, as this setting has it (other steps, another noise model), from this noise; by plain squares first
/// where the fit gives up under the noise model what the calibration explains.
pub fn recalibrated<'d>(setting: &Setting<'d>, base: &Base<'_>, noise: Option<&Whitener>) -> Option<Base<'d>> {
    let polished = setting.further(base, noise, 2, 20).filter(|b| explains_no_less(b, base));
    polished.or_else(|| setting.further(base, None, 1, 20))
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

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::normal;

    /// A slow sensor behind a gain: samples follow each other, and say of the gain far less than their levels do.
    #[test]
    fn a_calibration_gone_on_with_explains_no_less() {
        let mut random = normal(11);
        let (mut u, mut shown) = (0.0, 0.0);
        let (mut input, mut output) = (Vec::new(), Vec::new());
        for _ in 0..2000 {
            u = 0.995 * u + 0.1 * random();
            shown += 0.03 * (u - shown);
            input.push(u);
            output.push(shown + 0.001 * random());
        }
        let gain = "[time]\nperiod_s = 0.01\n[inputs]\nu = \"u_V\"\n[parameters]\nk = { value = 0.6, min = 0.0, max = 9.0 }\n\
                    [outputs]\ny_m = \"k*u\"\n";
        let original = Simulation::parse(gain, "test.sim.toml").unwrap();
        let data = recorded(&original, 0.01, [("u_V", input), ("y_m", output)]);
        let budget = Budget::new(&|_| false);
        let (setting, plain) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let coloured = Setting { noise: NoiseKind::Coloured, ..setting };
        let noisy = coloured.further(&plain.base, None, 2, 20).unwrap();
        assert!(!explains_no_less(&noisy, &plain.base), "the noise model takes nothing of it");
        let kept = recalibrated(&coloured, &plain.base, None).unwrap();
        assert!(explains_no_less(&kept, &plain.base));
        let gain_of = |b: &Base<'_>| b.values().parameters["k"];
        assert!((gain_of(&kept) - gain_of(&plain.base)).abs() < 1e-6 * gain_of(&plain.base));
    }
}
