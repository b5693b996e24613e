//! The step of a quantised signal, with or without noise on top of the steps.
//!
//! Values on a grid repeat themselves. Where noise was added behind the quantiser none does, but two sums stand out at the grid's frequency
//! `1/q`. That of `exp(2 pi i y/q)` over the samples `y` (the empirical characteristic function) is `exp(-2 (pi sigma/q)^2)` of their number there, and
//! next to nothing where a smooth distribution covers many steps. And the error `e` of a simulation `x` of the unquantised signal is a sawtooth of `x/q`,
//! so that the sum of `e exp(2 pi i x/q)` stands out, and the error falls where the sawtooth is taken off. The second sees steps that noise
//! hides in the values, and does not take the levels of a command for steps.
//!
//! Reference: B. Widrow, I. Kollár, Quantization Noise, Cambridge University Press (2008), ch. 4.

use std::f64::consts::{PI, TAU};

use hysid_linalg::turn;
use hysid_signal::range;

/// Steps that the signal must cover at least: a smooth distribution has a characteristic function of its own below that.
const FEWEST: f64 = 6.0;
/// Steps that it may cover at most: finer ones do not matter beside any noise.
const MOST: f64 = 800.0;
/// Values that a search needs.
const FEWEST_VALUES: usize = 200;
/// Most values that are searched, evenly taken: more tell nothing that these do not.
const MOST_VALUES: usize = 8000;
/// Points of the search for each step that the signal may cover.
const DENSITY: f64 = 4.0;
/// Odds against so large a sum by chance, at any of the steps that are searched.
const ODDS: f64 = 1000.0;
/// Size of the characteristic function that a grid shows at least, and times the median over all steps that it must stand out: the levels of a command
/// have a characteristic function of their own.
const VISIBLE: f64 = 0.3;
const ABOVE: f64 = 5.0;
/// Largest peaks at which a simulated signal is rounded.
const PEAKS: usize = 12;
/// Share of a peak's size that the place next to it has at least.
const NEAR_THE_PEAK: f64 = 0.9;

/// Rounds in which multiples and step are fitted in turn, and the rms distance of values from multiples, in steps, up to which it is known which they stand at
/// (0.29 where they stand anywhere).
const ROUNDS: usize = 4;
const CLUSTERED: f64 = 0.15;

/// The step of these values, of which a simulation without steps says what they would be; `None` where they show none.
pub fn resolution(values: &[f64], simulated: &[f64]) -> Option<f64> {
    let every = values.len().div_ceil(MOST_VALUES).max(1);
    let some = |series: &[f64]| series.iter().copied().step_by(every).collect::<Vec<f64>>();
    let (values, simulated) = (&some(values), &some(simulated));
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    // A converter behind the noise has steps of its own, which are finer.
    let fine = repeated(&sorted);
    let step = match (fine, sawtooth(values, simulated, fine).or_else(|| blurred(&sorted))) {
        (Some(fine), Some(coarse)) if coarse < 3.0 * fine => Some(fine),
        (fine, coarse) => coarse.or(fine),
    };
    step.map(|step| fitted(values, step))
}

/// The step of which values that cluster at multiples of one are nearest to multiples, by least squares; the step as it is where noise hides which multiple each
/// value stands at. Where a signal covers many steps, a thousandth of one rounds some of them to the next.
fn fitted(values: &[f64], step: f64) -> f64 {
    let mut best = step;
    for _ in 0..ROUNDS {
        let (mut left, mut product, mut squares, mut count, mut most) = (0.0, 0.0, 0.0, 0.0, 0.0_f64);
        for v in values.iter().filter(|v| v.is_finite()) {
            let multiple = (v / best).round();
            left += (v - best * multiple).powi(2);
            product += v * multiple;
            squares += multiple * multiple;
            count += 1.0;
            most = most.max(multiple.abs());
        }
        let next = product / squares;
        let clustered = left < count * (CLUSTERED * best).powi(2);
        // Not to where the outermost values would be counted anew.
        if !clustered || !((next - step).abs() * most < 0.25 * step) {
            break;
        }
        best = next;
    }
    best
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

/// The step that values with noise on top of it cluster at.
fn blurred(values: &[f64]) -> Option<f64> {
    let weights = vec![1.0; values.len()];
    let search = Search::new(values, &weights)?;
    let sizes = search.sizes();
    let best = (0..sizes.len()).max_by(|a, b| sizes[*a].total_cmp(&sizes[*b]))?;
    let mut ordered = sizes.clone();
    ordered.sort_by(f64::total_cmp);
    let (visible, outstanding) = (VISIBLE * (values.len() as f64).sqrt(), ABOVE * ordered[ordered.len() / 2]);
    (sizes[best] > visible.max(outstanding)).then(|| 1.0 / search.refined(best))
}

/// The step by whose rounding a simulated signal comes closer to the values, by so much as chance does at none of the steps that are searched, and by
/// more than with a step that is `known`, some multiple of which may look like one.
fn sawtooth(values: &[f64], simulated: &[f64], known: Option<f64>) -> Option<f64> {
    let pairs = values.iter().zip(simulated).filter(|(v, x)| v.is_finite() && x.is_finite());
    let (at, errors): (Vec<f64>, Vec<f64>) = pairs.map(|(v, x)| (*x, v - x)).unzip();
    let search = Search::new(&at, &errors)?;
    let sizes = search.sizes();
    let chance = chance(sizes.len());
    // A sawtooth explains pi^2/6 of what its first harmonic does, whose gain is the square of the size; between two places a peak loses little of it.
    let least = NEAR_THE_PEAK * (chance / (PI * PI / 6.0)).sqrt();
    let mut peaks: Vec<usize> = (1..sizes.len().saturating_sub(1))
        .filter(|&i| sizes[i] > least && sizes[i] >= sizes[i - 1] && sizes[i] > sizes[i + 1])
        .collect();
    peaks.sort_by(|a, b| sizes[*b].total_cmp(&sizes[*a]));
    let power = |q: Option<f64>| -> f64 {
        let rounding = |x: f64| q.map_or(0.0, |q| q * (x / q).round() - x);
        at.iter().zip(&errors).map(|(x, e)| (e - rounding(*x)).powi(2)).sum()
    };
    let whole = power(None);
    // Log likelihood: both errors as white noise of unknown size.
    let gain = |q: f64| 0.5 * at.len() as f64 * (whole / power(Some(q))).ln();
    let steps = peaks.into_iter().take(PEAKS).map(|i| 1.0 / search.refined(i)).map(|q| (q, gain(q)));
    let steps = steps.chain(known.map(|q| (q, gain(q))));
    let (q, gain) = steps.max_by(|a, b| a.1.total_cmp(&b.1))?;
    (gain > chance).then_some(q)
}

/// Logarithm of the odds against a step at any of so many places.
fn chance(places: usize) -> f64 {
    (places as f64 * ODDS).ln()
}

/// The search for a line in the sum of weights that are turned by values.
struct Search<'a> {
    values: &'a [f64],
    weights: &'a [f64],
    lowest: f64,
    range: f64,
    norm: f64,
}

impl<'a> Search<'a> {
    /// `None` where there are too few values, or all are one.
    fn new(values: &'a [f64], weights: &'a [f64]) -> Option<Self> {
        let (low, high) = range(values.iter().copied());
        let (range, norm) = (high - low, weights.iter().map(|w| w * w).sum::<f64>().sqrt());
        let usable = range > 0.0 && range.is_finite() && norm > 0.0 && norm.is_finite();
        (values.len() >= FEWEST_VALUES && usable).then_some(Self { values, weights, lowest: low, range, norm })
    }

    /// The frequency of a place of the search.
    fn at(&self, place: usize) -> f64 {
        (FEWEST + place as f64 / DENSITY) / self.range
    }

    fn turned(&self, value: f64, frequency: f64) -> (f64, f64) {
        (TAU * (value - self.lowest) * frequency).sin_cos()
    }

    /// The size of the sum at each place, in units of what chance gives it.
    fn sizes(&self) -> Vec<f64> {
        let places = ((MOST - FEWEST) * DENSITY) as usize;
        let spacing = 1.0 / (DENSITY * self.range);
        // Turned by the same angle from one frequency to the next: one product of complex numbers for each.
        let (sin, cos): (Vec<f64>, Vec<f64>) = self.values.iter().map(|v| self.turned(*v, spacing)).unzip();
        let first = self.values.iter().map(|v| self.turned(*v, self.at(0)));
        let (mut im, mut re): (Vec<f64>, Vec<f64>) = first.zip(self.weights).map(|((s, c), w)| (w * s, w * c)).unzip();
        let size = |(x, y): (f64, f64)| f64::hypot(x, y) / self.norm;
        (0..places).map(|_| size(turn(&mut re, &mut im, &cos, &sin))).collect()
    }

    /// The frequency of the peak at a place, which is as wide as the search's spacing, to a thousandth of it.
    fn refined(&self, place: usize) -> f64 {
        let size = |f: f64| {
            let turned = self.values.iter().map(|v| self.turned(*v, f)).zip(self.weights);
            let (im, re) = turned.fold((0.0, 0.0), |(im, re), ((s, c), w)| (im + w * s, re + w * c));
            f64::hypot(re, im)
        };
        let mut at = self.at(place);
        let mut step = 0.5 / (DENSITY * self.range);
        let least = 1e-3 * step;
        while step > least {
            let here = size(at);
            let better = [at - step, at + step].into_iter().find(|f| size(*f) > here);
            match better {
                Some(f) => at = f,
                None => step *= 0.5,
            }
        }
        at
    }
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

    /// Of the smooth signal.
    const RANGE: f64 = 8.2;

    /// A smooth signal rounded to steps with noise behind, and with the smooth signal itself.
    fn rounded(q: f64, sigma: f64) -> (Vec<f64>, Vec<f64>) {
        let mut rng = generator(3, 0);
        let noise = |rng: &mut _| sigma * Distribution::<f64>::sample(&StandardNormal, rng);
        let x = smooth(2000);
        (x.iter().map(|v| q * (v / q).round() + noise(&mut rng)).collect(), x)
    }

    /// Whether the step is the true one, to a tenth of a step over the range of the signal; or to where it is where values cluster.
    fn found(q: f64, sigma: f64, found: Option<f64>, what: &str) {
        let found = found.unwrap_or_else(|| panic!("{q} {what}: none"));
        let off = (found / q - 1.0).abs() * RANGE / q;
        // Four standard deviations of the slope of a line through the origin.
        let squares: f64 = smooth(2000).iter().map(|v| (v / q).round().powi(2)).sum();
        let clustered = 4.0 * sigma / squares.sqrt() / q * RANGE / q + 1e-9;
        let most = if sigma < 0.14 * q { clustered } else { 0.1 };
        assert!(off < most, "{q} {what}: {found}, {off} steps off");
    }

    #[test]
    fn a_step_is_found_under_noise_and_without() {
        // A rounding error has an rms of 0.29 of the step: the last is noise as large.
        for (q, sigma) in [(0.2, 0.0), (0.2, 0.02), (0.2, 0.04), (0.03, 0.003), (0.9, 0.09), (0.1, 0.029)] {
            let (values, simulated) = rounded(q, sigma);
            found(q, sigma, resolution(&values, &simulated), "beside a simulation");
            if sigma < 0.25 * q {
                found(q, sigma, resolution(&values, &[]), "by values alone");
            }
        }
    }

    #[test]
    fn beside_a_simulation_steps_below_the_noise_are_found() {
        let (values, simulated) = rounded(0.1, 0.1);
        assert_eq!(resolution(&values, &[]), None);
        found(0.1, 0.1, resolution(&values, &simulated), "below the noise");
    }

    #[test]
    fn steps_finer_than_any_that_is_searched_are_not_taken_for_a_multiple() {
        let x = smooth(9000);
        let q = RANGE / 1500.0;
        let values: Vec<f64> = x.iter().map(|v| q * (v / q).round()).collect();
        let found = resolution(&values, &x).unwrap();
        assert!((found / q - 1.0).abs() < 1e-6, "{found} {q}");
    }

    /// A command that stays at a few levels: its values cluster, and not in steps.
    #[test]
    fn levels_are_no_steps() {
        let mut rng = generator(5, 0);
        let levels: Vec<f64> = (0..12).map(|_| rng.random::<f64>()).collect();
        let at: Vec<f64> = (0..1200).map(|i| levels[i / 100]).collect();
        let recorded: Vec<f64> =
            at.iter().map(|v| v + 0.01 * Distribution::<f64>::sample(&StandardNormal, &mut rng)).collect();
        assert_eq!(sawtooth(&recorded, &at, None), None);
    }

    #[test]
    fn smooth_values_show_none() {
        let mut rng = generator(4, 0);
        let uniform: Vec<f64> = (0..1500).map(|_| rng.random::<f64>()).collect();
        let sine: Vec<f64> = (0..1000).map(|i| (i as f64 * 0.01).sin()).collect();
        let dithered = rounded(0.2, 0.2).0;
        for (name, values) in
            [("two sines", smooth(2000)), ("uniform", uniform), ("a sine", sine), ("dithered", dithered)]
        {
            assert_eq!(resolution(&values, &[]), None, "{name}");
        }
    }
}
