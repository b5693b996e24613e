//! The user's simulation, calibrated fairly: from every start, and under its own noise as far as that explains no less.

use hysid_plant::Simulation;

use super::global::{MOST_SUBSTEPS, starts};
use crate::error::DiagnoseError;
use crate::evidence::Whitener;
use crate::model::base::Base;
use crate::model::hypothesis::Setting;
use crate::model::{Model, Values};
use crate::request::Request;

/// Error (rms), over that of the calibration, at which a fit under a noise model has given up explaining.
const WORSE: f64 = 1.05;
/// Log likelihood that a calibration may lose to one that needs far shorter steps.
const GENTLER: f64 = 5.0;

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
    for from in &froms {
        let Some(b) = setting.fit(simulation, from, None, 1, 25) else { continue };
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
    let best = polished(setting, best);
    let Some(gentle) = gentler(setting, simulation, &froms, &best) else { return Ok(best) };
    setting.substeps = gentle.model.substeps();
    Ok(gentle)
}

/// The likeliest calibration, from any of these starts, that needs no more steps than accuracy is worth, where `best` needs more and is hardly likelier.
///
/// An overdamped stage may imitate the loop of its piezo by a damping whose fast pole lies far beyond the sampling frequency, where little changes any more
/// but the time of each simulation. With so few steps what is stiffer explodes, so that the fit stays on this side.
fn gentler<'d>(setting: &Setting<'d>, simulation: &Simulation, froms: &[Values], best: &Base<'_>) -> Option<Base<'d>> {
    if setting.substeps <= MOST_SUBSTEPS {
        return None;
    }
    let gentle = Setting { substeps: MOST_SUBSTEPS, ..setting.clone() };
    let found = froms.iter().filter_map(|from| Some(polished(&gentle, gentle.fit(simulation, from, None, 1, 60)?)));
    found
        .max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))
        .filter(|b| b.log_likelihood > best.log_likelihood - GENTLER && explains_no_less(b, best))
}

/// Fitted on under its own noise, twice, where that is likelier and gives nothing up.
fn polished<'d>(setting: &Setting<'d>, base: Base<'d>) -> Base<'d> {
    match setting.further(&base, Some(&base.whitener), 2, 20) {
        Some(p) if p.log_likelihood > base.log_likelihood && explains_no_less(&p, &base) => p,
        _ => base,
    }
}

#[cfg(test)]
mod tests {
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

    /// A stage whose piezo has a loop, which its fast damping imitates.
    #[test]
    fn a_calibration_that_is_hardly_likelier_and_far_stiffer_is_not_taken() {
        let (mut random, mut play, mut low) = (normal(3), 0.0_f64, 0.0);
        let (mut input, mut output) = (Vec::new(), Vec::new());
        for i in 0..1500 {
            let u = 3.0 * (0.021 * f64::from(i)).sin() + 2.0 * (0.049 * f64::from(i)).sin();
            play = play.clamp(u - 1.0, u + 1.0);
            low += 0.5 * (0.8 * u + 0.2 * play - low);
            input.push(u);
            output.push(low + 0.03 * random());
        }
        let stage = "[time]\nperiod_s = 0.001\n[inputs]\nu = \"u_V\"\n\
                     [parameters]\nw = { value = 600.0, min = 160.0, max = 20000.0 }\nz = { value = 0.8, min = 0.1, max = 30.0 }\nk = { value = 0.7, min = 0.1, max = 4.0 }\n\
                     [states]\ny = { derivative = \"v\", initial = 0.0 }\nv = { derivative = \"w^2*(k*u - y) - 2*z*w*v\", initial = 0.0 }\n[outputs]\ny_um = \"y\"\n";
        let original = Simulation::parse(stage, "test.sim.toml").unwrap();
        let data = recorded(&original, 0.001, [("u_V", input), ("y_um", output)]);
        let budget = Budget::new(&|_| false);
        let (mut setting, _) = calibrated(original, &data, NoiseKind::Coloured, &budget);
        setting.substeps = 64;
        let fitted = |from: [f64; 3]| {
            let values = ["w", "z", "k"].map(str::to_owned).into_iter().zip(from).collect();
            setting.fit(&setting.original, &Values { parameters: values, ..Values::default() }, None, 1, 60).unwrap()
        };
        let mut stiff = fitted([10000.0, 7.2, 0.9]);
        let (own, fast) =
            (Values::default(), |b: &Base<'_>| 2.0 * b.values().parameters["z"] * b.values().parameters["w"]);
        let gentle = gentler(&setting, &setting.original, std::slice::from_ref(&own), &stiff).unwrap();
        assert!(fast(&gentle) < 0.5 * fast(&stiff) && gentle.model.substeps() == MOST_SUBSTEPS);
        // What needs no more steps is as it is, and what says far more is kept.
        let own = std::slice::from_ref(&own);
        assert!(gentler(&Setting { substeps: 4, ..setting.clone() }, &setting.original, own, &stiff).is_none());
        stiff.log_likelihood += 2.0 * GENTLER;
        assert!(gentler(&setting, &setting.original, own, &stiff).is_none());
    }
}
