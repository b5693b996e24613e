//! Whether a fit has come to rest in the lowest valley: it begins again beside where it stands.
//!
//! A machine that jumps from one motion to another (over a ripple, against a stop, through play) answers a little change of a parameter by a motion that goes
//! the other way for a while. The error is then rough at the scale of a standard deviation, and the first minimum that a fit comes to is one of many.

use nalgebra::DMatrix;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::finish::likelier;
use crate::budget::Step;
use crate::model::Values;
use crate::model::base::Base;
use crate::model::hypothesis::{Hypothesis, Setting};
use crate::random::generator;
use crate::refit::Problem;

/// Standard deviations, of all unknowns together, at which fits begin.
const AWAY: [f64; 6] = [1.0, 1.0, 2.0, 2.0, 4.0, 4.0];
/// Stream of the random directions.
const STREAM: u64 = 0x5348_414b << 16;
/// Iterations of a fit before it is asked whether it comes near.
const ITERATIONS: usize = 6;
/// Log likelihood by which it may trail by then, and what it must gain in the end.
const NEAR: f64 = 10.0;
const WORTH: f64 = 0.5;
/// Further sets that are shaken where the likeliest gained by it, and the log evidence by which they may trail it before: what stands beside it must have
/// the same chance. One that comes back to where it was has a smooth error.
const FURTHER: (usize, f64) = (2, 6.0);

/// Takes the likeliest set of effects of a pool to the lowest minimum that fits from beside it come to; and those near it, where it was not there.
pub fn shake<'d>(setting: &Setting<'d>, pool: &mut [Hypothesis<'d>], seed: u64) {
    let mut likeliest: Vec<&mut Hypothesis<'d>> = pool.iter_mut().filter(|h| !h.effects.is_empty()).collect();
    likeliest.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    let mut likeliest = likeliest.into_iter();
    let Some(best) = likeliest.next() else { return };
    let near = best.log_evidence - FURTHER.1;
    if take_lower(setting, best, seed) {
        for h in likeliest.take(FURTHER.0).filter(|h| h.log_evidence > near) {
            take_lower(setting, h, seed);
        }
    }
}

/// Takes a set to where [`lower`] leads; whether it leads anywhere.
fn take_lower<'d>(setting: &Setting<'d>, h: &mut Hypothesis<'d>, seed: u64) -> bool {
    let Some(base) = lower(setting, &h.base, seed) else { return false };
    h.base = base;
    h.log_evidence = setting.evidence(&h.base);
    true
}

/// The likeliest fit of the same simulation from beside a fit, where it gains something.
fn lower<'d>(setting: &Setting<'d>, fit: &Base<'d>, seed: u64) -> Option<Base<'d>> {
    let noise = Some(&fit.whitener);
    let from_there = |from: Values| {
        if setting.budget.omits(Step::Fits) {
            return None;
        }
        let base = setting.fit(fit.model.simulation(), &from, noise, 1, ITERATIONS)?;
        if base.log_likelihood < fit.log_likelihood - NEAR {
            return None;
        }
        Some(likelier(&base, setting.further(&base, noise, 1, setting.iterations)).unwrap_or(base))
    };
    let found: Vec<Base<'d>> = beside(fit, seed).into_par_iter().filter_map(from_there).collect();
    let best = found.into_iter().max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
    best.filter(|b| b.log_likelihood > fit.log_likelihood + WORTH)
}

/// Values beside those of a fit, in the directions of its covariance.
fn beside(base: &Base<'_>, seed: u64) -> Vec<Values> {
    let k = base.fit.theta.len();
    let covariance = base.covariance();
    let seen: Vec<usize> = (0..k).filter(|&i| covariance[i + k * i] > 0.0).collect();
    let m = seen.len();
    let scale: Vec<f64> = seen.iter().map(|&i| covariance[i + k * i].sqrt()).collect();
    // Unknowns that the recording does not part have a correlation of one to rounding.
    let correlation = DMatrix::from_fn(m, m, |a, b| {
        covariance[seen[a] + k * seen[b]] / (scale[a] * scale[b]) + if a == b { 1e-9 } else { 0.0 }
    });
    let Some(factor) = correlation.cholesky().map(|c| c.l()) else { return Vec::new() };
    let bounds = base.model.bounds();
    (AWAY.iter().enumerate())
        .map(|(i, away)| {
            let mut random = generator(seed, STREAM | i as u64);
            let z: Vec<f64> = (0..m).map(|_| StandardNormal.sample(&mut random)).collect();
            let mut theta = base.fit.theta.clone();
            for a in 0..m {
                let along: f64 = (0..=a).map(|b| factor[(a, b)] * z[b]).sum();
                let (low, high) = bounds[seen[a]];
                theta[seen[a]] = (theta[seen[a]] + away * scale[a] * along).clamp(low, high);
            }
            base.model.values(&theta)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{PERIOD, REAL, normal, respond, rms};

    /// The residual (rms, over that of the noise) of an oscillator on a ripple of 5 cm under a sine, fitted from a stiffness that is wrong by this factor, and
    /// what it is after the fit was shaken; the same where nothing was gained.
    fn shaken(amplitude: f64, factor: f64) -> [f64; 2] {
        let period = 0.05;
        let text = format!(
            "[time]\nperiod_s = {PERIOD}\n[inputs]\nu = \"u_N\"\n[parameters]\nm = {{ value = 1.0, fixed = true }}\nc = {{ value = 2.0, min = 0.1, max = 20.0 }}\n\
             k = {{ value = {}, min = 10.0, max = 400.0 }}\na = {{ value = {amplitude}, min = 0.0, max = 9.0 }}\np = {{ value = {period}, min = 1e-3, max = 1.0 }}\n\
             [states]\nx = {{ derivative = \"v\", initial = 0.0 }}\nv = {{ derivative = \"(u - c*v - k*x - a*sin(2*pi*x/p))/m\", initial = 0.0 }}\n[outputs]\nx_m = \"x\"\n",
            factor * REAL.2
        );
        let original = Simulation::parse(&text, "test.sim.toml").unwrap();
        let mut random = normal(7);
        let u: Vec<f64> = (0..1000).map(|i| 10.0 * (0.13 * f64::from(i)).sin()).collect();
        let mut y = respond(&u, REAL, |x, _| amplitude * (std::f64::consts::TAU * x / period).sin());
        let noise = 0.02 * rms(&y);
        y.iter_mut().for_each(|y| *y += noise * random());
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let left = |base: &Base<'_>| rms(&base.fit.residual) / noise;
        [left(&none.base), lower(&setting, &none.base, 1).map_or(left(&none.base), |found| left(&found))]
    }

    #[test]
    fn a_fit_that_came_to_rest_in_a_rough_error_is_shaken_out_of_it() {
        let [before, after] = shaken(1.0, 0.97);
        assert!(before > 3.0 && after < 1.1, "{after} for {before}");
        // Where it came to the lowest valley by itself there is nothing to gain.
        for (amplitude, factor) in [(1.0, 1.05), (0.3, 0.97)] {
            let [before, after] = shaken(amplitude, factor);
            assert!(before < 1.1 && after == before, "{after} for {before}");
        }
    }
}
