//! The step of a quantised signal, with or without noise on top of the steps.
//!
//! Values on a grid repeat themselves. Where noise was added behind the quantiser none does, but the mean of `exp(2 pi i y/q)` over the
//! samples (the empirical characteristic function at the grid's frequency) stands out: it is `exp(-2 (pi sigma/q)^2)` there, and next to nothing
//! where a smooth distribution covers many steps.
//!
//! Reference: B. Widrow, I. Kollár, Quantization Noise, Cambridge University Press (2008), ch. 4.

use std::f64::consts::TAU;

/// Steps that the signal must cover at least: a smooth distribution has a characteristic function of its own below that.
const FEWEST: f64 = 6.0;
/// Steps that it may cover at most: finer ones do not matter beside any noise.
const MOST: f64 = 400.0;
/// Points of the search for each step that the signal may cover.
const DENSITY: f64 = 4.0;
/// Size of the characteristic function that a grid shows at least.
const VISIBLE: f64 = 0.3;
/// Times the median over all steps that it must stand out.
const ABOVE: f64 = 5.0;

/// The step of these values; `None` where they show none.
pub fn resolution(values: &[f64]) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    // A converter behind the noise has steps of its own, which are finer.
    match (repeated(&sorted), blurred(&sorted)) {
        (Some(fine), Some(coarse)) if coarse < 3.0 * fine => Some(fine),
        (fine, coarse) => coarse.or(fine),
    }
}

/// The smallest step between sorted values that repeat themselves.
fn repeated(sorted: &[f64]) -> Option<f64> {
    let mut values = sorted.to_vec();
    values.dedup();
    // A series of continuous values has next to no repetitions.
    if sorted.len() < 50 || values.len() * 3 > sorted.len() {
        return None;
    }
    let mut gaps: Vec<f64> = values.windows(2).filter_map(|w| Some(w.get(1)? - w.first()?)).collect();
    gaps.sort_by(f64::total_cmp);
    // The smallest gap, averaged over those that are the same step written with few digits.
    let first = *gaps.first()?;
    let median = *gaps.get(gaps.len() / 2)?;
    let step = if median < 1.5 * first { median } else { first };
    (step > 0.0).then_some(step)
}

/// The step that sorted values with noise on top of it cluster at.
fn blurred(sorted: &[f64]) -> Option<f64> {
    let range = sorted.last()? - sorted.first()?;
    if sorted.len() < 200 || range <= 0.0 {
        return None;
    }
    let points = ((MOST - FEWEST) * DENSITY) as usize;
    let spacing = 1.0 / (DENSITY * range);
    // Turned by the same angle from one frequency to the next: one product of complex numbers for each.
    let turns: Vec<(f64, f64)> = sorted.iter().map(|v| (TAU * v * spacing).sin_cos()).map(|(s, c)| (c, s)).collect();
    let mut now: Vec<(f64, f64)> =
        sorted.iter().map(|v| (TAU * v * FEWEST / range).sin_cos()).map(|(s, c)| (c, s)).collect();
    let mut sizes = Vec::with_capacity(points);
    for _ in 0..points {
        let (mut re, mut im) = (0.0, 0.0);
        for (n, t) in now.iter_mut().zip(&turns) {
            re += n.0;
            im += n.1;
            *n = (n.0 * t.0 - n.1 * t.1, n.0 * t.1 + n.1 * t.0);
        }
        sizes.push(f64::hypot(re, im) / sorted.len() as f64);
    }
    let best = (0..points).max_by(|a, b| sizes[*a].total_cmp(&sizes[*b]))?;
    let mut ordered = sizes.clone();
    ordered.sort_by(f64::total_cmp);
    if sizes[best] < VISIBLE || sizes[best] < ABOVE * ordered[points / 2] {
        return None;
    }
    // The peak is as wide as the search's spacing; the size is searched to a thousandth of it.
    let size = |f: f64| {
        let (re, im) = sorted.iter().fold((0.0, 0.0), |(re, im), v| {
            let (s, c) = (TAU * v * f).sin_cos();
            (re + c, im + s)
        });
        f64::hypot(re, im)
    };
    let mut at = FEWEST / range + best as f64 * spacing;
    let mut step = 0.5 * spacing;
    while step > 5e-4 * spacing {
        let here = size(at);
        let better = [at - step, at + step].into_iter().find(|f| size(*f) > here);
        match better {
            Some(f) => at = f,
            None => step *= 0.5,
        }
    }
    Some(1.0 / at)
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::random::generator;

    fn smooth(n: usize) -> Vec<f64> {
        (0..n).map(|i| i as f64 * 0.031).map(|t| 3.0 * t.sin() + 1.1 * (2.7 * t + 0.4).sin()).collect()
    }

    fn rounded(q: f64, sigma: f64) -> Vec<f64> {
        let mut rng = generator(3, 0);
        let noise = |rng: &mut _| sigma * Distribution::<f64>::sample(&StandardNormal, rng);
        smooth(2000).iter().map(|v| q * (v / q).round() + noise(&mut rng)).collect()
    }

    #[test]
    fn a_step_is_found_under_noise_and_without() {
        for (q, sigma) in [(0.2, 0.0), (0.2, 0.02), (0.2, 0.04), (0.03, 0.003), (0.9, 0.09)] {
            let found = resolution(&rounded(q, sigma)).unwrap_or_else(|| panic!("{q} with {sigma}: none"));
            assert!((found / q - 1.0).abs() < 2e-3, "{q} with {sigma}: {found}");
        }
    }

    #[test]
    fn smooth_values_show_none() {
        let mut rng = generator(4, 0);
        let uniform: Vec<f64> = (0..1500).map(|_| rng.random::<f64>()).collect();
        let sine: Vec<f64> = (0..1000).map(|i| (i as f64 * 0.01).sin()).collect();
        for (name, values) in
            [("two sines", smooth(2000)), ("uniform", uniform), ("a sine", sine), ("dithered", rounded(0.2, 0.2))]
        {
            assert_eq!(resolution(&values), None, "{name}");
        }
    }
}
