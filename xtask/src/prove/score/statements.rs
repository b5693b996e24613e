//! Statements with a probability: how often they are right, and the firm ones that are wrong.

use super::row::{Row, family_fits, mechanism_fits};

/// A statement of an effect with its probabilities.
#[derive(Debug, Clone)]
pub struct Statement {
    /// The case.
    pub case: String,
    /// The mechanism that was said.
    pub mechanism: String,
    /// Whether the verdict is that the catalogue does not have it.
    pub imitation: bool,
    /// Members of the set.
    pub members: usize,
    /// Probability of the mechanism.
    pub probability: f64,
    /// Probability of its family.
    pub family_probability: f64,
    /// Support of the mechanism, before it was recalibrated.
    pub support: f64,
    /// The same for the family.
    pub family_support: f64,
    /// Whether the case conceals this mechanism.
    pub right: bool,
    /// Whether it conceals one of this family.
    pub family_right: bool,
}

/// Every effect that was stated.
pub fn statements(rows: &[Row]) -> Vec<Statement> {
    let mut list = Vec::new();
    for r in rows {
        let Some(v) = r.verdict().filter(|v| v.alarmed()) else { continue };
        for s in &v.effects {
            list.push(Statement {
                case: r.label.id.clone(),
                mechanism: s.mechanism.clone(),
                imitation: v.kind == "not_in_catalogue",
                members: v.effects.len(),
                probability: s.probability,
                family_probability: s.family_probability,
                support: s.support.0,
                family_support: s.support.1,
                right: r.label.effects.iter().any(|e| mechanism_fits(e, s)),
                family_right: r.label.effects.iter().any(|e| family_fits(e, s)),
            });
        }
    }
    list
}

/// A sentence where a case has a firm statement that is wrong.
pub(super) fn firm_and_wrong(r: &Row) -> Option<String> {
    let v = r.verdict().filter(|v| v.alarmed())?;
    let wrong: Vec<String> = v
        .effects
        .iter()
        .filter(|s| {
            let mechanism = s.probability >= 0.9 && !r.label.effects.iter().any(|e| mechanism_fits(e, s));
            let family = s.family_probability >= 0.9 && !r.label.effects.iter().any(|e| family_fits(e, s));
            mechanism || family
        })
        .map(|s| {
            if s.probability >= 0.9 {
                format!("{} ({:.2})", s.mechanism, s.probability)
            } else {
                format!("family {} ({:.2})", s.family, s.family_probability)
            }
        })
        .collect();
    let truth: Vec<&str> = r.label.effects.iter().map(|e| e.mechanism).collect();
    (!wrong.is_empty()).then(|| {
        format!(
            "{}: said {}; true: {} on {:?}, DNR {:.2}, {} samples, {} noise",
            r.label.id,
            wrong.join(", "),
            if truth.is_empty() { "nothing".into() } else { truth.join(" + ") },
            r.label.plant,
            r.label.dnr,
            r.label.samples,
            r.label.noise.name()
        )
    })
}
