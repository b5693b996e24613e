//! From evidence to a verdict: probabilities of sets of effects, and the deepest statement that they carry.
//!
//! Statements form a tree: this mechanism, this family, this slot. The deepest one with a probability of at least [`FIRM`] is
//! made; where none is, the rivals are listed. Evidence counts with a weight below one, because no model of the catalogue is
//! exactly right: with full weight mean confidence exceeds accuracy.

pub(crate) mod elsewhere;
pub(crate) mod firmness;
pub(crate) mod judgement;
mod place;
pub mod reliability;
pub(crate) mod remaining;
mod resonance;
pub(crate) mod trifles;
mod veto;
mod wanders;
pub(crate) mod weigh;
mod wordings;

use crate::file::VerdictKind;

/// The probability from which a statement is firm.
pub const FIRM: f64 = 0.9;

/// The largest probability of an effect that the set around it makes doubtful.
pub const NOT_FIRM: f64 = 0.85;

/// An effect as the verdict sees it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Claim {
    /// The mechanism.
    pub mechanism: &'static str,
    /// Its family.
    pub family: &'static str,
    /// The slot's name.
    pub slot: String,
}

/// A set of effects that was fitted.
#[derive(Debug, Clone)]
pub struct Hypothesis {
    /// Its effects; none for the simulation as it is.
    pub claims: Vec<Claim>,
    /// Log evidence (natural logarithm), up to a constant that all hypotheses share.
    pub log_evidence: f64,
}

impl Hypothesis {
    /// Whether it claims all that another one does, which claims something, and more.
    pub fn says_more_than(&self, other: &Self) -> bool {
        let claims = other.claims.len();
        claims > 0 && self.claims.len() > claims && other.claims.iter().all(|c| self.claims.contains(c))
    }
}

/// Probabilities proportional to `exp(weight * log evidence)`, in the order of the evidences.
pub fn probabilities(log_evidence: &[f64], weight: f64) -> Vec<f64> {
    let top = log_evidence.iter().copied().filter(|e| e.is_finite()).fold(f64::NEG_INFINITY, f64::max);
    if !top.is_finite() {
        return vec![0.0; log_evidence.len()];
    }
    let raw: Vec<f64> =
        log_evidence.iter().map(|e| if e.is_finite() { (weight * (e - top)).exp() } else { 0.0 }).collect();
    let sum: f64 = raw.iter().sum();
    raw.iter().map(|r| r / sum).collect()
}

/// What can be said of one effect of the likeliest set.
#[derive(Debug, Clone, PartialEq)]
pub struct Support {
    /// Probability of the mechanism, at whatever slot.
    pub mechanism: f64,
    /// Probability of the family.
    pub family: f64,
    /// Probability of the slot, by whatever mechanism.
    pub slot: f64,
}

impl Support {
    /// Takes off the probability of a law that the catalogue has not got.
    pub fn discount(&mut self, outside: f64) {
        self.mechanism *= 1.0 - outside;
        self.family *= 1.0 - outside;
    }

    /// No longer firm: something shows that the set is not the whole truth.
    pub fn weaken(&mut self) {
        self.mechanism = self.mechanism.min(NOT_FIRM);
        self.family = self.family.min(NOT_FIRM);
    }
}

/// The support that each claim of `best` finds among all hypotheses.
pub fn supports(best: &[Claim], hypotheses: &[Hypothesis], probability: &[f64]) -> Vec<Support> {
    let total = |matches: &dyn Fn(&Claim) -> bool| -> f64 {
        let sum: f64 =
            hypotheses.iter().zip(probability).filter(|(h, _)| h.claims.iter().any(matches)).map(|(_, p)| p).sum();
        sum.min(1.0)
    };
    best.iter()
        .map(|c| Support {
            mechanism: total(&|o| o.mechanism == c.mechanism),
            family: total(&|o| o.family == c.family),
            slot: total(&|o| o.slot == c.slot),
        })
        .collect()
}

/// The deepest firm statement about a set with these supports. An empty set is no mismatch.
pub fn verdict(supports: &[Support]) -> VerdictKind {
    if supports.is_empty() {
        VerdictKind::NoSignificantMismatch
    } else if supports.iter().all(|s| s.mechanism >= FIRM) {
        VerdictKind::Named
    } else if supports.iter().all(|s| s.family >= FIRM) {
        VerdictKind::Family
    } else {
        VerdictKind::Ambiguous
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claim(mechanism: &'static str, family: &'static str) -> Claim {
        Claim { mechanism, family, slot: "state:v".into() }
    }

    fn decide(rivals: &[(&'static str, &'static str, f64)]) -> (VerdictKind, Vec<Support>) {
        let hypotheses: Vec<Hypothesis> =
            rivals.iter().map(|(m, f, e)| Hypothesis { claims: vec![claim(m, f)], log_evidence: *e }).collect();
        let p = probabilities(&rivals.iter().map(|r| r.2).collect::<Vec<_>>(), 0.4);
        let s = supports(&hypotheses[0].claims, &hypotheses, &p);
        (verdict(&s), s)
    }

    #[test]
    fn the_deepest_firm_statement_is_made() {
        let table: [(&[(&str, &str, f64)], VerdictKind); 4] = [
            (
                &[("coulomb_friction", "dry_friction", 0.0), ("cubic_stiffness", "hardening_stiffness", -20.0)],
                VerdictKind::Named,
            ),
            (
                &[("coulomb_friction", "dry_friction", 0.0), ("stribeck_friction", "dry_friction", -1.0)],
                VerdictKind::Family,
            ),
            (
                &[("coulomb_friction", "dry_friction", 0.0), ("quadratic_damping", "nonlinear_damping", -1.0)],
                VerdictKind::Ambiguous,
            ),
            (&[("cubic_stiffness", "hardening_stiffness", 0.0)], VerdictKind::Named),
        ];
        for (rivals, expected) in table {
            let (kind, s) = decide(rivals);
            assert_eq!(kind, expected, "{rivals:?} {s:?}");
        }
        assert_eq!(verdict(&[]), VerdictKind::NoSignificantMismatch);
    }

    #[test]
    fn a_set_says_more_than_one_that_it_contains() {
        let set = |members: &[(&'static str, &'static str)]| Hypothesis {
            claims: members.iter().map(|(m, f)| claim(m, f)).collect(),
            log_evidence: 0.0,
        };
        let (overflow, delay) = (("overflow", "overflow"), ("delay", "signal_path_lag"));
        let limit = ("output_saturation", "sensor_range");
        let (told, more) = (set(&[overflow, delay]), set(&[delay, limit, overflow]));
        assert!(more.says_more_than(&told) && !told.says_more_than(&more) && !told.says_more_than(&told));
        assert!(!set(&[delay, limit, limit]).says_more_than(&told), "it lacks one");
        assert!(!told.says_more_than(&set(&[])), "nothing is told");
    }

    #[test]
    fn probabilities_sum_to_one_and_ignore_failures() {
        let p = probabilities(&[-1e9, 3.0, f64::NEG_INFINITY, 2.0], 0.4);
        assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!(p[2], 0.0);
        assert!(p[1] > p[3]);
        assert_eq!(probabilities(&[f64::NAN], 0.4), vec![0.0]);
    }
}
