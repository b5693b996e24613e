//! `diagnosis.json`: the verdict as other programs read it.
//!
//! These structs are the file format `hysid.diagnosis/1` and nothing else: the working types are converted into them at the end. Numbers
//! that are not finite are written as `null`, since JSON has no other word for them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The format's name and version.
pub const SCHEMA: &str = "hysid.diagnosis/1";

/// What was concluded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VerdictKind {
    /// The simulation and the recording differ by no more than the noise.
    NoSignificantMismatch,
    /// The mechanism is firm.
    Named,
    /// The family is firm, the member is not.
    Family,
    /// Several families remain.
    Ambiguous,
    /// The catalogue's best set leaves structure that a sparse correction explains clearly better.
    NotInCatalogue,
}

impl VerdictKind {
    /// The word in the file.
    pub fn word(self) -> &'static str {
        match self {
            Self::NoSignificantMismatch => "no_significant_mismatch",
            Self::Named => "named",
            Self::Family => "family",
            Self::Ambiguous => "ambiguous",
            Self::NotInCatalogue => "not_in_catalogue",
        }
    }
}

/// The whole file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DiagnosisFile {
    /// [`SCHEMA`].
    pub schema: String,
    /// What was concluded.
    pub verdict: VerdictKind,
    /// The verdict in one or two sentences.
    pub summary: String,
    /// The test of the recalibrated simulation.
    pub mismatch: MismatchRecord,
    /// Where simulation and recording part.
    pub location: Option<LocationRecord>,
    /// What is missing; the likeliest set.
    pub effects: Vec<EffectRecord>,
    /// What else it could be, likeliest first.
    pub alternatives: Vec<AlternativeRecord>,
    /// Free-run errors on the hold-out, one entry for each recording and output.
    pub fit: Vec<FitRecord>,
    /// What is still significant after the effects.
    pub remaining: Option<RemainingRecord>,
    /// The sparse model of what no mechanism explains.
    pub correction: Option<CorrectionRecord>,
    /// What would separate a tie.
    pub experiment: Option<ExperimentRecord>,
    /// The simulation's own parameters after calibration (with the effects, where there are any).
    pub calibrated_parameters: Vec<ParameterRecord>,
    /// What the user should know about this run: gaps, parameters at a bound, a hold-out made of blocks, limits.
    pub notes: Vec<String>,
    /// The seed.
    pub seed: u64,
}

/// The mismatch test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MismatchRecord {
    /// Probability of a score this large without mismatch.
    pub p_value: Option<f64>,
    /// Free-run residual of the recalibrated simulation on the estimation recordings, by output column.
    pub residual_rms: BTreeMap<String, f64>,
    /// Estimated noise, by output column.
    pub noise_rms: BTreeMap<String, f64>,
    /// The smallest effects that this recording would have shown.
    pub detectable: Vec<DetectableRecord>,
}

/// The smallest effect that a recording would have shown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DetectableRecord {
    /// The mechanism.
    pub mechanism: String,
    /// The slot.
    pub slot: String,
    /// The smallest strength, in `unit`.
    pub smallest: f64,
    /// The unit.
    pub unit: String,
}

/// Where the mismatch lives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LocationRecord {
    /// `input:SYMBOL`, `state:SYMBOL`, `output:COLUMN`, `parameter:NAME` or `disturbance`.
    pub slot: String,
    /// The block.
    pub block: String,
    /// Intervals of time, in seconds on the first recording's clock.
    pub time_s: Vec<[f64; 2]>,
    /// Frequency bands, in hertz.
    pub band_hz: Vec<[f64; 2]>,
    /// The operating region in words.
    pub region: String,
}

/// A named effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectRecord {
    /// The mechanism.
    pub mechanism: String,
    /// Its family.
    pub family: String,
    /// Where it stands.
    pub slot: String,
    /// Probability that it is this mechanism.
    pub probability: f64,
    /// Probability that it is this family.
    pub family_probability: f64,
    /// Share of the tempered evidence that is for this mechanism, less what rules take: decides what is firm (see [`crate::verdict::reliability`]).
    pub support: f64,
    /// The same for the family.
    pub family_support: f64,
    /// Share of its response that the simulation's own parameters could absorb.
    pub concealment: Option<f64>,
    /// For people.
    pub sentence: String,
    /// Its parameters.
    pub parameters: Vec<ParameterRecord>,
}

/// A number with its interval (95 %).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterRecord {
    /// The name.
    pub name: String,
    /// The estimate.
    pub value: f64,
    /// Lower end.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// The unit.
    pub unit: String,
}

/// A rival explanation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AlternativeRecord {
    /// The mechanism.
    pub mechanism: String,
    /// Its family.
    pub family: String,
    /// Where it would stand.
    pub slot: String,
    /// Its probability.
    pub probability: f64,
    /// Twice the log evidence that it lacks against the likeliest set.
    pub evidence_gap: f64,
    /// Squared distance to the likeliest set's response, in units of the noise, after the rival's own refit: below 9 they cannot be
    /// told apart on this recording.
    pub separation: Option<f64>,
}

/// Free-run errors of one output of one recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FitRecord {
    /// The file (or `FILE: held-out blocks`).
    pub recording: String,
    /// The output's column.
    pub output: String,
    /// Of the recalibrated simulation.
    pub rmse_before: Option<f64>,
    /// Of the augmented simulation.
    pub rmse_after: Option<f64>,
    /// After over before.
    pub ratio: Option<f64>,
    /// Its 95 % interval by block bootstrap.
    pub ratio_low: Option<f64>,
    /// Its upper end.
    pub ratio_high: Option<f64>,
    /// Of the best black box on the same data.
    pub rmse_black_box: Option<f64>,
}

/// Share of the error of a simulation in which nothing is missing, or all that was, that a black box leaves at least: it cannot predict noise either.
const NEVER_BETTER: f64 = 0.75;

/// Ratio of the errors of two simulations up to which they are as good as each other.
const TRIFLE: f64 = 1.02;

impl FitRecord {
    /// The share of the error of the augmented simulation, or of the simulation as it is where none is written, that a black box leaves, where that is so much
    /// less that something is missing still: a model without any physics predicts what neither has seen far better.
    pub fn outdone(&self) -> Option<f64> {
        let share = self.rmse_black_box? / self.rmse_after.or(self.rmse_before)?;
        (share < NEVER_BETTER).then_some(share)
    }

    /// The ratio of the errors where the augmented simulation is worse on the hold-out than the simulation as it is, beyond chance and by more than a trifle.
    pub fn refuted(&self) -> Option<f64> {
        self.ratio.filter(|ratio| *ratio > TRIFLE && self.ratio_low.is_some_and(|low| low > 1.0))
    }
}

/// What is left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RemainingRecord {
    /// The test's p-value on the augmented simulation.
    pub p_value: f64,
    /// Share (rms) of the original mismatch that is left.
    pub share: f64,
}

/// A sparse correction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CorrectionRecord {
    /// Where the term that explains most is added.
    pub slot: String,
    /// Its terms.
    pub terms: Vec<TermRecord>,
    /// What kind of thing it is.
    pub signature: SignatureRecord,
    /// Held-out rms error of the augmented simulation with the correction over that without it.
    pub ratio: Option<f64>,
}

impl CorrectionRecord {
    /// The term that explains most.
    pub fn loudest(&self) -> Option<&TermRecord> {
        self.terms.iter().max_by(|a, b| a.err.total_cmp(&b.err))
    }
}

/// One term of a sparse correction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TermRecord {
    /// In the notation of `fit.json`.
    pub term: String,
    /// Where it is added: the terms of one law may stand in several equations.
    pub slot: String,
    /// Its coefficient.
    pub coefficient: f64,
    /// Its error reduction ratio.
    pub err: f64,
}

/// The signature of what no mechanism explains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SignatureRecord {
    /// `none`, `rate_dependent` or `rate_independent`.
    pub memory: String,
    /// Whether it depends on the rate.
    pub rate_dependent: bool,
    /// `odd`, `even` or `mixed`.
    pub symmetry: String,
    /// `input`, `plant`, `output` or `time`.
    pub side: String,
}

/// A discriminating experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExperimentRecord {
    /// For people.
    pub sentence: String,
    /// Whether any input would separate the rivals.
    pub separable: bool,
    /// The rivals.
    pub between: Vec<String>,
    /// The input's shape.
    pub shape: Option<String>,
    /// Its peak, in the unit of the input, as a multiple of the recording's.
    pub level: Option<f64>,
    /// Its band, in hertz.
    pub band_hz: Option<[f64; 2]>,
    /// Its duration, in seconds.
    pub duration_s: Option<f64>,
    /// The expected squared distance in units of the noise: 25 settles it, below 9 it does not.
    pub expected_separation: Option<f64>,
    /// The same on the recording at hand.
    pub present_separation: Option<f64>,
    /// A further sensor that would separate them, where no input does.
    pub sensor: Option<String>,
}

/// `None` for a number that JSON cannot hold.
pub fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_of_the_contract_is_read() {
        for (kind, word) in [
            (VerdictKind::NoSignificantMismatch, "no_significant_mismatch"),
            (VerdictKind::Named, "named"),
            (VerdictKind::Family, "family"),
            (VerdictKind::Ambiguous, "ambiguous"),
            (VerdictKind::NotInCatalogue, "not_in_catalogue"),
        ] {
            assert_eq!(serde_json::to_string(&kind).unwrap(), format!("\"{word}\""));
            assert_eq!(kind.word(), word);
        }
        assert_eq!(finite(f64::NAN), None);
    }
}
