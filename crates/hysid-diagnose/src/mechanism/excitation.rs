//! What a recording must show for a mechanism to be seen, checked on the recording and told in words.

use hysid_signal::{range, turning_points};

use super::signals::{Signals, mean, rms};
use crate::evidence::quantile;

/// A property of the excitation; text names a symbol of the slot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Need {
    /// The velocity changes its sign at least so often.
    Reversals(&'static str, usize),
    /// The speed, whatever its sign, turns at least so often: a law over the speed shows in one direction too.
    Sweeps(&'static str, usize),
    /// Large and small swings differ by this factor.
    Levels(&'static str, f64),
    /// The speed varies: at one speed a place and a moment come back together.
    Varies(&'static str),
    /// There are phases of slow motion.
    Slow(&'static str),
    /// The signal goes to both sides of its mean by comparable amounts.
    BothSides(&'static str),
    /// The signal is comparably active early and late in the recording.
    EarlyAndLate(&'static str),
    /// The activity changes: pauses or a different level.
    ActivityChange(&'static str),
    /// The signal rests for a while.
    Rest(&'static str),
    /// The size of the signal falls below this share of its largest: a threshold that is always exceeded is an offset.
    Below(&'static str, f64),
    /// The input turns at least so often.
    Turns(usize),
    /// The excited frequencies span this factor.
    Band(f64),
    /// The angle swings by at least so many radians.
    Angle(f64),
    /// The recorded output shows steps.
    Steps,
    /// The simulated output changes its sign and the recorded one does not.
    Simulated(&'static str),
}

/// Share of its rms by which a speed must vary.
const VARIED: f64 = 0.1;

fn turns(signals: &Signals, series: &[f64]) -> Vec<f64> {
    let threshold = 0.05 * rms(series, mean(series));
    let mut values = Vec::new();
    for stretch in &signals.stretches {
        let part = series.get(stretch.clone()).unwrap_or_default();
        values.extend(turning_points(part, threshold).into_iter().map(|t| t.value));
    }
    values
}

/// Rms of each of `count` equal parts of a series.
fn parts(series: &[f64], count: usize) -> Vec<f64> {
    let length = (series.len() / count).max(1);
    let middle = mean(series);
    series.chunks_exact(length).take(count).map(|part| rms(part, middle)).collect()
}

impl Need {
    /// What is lacking, in words; `None` where the recording suffices or the slot has no such signal.
    pub fn lacking(&self, signals: &Signals) -> Option<String> {
        let series = |symbol: &str| signals.series(symbol).filter(|s| s.len() > 3);
        match *self {
            Self::Reversals(v, least) => {
                let v = series(v)?;
                let found = v.windows(2).filter(|w| matches!(w, [a, b] if a * b < 0.0)).count();
                (found < least).then(|| format!("the velocity reverses {found} times, {least} are needed"))
            }
            Self::Sweeps(v, least) => {
                let speed: Vec<f64> = series(v)?.iter().map(|v| v.abs()).collect();
                let found = turns(signals, &speed).len();
                (found < least).then(|| format!("the speed turns {found} times, {least} are needed"))
            }
            Self::Levels(symbol, factor) => {
                let s = series(symbol)?;
                let middle = mean(s);
                let mut swings: Vec<f64> = turns(signals, s).into_iter().map(|v| (v - middle).abs()).collect();
                swings.sort_by(f64::total_cmp);
                let (low, high) = (quantile(&swings, 0.1)?, quantile(&swings, 0.9)?);
                (high < factor * low).then(|| {
                    format!(
                        "large and small swings of {} differ by a factor of {:.2} only, {factor} is needed",
                        word(symbol),
                        high / low
                    )
                })
            }
            Self::Varies(v) => {
                let speed: Vec<f64> = series(v)?.iter().map(|v| v.abs()).collect();
                let share = rms(&speed, mean(&speed)) / rms(&speed, 0.0).max(f64::MIN_POSITIVE);
                (share < VARIED).then(|| {
                    format!("the speed varies by {:.1} % only, {} % are needed", 100.0 * share, 100.0 * VARIED)
                })
            }
            Self::Slow(v) => {
                let v = series(v)?;
                let limit = 0.1 * rms(v, 0.0);
                let slow = v.iter().filter(|v| v.abs() < limit).count() as f64 / v.len() as f64;
                (slow < 0.02).then(|| format!("only {:.1} % of the samples move slowly, 2 % are needed", 100.0 * slow))
            }
            Self::BothSides(symbol) => {
                let s = series(symbol)?;
                let (low, high) = range(s.iter().copied());
                let middle = mean(s);
                let (below, above) = (middle - low, high - middle);
                (below.min(above) < 0.2 * below.max(above)).then(|| format!("{} goes to one side only", word(symbol)))
            }
            Self::EarlyAndLate(symbol) => {
                let p = parts(series(symbol)?, 3);
                let (first, last) = (*p.first()?, *p.last()?);
                (first.min(last) < 0.1 * first.max(last))
                    .then(|| "the recording is active only early or only late".to_owned())
            }
            Self::ActivityChange(symbol) => {
                let p = parts(series(symbol)?, 8);
                let (low, high) = p.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
                (high < 1.3 * low)
                    .then(|| "the motion is equally strong throughout: no pause, no change of level".to_owned())
            }
            Self::Rest(symbol) => {
                let s = series(symbol)?;
                let limit = 1e-3 * rms(s, mean(s));
                let resting = s.windows(2).filter(|w| matches!(w, [a, b] if (b - a).abs() < limit)).count();
                (resting * 20 < s.len()).then(|| format!("{} never rests", word(symbol)))
            }
            Self::Below(symbol, share) => {
                let s = series(symbol)?;
                let crosses = s.windows(2).any(|w| matches!(w, [a, b] if a * b <= 0.0));
                let (low, high) = s.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v.abs()), h.max(v.abs())));
                (!crosses && low > share * high).then(|| {
                    format!(
                        "{} never falls below {:.0} % of its largest, {:.0} % are needed",
                        word(symbol),
                        100.0 * low / high,
                        100.0 * share
                    )
                })
            }
            Self::Turns(least) => {
                let s = ["u", "y", "x", "F"].iter().find_map(|symbol| series(symbol))?;
                let found = turns(signals, s).len();
                (found < least).then(|| format!("the input turns {found} times, {least} are needed"))
            }
            Self::Band(factor) => {
                let (low, high) = signals.band_hz;
                (high < factor * low).then(|| {
                    format!("the excitation spans a factor of {:.2} in frequency, {factor} is needed", high / low)
                })
            }
            Self::Angle(least) => {
                // Over an angle that was added there is no `x`: what turns, turns far enough.
                let x = series("x")?;
                // What does not turn has no angle to swing by.
                let radians = *signals.constants.get("rad")?;
                let largest = x.iter().fold(0.0_f64, |m, v| m.max(v.abs())) * radians;
                (largest < least).then(|| format!("the swing is {largest:.2} rad at most, {least} are needed"))
            }
            Self::Steps => match signals.resolution() {
                None => Some("the recorded output shows no steps".to_owned()),
                Some(step) => {
                    let size = signals.size("y")?;
                    (step < 2e-3 * size).then(|| "the steps of the recorded output are too fine to matter".to_owned())
                }
            },
            Self::Simulated(symbol) => {
                let s = series(symbol)?;
                let changes = |s: &[f64]| {
                    let largest = s.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
                    s.iter().any(|v| *v < -0.1 * largest) && s.iter().any(|v| *v > 0.1 * largest)
                };
                if !changes(s) {
                    return Some("the simulated output does not change its sign".to_owned());
                }
                let measured = signals.measured()?;
                changes(measured).then(|| "the recorded output changes its sign".to_owned())
            }
        }
    }

    /// Whether a recording that meets it shows by itself that something of this kind is there: such a law is tried however little it promises around a
    /// simulation whose parameters were led astray.
    pub fn is_telling(&self) -> bool {
        matches!(self, Self::Simulated(_))
    }

    /// The need in words, for the catalogue.
    pub fn describe(&self) -> String {
        match *self {
            Self::Reversals(_, least) => format!("at least {least} reversals of the velocity"),
            Self::Sweeps(_, least) => format!("at least {least} turns of the speed"),
            Self::Levels(symbol, factor) => format!("swings of {} that differ by a factor of {factor}", word(symbol)),
            Self::Varies(_) => format!("a speed that varies by {} %", 100.0 * VARIED),
            Self::Slow(_) => "2 % of the time at slow motion".to_owned(),
            Self::BothSides(symbol) => format!("{} on both sides", word(symbol)),
            Self::EarlyAndLate(_) => "activity early and late".to_owned(),
            Self::ActivityChange(_) => "pauses or a change of level".to_owned(),
            Self::Rest(symbol) => format!("{} at rest for a while", word(symbol)),
            Self::Below(symbol, share) => format!("{} below {:.0} % of its largest", word(symbol), 100.0 * share),
            Self::Turns(least) => format!("at least {least} turning points"),
            Self::Band(factor) => format!("excited frequencies over a factor of {factor}"),
            Self::Angle(least) => format!("a swing of {least} rad"),
            Self::Steps => "visible steps in the recorded output".to_owned(),
            Self::Simulated(_) => "a simulated output that changes its sign while the recorded one does not".to_owned(),
        }
    }
}

fn word(symbol: &str) -> &'static str {
    match symbol {
        "x" => "the displacement",
        "v" => "the velocity",
        "u" => "the input",
        "s" => "the level",
        _ => "the output",
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn a_speed_that_rises_and_falls_needs_no_reversal() {
        let v: Vec<f64> = (0..1000).map(|n| 1.0 + 0.95 * (0.05 * f64::from(n)).sin()).collect();
        let signals = |v: Vec<f64>| Signals::new(0.01, 0.0, BTreeMap::from([("v".to_owned(), v)]));
        let there = signals(v.clone());
        assert_eq!(Need::Sweeps("v", 6).lacking(&there), None);
        let lacking = Need::Reversals("v", 6).lacking(&there).unwrap();
        assert!(lacking.contains("0 times"), "{lacking}");
        let once = signals(v[..200].to_vec());
        assert!(Need::Sweeps("v", 6).lacking(&once).is_some());
        assert_eq!(Need::Varies("v").lacking(&there), None);
        let steady = signals(v.iter().map(|v| 20.0 + v).collect());
        assert!(
            Need::Varies("v").lacking(&steady).unwrap().contains("3.2 %"),
            "{:?}",
            Need::Varies("v").lacking(&steady)
        );
    }
}
