//! The table of factors, the admissible ones by equations (20) and (22), and which one to take.

use hysid_signal::Recording;

use crate::decimator::{DecimateError, Decimator, Phase};
use crate::measures::{Ratio, aliased_share, interpolation_error, mean_relative_difference};
use crate::reduce::{reduce, stretches};

/// Share of the variance above the new Nyquist frequency of a signal that a reduction may at most alias or filter away.
const LARGEST_LOSS: f64 = 0.01;
/// Samples that a reduction should leave.
const FEWEST_SAMPLES: usize = 100;

/// What a factor does to a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct FactorRow {
    /// The factor L.
    pub factor: usize,
    /// Samples left of each channel.
    pub samples: usize,
    /// Samples off the ends that are lost, and samples whose stretch is too short for the filter.
    pub lost: usize,
    /// Group delay of the decimator, in original samples: 0 for every decimator here.
    pub group_delay: f64,
    /// MRD (19) of the reduced output.
    pub mrd: Ratio,
    /// MRE (21) of the output at this factor.
    pub mre: Ratio,
    /// Largest share of the variance of the output or of an input that lies above the new Nyquist frequency: lost or aliased.
    pub above_nyquist: f64,
    /// What of it is left to be aliased after the decimator's filter.
    pub aliased: f64,
}

/// Which factor to take, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Recommendation {
    /// The factor; 1 for no reduction.
    pub factor: usize,
    /// The reason, in one or two sentences.
    pub reason: String,
    /// Factors admissible by (20) and (22) with the measures as printed.
    pub admissible_as_printed: Vec<usize>,
    /// Factors admissible by (20) and (22) with the robust measures and with at most 1 % of the variance above the new Nyquist frequency.
    pub admissible: Vec<usize>,
}

/// The row of each factor from 1 to `largest`, as far as three samples are left.
///
/// # Errors
/// A channel that is not there, a factor of 0.
pub fn examine(
    recording: &Recording,
    output: &str,
    inputs: &[&str],
    decimator: Decimator,
    phase: Phase,
    largest: usize,
) -> Result<Vec<FactorRow>, DecimateError> {
    let mut names = vec![output];
    names.extend(inputs.iter().filter(|i| **i != output));
    let whole: Vec<&[f64]> = stretches(recording, output)?.into_iter().map(|s| s.1).collect();
    let signals = names.iter().map(|n| stretches(recording, n)).collect::<Result<Vec<_>, _>>()?;
    let share = |factor, decimator| {
        signals
            .iter()
            .map(|stretches| {
                let total: usize = stretches.iter().map(|s| s.1.len()).sum();
                let weighted = |x: &[f64]| aliased_share(x, factor, decimator) * x.len() as f64 / total as f64;
                stretches.iter().map(|s| weighted(s.1)).sum::<f64>()
            })
            .fold(0.0, f64::max)
    };
    let mut rows = Vec::new();
    for factor in 1..=largest {
        if recording.len() / factor < 3 {
            break;
        }
        let reduced = reduce(recording, &names, factor, decimator, phase)?;
        let kept: Vec<&[f64]> = stretches(&reduced.recording, output)?.into_iter().map(|s| s.1).collect();
        rows.push(FactorRow {
            factor,
            samples: reduced.samples.1,
            lost: reduced.off_the_ends + reduced.too_short,
            group_delay: 0.0,
            mrd: mean_relative_difference(&kept),
            mre: interpolation_error(&whole, factor),
            above_nyquist: share(factor, Decimator::Plain),
            aliased: share(factor, decimator),
        });
    }
    Ok(rows)
}

/// The factor to take of a table that begins at factor 1, for this `alpha` (0.95 in the paper).
pub fn recommend(rows: &[FactorRow], alpha: f64) -> Recommendation {
    let bound = 1.0 - alpha;
    let keeps = |r: &&FactorRow| r.mre.robust < bound && r.above_nyquist <= LARGEST_LOSS;
    let factors = |f: &dyn Fn(&&FactorRow) -> bool| rows.iter().filter(f).map(|r| r.factor).collect::<Vec<_>>();
    let admissible_as_printed =
        factors(&|r| r.mrd.as_printed.is_finite() && r.mrd.as_printed > bound && r.mre.as_printed < bound);
    let admissible = factors(&|r| r.mrd.robust > bound && keeps(r));
    let percent = 100.0 * bound;
    let (factor, reason) = match (rows.first(), admissible.first()) {
        (None, _) => (1, "There are too few samples to reduce.".to_owned()),
        (Some(first), _) if first.mrd.robust.is_nan() => (1, "The output is constant or missing.".to_owned()),
        (Some(first), _) if first.mrd.robust > bound => {
            let differs = 100.0 * first.mrd.robust;
            (1, format!("Neighbouring samples already differ by {differs:.1} % (above {percent:.0} %): no reduction is needed."))
        }
        (_, Some(&l)) => (
            l,
            format!(
                "The smallest factor at which neighbours differ by more than {percent:.0} % while lines between the samples kept stay within {percent:.0} % \
                 of the recording and no more than 1 % of a signal's variance lies above the new Nyquist frequency."
            ),
        ),
        _ => match rows.iter().rfind(keeps) {
            Some(r) if r.factor > 1 => (
                r.factor,
                format!(
                    "No factor makes neighbours differ by {percent:.0} % without loss; this is the largest of those examined that loses no more than \
                     {percent:.0} % of the shape and 1 % of a signal's variance."
                ),
            ),
            _ => (1, "Every reduction would lose more than 1 % of a signal's variance or its shape (noise, or a fast input).".to_owned()),
        },
    };
    // A reduction that leaves next to nothing helps nobody.
    let fits = rows.iter().rfind(|r| r.samples >= FEWEST_SAMPLES).map_or(1, |r| r.factor);
    if factor > fits {
        let left = rows.iter().find(|r| r.factor == factor).map_or(0, |r| r.samples);
        let short = format!(
            "Factor {factor} would be right for the signals, but leaves {left} samples; {fits} leaves {FEWEST_SAMPLES} or more."
        );
        return Recommendation { factor: fits, reason: short, admissible_as_printed, admissible };
    }
    Recommendation { factor, reason, admissible_as_printed, admissible }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysid_signal::{Channel, Clock};

    fn recording(samples: usize, f: impl Fn(f64) -> f64) -> Recording {
        let u: Vec<f64> = (0..samples).map(|n| (n as f64 * 0.01).sin()).collect();
        let y = (0..samples).map(|n| f(n as f64 * 0.01)).collect();
        let channels = vec![Channel { name: "u".into(), samples: u }, Channel { name: "y".into(), samples: y }];
        Recording::new("test", Clock { start_s: 0.0, period_s: 0.01 }, channels).unwrap()
    }

    fn advice(r: &Recording, largest: usize) -> Recommendation {
        recommend(&examine(r, "y", &["u"], Decimator::Plain, Phase::First, largest).unwrap(), 0.95)
    }

    #[test]
    fn an_oversampled_sine_is_reduced_until_neighbours_differ() {
        // MRD of a sine is 1 - cos(0.01 L): above 0.05 from L = 32 on; MRE is 1 - cos(0.005 L): below 0.05 up to L = 63.
        let r = advice(&recording(20_000, |t| (t - 0.3).sin()), 80);
        assert_eq!((r.factor, r.admissible.first(), r.admissible.last()), (32, Some(&32), Some(&63)));
        // The sine is 0 up to rounding at one sample, which decides the measures as printed.
        assert_ne!(r.admissible_as_printed, r.admissible);
    }

    #[test]
    fn other_cases_have_their_reason() {
        let unreduced = advice(&recording(2000, |t| (60.0 * t).sin()), 10);
        assert!(unreduced.factor == 1 && unreduced.reason.contains("already"));
        let far = advice(&recording(20_000, |t| t.sin()), 10);
        assert!(far.factor == 10 && far.reason.contains("No factor"));
        let short = advice(&recording(1500, |t| t.sin()), 60);
        assert!(short.factor == 15 && short.reason.contains("leaves"), "{short:?}");
        let constant = advice(&recording(200, |_| 1.0), 10);
        assert!(constant.factor == 1 && constant.reason.contains("constant"));
        assert_eq!(recommend(&[], 0.95).factor, 1);
    }

    #[test]
    fn the_papers_loop_has_the_papers_measures() {
        let y = (0..=100).map(|m| f64::from(m * (m - 1)) / 39600.0);
        let y = y.chain((0..=100).map(|n| 0.25 - f64::from(n * (n - 1)) / 39600.0)).collect();
        let r = Recording::new(
            "loop",
            Clock { start_s: 0.0, period_s: 1.0 },
            vec![Channel { name: "y".into(), samples: y }],
        )
        .unwrap();
        let rows = examine(&r, "y", &[], Decimator::Plain, Phase::Lth, 15).unwrap();
        let above: Vec<usize> =
            rows.iter().filter(|r| r.factor > 1 && r.mrd.as_printed > 0.05).map(|r| r.factor).collect();
        assert_eq!(above, [11, 12, 13, 14, 15]);
        assert_eq!((rows[12].samples, rows[12].lost), (15, 19));
    }
}
