//! Noise terms for one-step predictions: what the one-step residuals of the finished model say of each other.
//!
//! A model that is refined on its free run has coloured one-step residuals where the output carries noise. Past residuals
//! then predict the next one. Linear noise models of a few lengths are tried beside the process model, which stays as it is;
//! one is kept where it lowers the one-step error on the held-out blocks by more than chance. The free run knows no residuals
//! and does not change. Reference: Billings, *Nonlinear System Identification* (2013), section 3.6.

use hysid_dictionary::Term;
use hysid_narx::{Fit, Law, NarxModel, NoiseTerm, Parts, Trainer, Window};

use super::IdentifyError;
use super::desk::{Desk, within_chance};

/// Lengths that are tried, in residuals.
const LENGTHS: [usize; 4] = [1, 2, 4, 8];
/// Samples that a noise model is made from.
const LOOK: usize = 9000;
/// The one-step error must fall by this share at least.
const WORTH: f64 = 0.02;

/// The model with noise terms where they pay, and what was found.
pub(crate) fn with_noise(desk: &Desk<'_>, model: NarxModel, fit: &Fit) -> Result<(NarxModel, String), IdentifyError> {
    let mut trainer = desk.trainer(&fit.derived, model.reach())?;
    let windows = desk.split(&trainer, LOOK)?;
    let before = parts(desk, &model, &[], &windows.hold)?;
    let (mut best, mut noise) = (before.clone(), Vec::new());
    for length in LENGTHS {
        let Some(trial) = noise_terms(&mut trainer, fit, length, &windows.search)? else { continue };
        let errors = parts(desk, &model, &trial, &windows.hold)?;
        if mean(&errors) < (1.0 - WORTH).powi(2) * mean(&best) && !within_chance(&best, &errors) {
            (best, noise) = (errors, trial);
        }
    }
    let (from, to) = (mean(&before).sqrt(), mean(&best).sqrt());
    if noise.is_empty() {
        let note = format!("no noise model lowers the held-out one-step error of {from:.4e} by more than chance");
        return Ok((model, note));
    }
    let note = format!(
        "a noise model of {} residuals lowers the held-out one-step error from {from:.4e} to {to:.4e}",
        noise.len()
    );
    Ok((NarxModel::new(Parts { noise, ..model.parts().clone() })?, note))
}

/// A noise model of this length whose residuals can be computed from the recording without growing.
fn noise_terms(
    trainer: &mut Trainer,
    fit: &Fit,
    length: usize,
    windows: &[Window],
) -> Result<Option<Vec<NoiseTerm>>, IdentifyError> {
    let lags: Vec<(Term, usize)> = (1..=length).map(|lag| (Term::constant(), lag)).collect();
    let Ok(found) = trainer.noise_terms(fit, &lags, windows) else { return Ok(None) };
    let a: Vec<f64> = found.iter().map(|t| t.theta).collect();
    Ok((Law::Filter { a }).problem().is_none().then_some(found))
}

/// The mean squared one-step error on parts of the held-out blocks.
fn parts(desk: &Desk<'_>, model: &NarxModel, noise: &[NoiseTerm], hold: &[Window]) -> Result<Vec<f64>, IdentifyError> {
    // The desk's samples are at the model's rate already.
    let at_rate = NarxModel::new(Parts { noise: noise.to_vec(), decimation: 1, ..model.parts().clone() })?;
    let predicted: Vec<Vec<f64>> =
        desk.samples.iter().map(|s| at_rate.one_step(&s.record())).collect::<Result<_, _>>()?;
    let residuals = hold.iter().map(|w| {
        let y = &desk.samples[w.record].y;
        w.range.clone().map(|n| y[n] - predicted[w.record][n]).collect()
    });
    Ok(super::desk::mean_squares(residuals.collect()))
}

fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len().max(1) as f64
}
