//! Input signals for experiments: sine, triangle, decaying reversals, chirp, multisine, pseudo-random binary, random steps.
//!
//! Every signal's largest absolute value is its amplitude (the random steps' is below it). Random ones are functions of a seed
//! (PCG-64, the same on every platform). References: Pintelon and Schoukens, *System Identification: A Frequency Domain
//! Approach* (2012), chapter 5; Godfrey, *Perturbation Signals for System Identification* (1993) for the binary sequence.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::spectrum::inverse_fourier;

/// The shape of an input signal.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Excitation {
    /// `sin(2 pi f t)`.
    Sine {
        /// Frequency in Hz.
        frequency_hz: f64,
    },
    /// Straight lines between 1 and -1, starting at 0 upwards.
    Triangle {
        /// Frequency in Hz.
        frequency_hz: f64,
    },
    /// Straight lines between reversals at 1, -r, r^2, -r^3, ...: nested minor loops, and the way to demagnetise.
    DecayingReversals {
        /// Frequency in Hz: two reversals a period.
        frequency_hz: f64,
        /// The ratio r of one reversal to the one before, above 0 and below 1.
        ratio: f64,
    },
    /// A sine whose frequency goes linearly from one value to the other over the signal.
    Chirp {
        /// Frequency at the first sample, in Hz.
        from_hz: f64,
        /// Frequency at the last sample, in Hz.
        to_hz: f64,
    },
    /// A sum of sines of equal amplitude and random phase, one on each line of the band; periodic.
    Multisine {
        /// Lowest frequency in Hz; line 0 is never excited.
        lowest_hz: f64,
        /// Highest frequency in Hz, below the Nyquist frequency.
        highest_hz: f64,
        /// Samples in a period; 0 makes the whole signal one period.
        period: usize,
    },
    /// A pseudo-random binary sequence of maximal length: `2^order - 1` values of -1 or 1 and then again.
    Prbs {
        /// Order of the shift register, 3 to 20.
        order: u32,
        /// Samples for which each value is held.
        hold: usize,
    },
    /// Levels drawn evenly from -1 to 1, each held for the same time.
    Steps {
        /// Samples for which each level is held.
        hold: usize,
    },
}

/// What can be wrong with a request for a signal.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("excitation: {parameter} = {given} is not allowed; {parameter} must be {allowed}")]
pub struct ExcitationError {
    /// The parameter's name: a field of [`Excitation`], `period_s`, `amplitude`, `band_hz` (lowest and highest frequency), `depth`.
    pub parameter: &'static str,
    /// Its value.
    pub given: String,
    /// What it must be.
    pub allowed: String,
}

fn require(
    holds: bool,
    parameter: &'static str,
    value: impl std::fmt::Display,
    what: &str,
) -> Result<(), ExcitationError> {
    if holds { Ok(()) } else { Err(ExcitationError { parameter, given: value.to_string(), allowed: what.to_owned() }) }
}

impl Excitation {
    /// `samples` values, one every `period_s` seconds, of this amplitude; random shapes are a function of `seed`.
    ///
    /// # Errors
    /// A parameter outside what its field allows, a frequency above the Nyquist frequency, an empty band.
    pub fn signal(
        &self,
        samples: usize,
        period_s: f64,
        amplitude: f64,
        seed: u64,
    ) -> Result<Vec<f64>, ExcitationError> {
        require(period_s.is_finite() && period_s > 0.0, "period_s", period_s, "a finite number above 0")?;
        require(amplitude.is_finite(), "amplitude", amplitude, "a finite number")?;
        let mut u = self.shape(samples, period_s, seed)?;
        for u in &mut u {
            *u *= amplitude;
        }
        Ok(u)
    }

    fn shape(&self, samples: usize, period_s: f64, seed: u64) -> Result<Vec<f64>, ExcitationError> {
        let nyquist = 0.5 / period_s;
        let below_nyquist = |name: &'static str, f: f64| {
            let what = format!("a number from 0 to the Nyquist frequency, {nyquist} Hz");
            require((0.0..=nyquist).contains(&f), name, f, &what)
        };
        let at = |n: usize| n as f64 * period_s;
        match *self {
            Self::Sine { frequency_hz } => {
                below_nyquist("frequency_hz", frequency_hz)?;
                Ok((0..samples).map(|n| (TAU * frequency_hz * at(n)).sin()).collect())
            }
            Self::Triangle { frequency_hz } => {
                below_nyquist("frequency_hz", frequency_hz)?;
                Ok((0..samples).map(|n| triangle(frequency_hz * at(n))).collect())
            }
            Self::DecayingReversals { frequency_hz, ratio } => {
                below_nyquist("frequency_hz", frequency_hz)?;
                require(ratio > 0.0 && ratio < 1.0, "ratio", ratio, "above 0 and below 1")?;
                Ok((0..samples).map(|n| decaying_reversals(2.0 * frequency_hz * at(n), ratio)).collect())
            }
            Self::Chirp { from_hz, to_hz } => {
                below_nyquist("from_hz", from_hz)?;
                below_nyquist("to_hz", to_hz)?;
                let rate = (to_hz - from_hz) / at(samples.max(2) - 1);
                Ok((0..samples).map(|n| (TAU * (from_hz + 0.5 * rate * at(n)) * at(n)).sin()).collect())
            }
            Self::Multisine { lowest_hz, highest_hz, period } => {
                below_nyquist("lowest_hz", lowest_hz)?;
                below_nyquist("highest_hz", highest_hz)?;
                multisine((lowest_hz, highest_hz), if period == 0 { samples } else { period }, period_s, seed)
                    .map(|one| one.iter().copied().cycle().take(samples).collect())
            }
            Self::Prbs { order, hold } => {
                require(hold > 0, "hold", hold, "1 or more")?;
                let bits = prbs(order, seed)?;
                Ok(bits.flat_map(|bit| std::iter::repeat_n(bit, hold)).take(samples).collect())
            }
            Self::Steps { hold } => {
                require(hold > 0, "hold", hold, "1 or more")?;
                let mut random = Pcg64Mcg::seed_from_u64(seed);
                let levels = std::iter::repeat_with(move || random.random_range(-1.0..=1.0));
                Ok(levels.flat_map(|level: f64| std::iter::repeat_n(level, hold)).take(samples).collect())
            }
        }
    }
}

/// The triangle wave of unit amplitude and period at `t`: 0 at 0, 1 at 1/4, -1 at 3/4.
fn triangle(t: f64) -> f64 {
    let phase = (t + 0.25).rem_euclid(1.0);
    1.0 - 4.0 * (phase - 0.5).abs()
}

/// Straight lines through 0 at 0, 1 at 1, -r at 2, r^2 at 3, ...
fn decaying_reversals(t: f64, ratio: f64) -> f64 {
    let node = |k: f64| match k {
        0.0 => 0.0,
        _ if k % 2.0 == 1.0 => ratio.powf(k - 1.0),
        _ => -ratio.powf(k - 1.0),
    };
    let k = t.floor();
    node(k) + (t - k) * (node(k + 1.0) - node(k))
}

/// One period of a random-phase multisine, scaled to a peak of 1.
fn multisine(band_hz: (f64, f64), period: usize, period_s: f64, seed: u64) -> Result<Vec<f64>, ExcitationError> {
    let spacing = 1.0 / (period as f64 * period_s);
    // A band edge that is meant to be a line may miss it by rounding.
    let first = (band_hz.0 / spacing - 1e-9).ceil().max(1.0) as usize;
    let last = ((band_hz.1 / spacing + 1e-9).floor() as usize).min((period.max(1) - 1) / 2);
    let what =
        format!("wide enough to hold one of the lines, which are {spacing} Hz apart, below the Nyquist frequency");
    require(period > 0 && first <= last, "band_hz", format_args!("{} to {}", band_hz.0, band_hz.1), &what)?;
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut lines = vec![(0.0, 0.0); last + 1];
    for line in &mut lines[first..] {
        let (sin, cos) = random.random_range(0.0..TAU).sin_cos();
        *line = (cos, sin);
    }
    let mut u = inverse_fourier(&lines, period);
    let peak = u.iter().fold(0.0f64, |peak, u| peak.max(u.abs()));
    for u in &mut u {
        *u /= peak;
    }
    Ok(u)
}

/// Tap that together with the last stage makes the register of order 3, 4, ... of maximal length; a list where two do not suffice.
const TAPS: [&[u32]; 18] = [
    &[3, 2],
    &[4, 3],
    &[5, 3],
    &[6, 5],
    &[7, 6],
    &[8, 6, 5, 4],
    &[9, 5],
    &[10, 7],
    &[11, 9],
    &[12, 11, 10, 4],
    &[13, 12, 11, 8],
    &[14, 13, 12, 2],
    &[15, 14],
    &[16, 15, 13, 4],
    &[17, 14],
    &[18, 11],
    &[19, 18, 17, 14],
    &[20, 17],
];

/// The endless sequence of -1 and 1; the seed chooses where in its period it starts.
fn prbs(order: u32, seed: u64) -> Result<impl Iterator<Item = f64>, ExcitationError> {
    let taps = (order as usize).checked_sub(3).and_then(|row| TAPS.get(row));
    let Some(taps) = taps else {
        return Err(ExcitationError { parameter: "order", given: order.to_string(), allowed: "3 to 20".into() });
    };
    let mut register: u32 = Pcg64Mcg::seed_from_u64(seed).random_range(1..(1 << order));
    Ok(std::iter::repeat_with(move || {
        let bit = taps.iter().fold(0, |bit, tap| bit ^ (register >> (tap - 1))) & 1;
        let out = if register >> (order - 1) & 1 == 1 { 1.0 } else { -1.0 };
        register = ((register << 1) | bit) & ((1 << order) - 1);
        out
    }))
}

/// Multiplies `u` by `1 + depth sin(2 pi f t)`, so that a periodic signal also makes minor loops, and scales back to the old peak.
///
/// # Errors
/// The depth is negative or above 1, or the frequency is negative; either is not finite.
pub fn modulate(u: &mut [f64], period_s: f64, depth: f64, frequency_hz: f64) -> Result<(), ExcitationError> {
    require((0.0..=1.0).contains(&depth), "depth", depth, "a number from 0 to 1")?;
    let what = "a finite number of 0 or more";
    require(frequency_hz.is_finite() && frequency_hz >= 0.0, "frequency_hz", frequency_hz, what)?;
    let peak = |u: &[f64]| u.iter().fold(0.0f64, |peak, u| peak.max(u.abs()));
    let before = peak(u);
    for (n, u) in u.iter_mut().enumerate() {
        *u *= 1.0 + depth * (TAU * frequency_hz * n as f64 * period_s).sin();
    }
    let after = peak(u);
    if after > 0.0 {
        for u in u {
            *u *= before / after;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::fourier;

    fn every_shape() -> Vec<Excitation> {
        use Excitation::*;
        vec![
            Sine { frequency_hz: 2.5 },
            Triangle { frequency_hz: 2.5 },
            DecayingReversals { frequency_hz: 2.5, ratio: 0.9 },
            Chirp { from_hz: 0.5, to_hz: 10.0 },
            Multisine { lowest_hz: 1.0, highest_hz: 10.0, period: 500 },
            Prbs { order: 7, hold: 3 },
            Steps { hold: 20 },
        ]
    }

    #[test]
    fn every_shape_has_its_length_and_amplitude_and_is_a_function_of_its_seed() {
        for shape in every_shape() {
            let u = shape.signal(1000, 0.01, 3.0, 5).unwrap();
            let peak = u.iter().fold(0.0f64, |m, u| m.max(u.abs()));
            assert_eq!(u.len(), 1000);
            assert!(peak <= 3.0 + 1e-12 && peak > 2.7, "{shape:?} has peak {peak}");
            assert_eq!(u, shape.signal(1000, 0.01, 3.0, 5).unwrap());
        }
    }

    #[test]
    fn decaying_reversals_turn_where_they_should() {
        let shape = Excitation::DecayingReversals { frequency_hz: 0.5, ratio: 0.5 };
        let u = shape.signal(9, 0.5, 8.0, 0).unwrap();
        let expected = [0.0, 4.0, 8.0, 2.0, -4.0, -1.0, 2.0, 0.5, -1.0];
        for (u, e) in u.iter().zip(expected) {
            approx::assert_abs_diff_eq!(*u, e, epsilon = 1e-12);
        }
    }

    #[test]
    fn a_multisine_is_periodic_and_flat_in_its_band_only() {
        let shape = Excitation::Multisine { lowest_hz: 2.0, highest_hz: 5.0, period: 200 };
        let u = shape.signal(400, 0.01, 1.0, 9).unwrap();
        assert_eq!(u[..200], u[200..]);
        let power: Vec<f64> = fourier(&u[..200]).iter().map(|(re, im)| re.hypot(*im)).collect();
        for (k, p) in power.iter().enumerate() {
            if (4..=10).contains(&k) {
                approx::assert_relative_eq!(*p, power[4], max_relative = 1e-9);
            } else {
                assert!(*p < 1e-9 * power[4], "line {k} has {p}");
            }
        }
    }

    #[test]
    fn every_register_is_of_maximal_length_and_balanced() {
        for order in 3..=20 {
            let length = (1usize << order) - 1;
            let bits: Vec<f64> = prbs(order, 1).unwrap().take(2 * length).collect();
            assert_eq!(bits[..length], bits[length..], "order {order} has the period");
            // A maximal sequence has one more 1 than -1, and this autocorrelation at every lag but 0.
            assert_eq!(bits[..length].iter().sum::<f64>(), 1.0, "order {order} is balanced");
            for lag in [1, 2, 5] {
                let r: f64 = (0..length).map(|n| bits[n] * bits[n + lag]).sum();
                assert_eq!(r, -1.0, "order {order} at lag {lag}");
            }
        }
    }

    #[test]
    fn bad_requests_name_what_is_allowed() {
        use Excitation::*;
        let cases = [
            (Sine { frequency_hz: 60.0 }, "frequency_hz must be a number from 0 to the Nyquist frequency, 50 Hz"),
            (Sine { frequency_hz: f64::NAN }, "frequency_hz"),
            (DecayingReversals { frequency_hz: 1.0, ratio: 1.0 }, "ratio must be above 0 and below 1"),
            (Multisine { lowest_hz: 5.1, highest_hz: 5.2, period: 100 }, "lines, which are 1 Hz apart"),
            (Prbs { order: 2, hold: 1 }, "order must be 3 to 20"),
            (Prbs { order: 40, hold: 1 }, "order must be 3 to 20"),
            (Steps { hold: 0 }, "hold must be 1 or more"),
        ];
        for (shape, expected) in cases {
            let e = shape.signal(100, 0.01, 1.0, 1).unwrap_err().to_string();
            assert!(e.contains(expected), "{e}");
        }
        assert!(Steps { hold: 1 }.signal(1, 0.0, 1.0, 1).is_err());
        assert!(Steps { hold: 1 }.signal(1, 1.0, f64::INFINITY, 1).is_err());
    }

    #[test]
    fn no_samples_are_no_panic() {
        for shape in every_shape() {
            for samples in [0, 1, 2] {
                assert_eq!(shape.signal(samples, 0.01, 1.0, 1).unwrap().len(), samples);
            }
        }
        assert!(Excitation::Multisine { lowest_hz: 1.0, highest_hz: 2.0, period: 0 }.signal(0, 0.01, 1.0, 1).is_err());
    }

    #[test]
    fn modulation_keeps_the_peak() {
        let mut u = Excitation::Sine { frequency_hz: 5.0 }.signal(1000, 0.01, 2.0, 0).unwrap();
        modulate(&mut u, 0.01, 0.6, 0.17).unwrap();
        let peak = u.iter().fold(0.0f64, |m, u| m.max(u.abs()));
        approx::assert_relative_eq!(peak, 2.0, max_relative = 1e-12);
        assert!(modulate(&mut u, 0.01, 1.5, 0.1).is_err());
    }
}
