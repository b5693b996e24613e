//! What is known of the signals at one slot on the estimation recordings: sizes, ranges, bands.
//!
//! Grids and bounds of a mechanism's parameters are scaled by it, and what the recordings could show at all is read from it.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::OnceLock;

use hysid_plant::{BinaryOp, Expr, Function, Hold};

use super::Grid;
use super::resolution::resolution;
use crate::evidence::quantile;

/// Share of the duration within which from either end no moment of a change is looked for.
const AT_AN_END: f64 = 0.005;
/// Share of a period over which the way on a straight line is taken: less than a step of the integration.
const PIECE: f64 = 0.03;

/// The signals at one slot: the baseline's run on the recordings, in the symbols of the slot.
#[derive(Debug, Clone, PartialEq)]
pub struct Signals {
    /// Sampling period, in seconds.
    pub period_s: f64,
    /// Time of the first sample of the longest stretch, in seconds.
    pub start_s: f64,
    /// The stretches without a gap, as ranges of samples; recordings follow one another.
    pub stretches: Vec<Range<usize>>,
    /// One series for each symbol of the slot that moves.
    pub series: BTreeMap<String, Vec<f64>>,
    /// The value of each symbol of the slot that does not move (`k`, `c`, `m`, `p`).
    pub constants: BTreeMap<String, f64>,
    /// Time over which the way of an input, divided by it, is the rate at which the input moves, in seconds.
    pub way_s: f64,
    measured: Option<Vec<f64>>,
    step: OnceLock<Option<f64>>,
    /// Lowest and highest excited frequency, in Hz.
    pub band_hz: (f64, f64),
    /// Frequencies of the largest peaks of the residual, if it is known, in Hz.
    pub peaks_hz: Vec<f64>,
    /// Periods over the displacement to which the residual points, in its unit.
    pub periods: Vec<f64>,
    /// The shortest period over the displacement that is told from the steps in which a converter reads it.
    pub shortest_period: f64,
}

impl Signals {
    /// Signals of one stretch; the band is taken from `u`, else from the first series there is.
    pub fn new(period_s: f64, start_s: f64, series: BTreeMap<String, Vec<f64>>) -> Self {
        let samples = series.values().map(Vec::len).min().unwrap_or(0);
        let stretches = std::iter::once(0..samples).collect();
        let driving = series.get("u").or_else(|| series.values().next());
        let band_hz = driving.map_or((0.0, 0.5 / period_s), |u| excited_band(u, period_s));
        Self {
            period_s,
            start_s,
            stretches,
            series,
            constants: BTreeMap::new(),
            way_s: period_s,
            measured: None,
            step: OnceLock::new(),
            band_hz,
            peaks_hz: Vec::new(),
            shortest_period: 0.0,
            periods: Vec::new(),
        }
    }

    /// The same for an input that is held so between its samples. A held input moves once in each period; on a straight line its rate is that of
    /// the piece that it is on, and the way over a whole period would mix two of them, most where the input turns.
    pub fn held(mut self, hold: Hold) -> Self {
        self.way_s = match hold {
            Hold::Zero => self.period_s,
            Hold::Linear => PIECE * self.period_s,
        };
        self
    }

    /// Duration of the longest stretch, in seconds.
    pub fn duration_s(&self) -> f64 {
        let longest = self.stretches.iter().map(Range::len).max().unwrap_or(0);
        longest.max(1) as f64 * self.period_s
    }

    /// The series of a symbol.
    pub fn series(&self, symbol: &str) -> Option<&[f64]> {
        self.series.get(symbol).map(Vec::as_slice)
    }

    /// The natural size of a symbol: standard deviation of a signal (rms of a force), absolute value of a constant, duration
    /// for `T`, sampling period for `h`, the time of an input's way for `h_u`, one second for `t`. `None` where it is not known or zero.
    pub fn size(&self, symbol: &str) -> Option<f64> {
        let size = match symbol {
            "T" => self.duration_s(),
            "h" => self.period_s,
            "h_u" => self.way_s,
            "t" => 1.0,
            _ => match (self.constants.get(symbol), self.series.get(symbol)) {
                (Some(value), _) => value.abs(),
                (None, Some(series)) if symbol == "F" => rms(series, 0.0),
                (None, Some(series)) => rms(series, mean(series)),
                (None, None) => return None,
            },
        };
        (size.is_finite() && size > 0.0).then_some(size)
    }

    /// The size of a measure such as `F/x^3`.
    pub fn size_of(&self, measure: &Expr) -> Option<f64> {
        match measure {
            Expr::Number(value) => Some(*value),
            Expr::Symbol(symbol) => self.size(symbol),
            Expr::Neg(a) => self.size_of(a).map(|a| -a),
            Expr::Binary(op, a, b) => {
                let (a, b) = (self.size_of(a)?, self.size_of(b)?);
                Some(match op {
                    BinaryOp::Add => a + b,
                    BinaryOp::Sub => a - b,
                    BinaryOp::Mul => a * b,
                    BinaryOp::Div => a / b,
                    BinaryOp::Pow => a.powf(b),
                })
            }
            Expr::Call(Function::Sqrt, a) => a.first().and_then(|a| self.size_of(a)).map(f64::sqrt),
            Expr::Call(..) | Expr::Memory(..) => None,
        }
    }

    fn sorted(&self, symbol: &str, map: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut values: Vec<f64> =
            self.series(symbol).unwrap_or_default().iter().copied().filter(|v| v.is_finite()).map(map).collect();
        values.sort_by(f64::total_cmp);
        values
    }

    /// Half the range of a symbol's signal.
    pub fn reach(&self, symbol: &str) -> f64 {
        let sorted = self.sorted(symbol, |v| v);
        match (sorted.first(), sorted.last()) {
            (Some(low), Some(high)) => (high - low) / 2.0,
            _ => 0.0,
        }
    }

    /// The values of a grid in ascending order, in the unit of the parameter; `size` is that of its measure.
    pub(super) fn values(&self, grid: &Grid, size: f64) -> Vec<f64> {
        let at = |sorted: &[f64], shares: &[f64]| -> Vec<f64> {
            shares.iter().filter_map(|q| quantile(sorted, *q)).collect()
        };
        let mut values = match grid {
            Grid::Values(multiples) => multiples.iter().map(|m| m * size).collect(),
            Grid::Reach(symbol, shares) | Grid::Turns(symbol, shares) => {
                let reach = self.reach(symbol);
                let reach = if reach > 0.0 { reach } else { size };
                shares.iter().map(|s| s * reach).chain(self.pointed(grid).iter().copied()).collect()
            }
            Grid::Waves(angle, multiples, within) => {
                let reach = Expr::parse(angle).ok().and_then(|a| self.size_of(&a)).filter(|reach| *reach > 0.0);
                multiples.iter().map(|m| m * size).chain(reach.map(|reach| within / reach)).collect()
            }
            Grid::Quantiles(symbol, shares) => at(&self.sorted(symbol, f64::abs), shares),
            Grid::SignedQuantiles(symbol, shares) => at(&self.sorted(symbol, |v| v), shares),
            Grid::Times(count) => {
                let step = self.duration_s() / (*count as f64 + 1.0);
                (1..=*count).map(|i| self.start_s + step * i as f64).collect()
            }
            Grid::Band(count) => {
                let (low, high) = self.band();
                let steps = super::log_steps(low / 1.5, (high * 1.5).min(0.45 / self.period_s), *count);
                steps.into_iter().chain(self.pointed(grid).iter().copied()).collect()
            }
            Grid::Memory(count) => {
                let (_, high) = self.band();
                let (fast, slow) = (0.1 / high, self.duration_s() / 4.0);
                super::log_steps(fast.min(slow / 10.0), slow, *count)
            }
            Grid::Peaks(_) if !self.peaks_hz.is_empty() => self.peaks_hz.clone(),
            Grid::Peaks(count) => super::log_steps(2.0 / self.duration_s(), 0.4 / self.period_s, *count),
            Grid::Resolution => vec![self.resolution().unwrap_or(1e-3 * size)],
        };
        values.retain(|v| v.is_finite());
        if values.is_empty() {
            values.push(size);
        }
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    }

    /// Values of a grid to which the residual points beside those that are tried on any recording.
    pub(super) fn pointed(&self, grid: &Grid) -> &[f64] {
        match grid {
            Grid::Turns(..) => &self.periods,
            Grid::Band(_) => &self.peaks_hz,
            _ => &[],
        }
    }

    /// What lines are resolved over: the travel of the signal of turns, else the recording's duration.
    pub(super) fn over(&self, grid: &Grid) -> f64 {
        if let Grid::Turns(symbol, _) = grid { 2.0 * self.reach(symbol) } else { self.duration_s() }
    }

    /// Bounds for a parameter whose law states none.
    pub(super) fn bounds(&self, grid: &Grid, values: &[f64]) -> (f64, f64) {
        let (low, high) = match (values.first(), values.last()) {
            (Some(low), Some(high)) => (*low, *high),
            _ => (0.0, 1.0),
        };
        let span = (high - low).max(0.5 * high.abs()).max(f64::MIN_POSITIVE);
        match grid {
            // Nearer to an end a change is a few samples, or the start that the simulation has.
            Grid::Times(_) => {
                let end = self.start_s + self.duration_s();
                let apart = AT_AN_END * self.duration_s();
                (self.start_s + apart, end - apart)
            }
            Grid::Band(_) | Grid::Peaks(_) => (low / 3.0, (high * 3.0).min(0.49 / self.period_s).max(high)),
            Grid::SignedQuantiles(..) => (low - span, high + span),
            _ if low > 0.0 => (low / 5.0, high * 5.0),
            _ => (low - span, high + span),
        }
    }

    fn band(&self) -> (f64, f64) {
        let nyquist = 0.5 / self.period_s;
        // A few samples can be too short for any band: the higher end then holds.
        let high = self.band_hz.1.max(2.0 / self.duration_s()).min(nyquist);
        let low = self.band_hz.0.max(1.0 / self.duration_s()).min(high);
        (low, high)
    }

    /// The recorded output, at a sensor.
    pub fn measured(&self) -> Option<&[f64]> {
        self.measured.as_deref()
    }

    /// With the recorded output of a sensor.
    pub fn measure(&mut self, measured: Option<Vec<f64>>) {
        (self.measured, self.step) = (measured, OnceLock::new());
    }

    /// The step of the recorded output, where it shows one. The search takes as long as a few simulations and is made once.
    pub fn resolution(&self) -> Option<f64> {
        let found = || resolution(self.measured()?, self.series("y").unwrap_or_default());
        *self.step.get_or_init(found)
    }
}

/// The mean of a series.
pub fn mean(series: &[f64]) -> f64 {
    series.iter().sum::<f64>() / series.len().max(1) as f64
}

/// The root of the mean square of a series, counted from a value.
pub fn rms(series: &[f64], about: f64) -> f64 {
    let mean_square = series.iter().map(|v| (v - about).powi(2)).sum::<f64>() / series.len().max(1) as f64;
    mean_square.sqrt()
}

/// The band that holds the signal's power but for 2 % at either end, in Hz; the mean does not count.
pub fn excited_band(u: &[f64], period_s: f64) -> (f64, f64) {
    band_but_for(u, period_s, 0.02)
}

/// The band that holds the signal's power but for a share at either end, in Hz; the mean does not count.
pub fn band_but_for(u: &[f64], period_s: f64, share: f64) -> (f64, f64) {
    let middle = mean(u);
    let centred: Vec<f64> = u.iter().map(|v| v - middle).collect();
    let lines = hysid_signal::fourier(&centred);
    let power: Vec<f64> = lines.iter().map(|(re, im)| re * re + im * im).collect();
    let total: f64 = power.iter().sum();
    let width = 1.0 / (period_s * u.len().max(1) as f64);
    let (mut low, mut high, mut sum) = (None, 0.5 / period_s, 0.0);
    for (k, p) in power.iter().enumerate() {
        sum += p;
        if low.is_none() && sum > share * total {
            low = Some(k as f64 * width);
        }
        if sum >= (1.0 - share) * total {
            high = k as f64 * width;
            break;
        }
    }
    (low.unwrap_or(width).max(width), high.max(width))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(hz: f64) -> Signals {
        let u: Vec<f64> = (0..1000).map(|n| 2.0 * (std::f64::consts::TAU * hz * 0.01 * f64::from(n)).sin()).collect();
        Signals::new(0.01, 0.0, BTreeMap::from([("u".to_owned(), u)]))
    }

    #[test]
    fn measures_are_products_of_sizes() {
        let mut s = sine(2.0);
        s.constants.insert("k".to_owned(), -3.0);
        let check = |measure: &str, expected: f64| {
            let found = s.size_of(&Expr::parse(measure).unwrap()).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-3, "{measure}: {found} instead of {expected}");
        };
        check("u", 2.0_f64.sqrt());
        check("u^2", 2.0);
        check("k/u", 3.0 / 2.0_f64.sqrt());
        check("T", 10.0);
        check("1/h", 100.0);
    }

    #[test]
    fn the_band_of_a_sine_is_its_line() {
        let (low, high) = sine(2.0).band_hz;
        assert!((low - 2.0).abs() < 0.11 && (high - 2.0).abs() < 0.11, "{low} {high}");
    }

    #[test]
    fn a_resonance_is_looked_for_where_the_residual_peaks_too() {
        let mut s = sine(2.0);
        let band = s.values(&Grid::Band(5), 1.0);
        s.peaks_hz = vec![2.345];
        let with_peaks = s.values(&Grid::Band(5), 1.0);
        assert!(with_peaks.len() == band.len() + 1 && with_peaks.contains(&2.345), "{with_peaks:?}");
        // The mismatch test leaves them out.
        assert_eq!(s.pointed(&Grid::Band(5)), [2.345]);
        assert!(s.pointed(&Grid::Times(5)).is_empty());
    }

    #[test]
    fn the_step_of_a_coarse_sensor_is_found() {
        let mut s = sine(2.0);
        s.measure(s.series("u").map(|u| u.iter().map(|v| (v / 0.05).round() * 0.05).collect()));
        let found = s.resolution().unwrap();
        assert!((found - 0.05).abs() < 1e-9, "{found}");
        s.measure(s.series("u").map(|u| u.iter().enumerate().map(|(n, v)| v + 1e-6 * n as f64).collect()));
        assert_eq!(s.resolution(), None);
    }
}
