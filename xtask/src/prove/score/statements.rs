//! Statements with a probability: how often they are right, and the firm ones that are wrong.

use super::row::{Row, family_fits, mechanism_fits};

/// A statement of an effect with its probabilities.
pub(super) struct Statement {
    pub(super) probability: f64,
    pub(super) family_probability: f64,
    pub(super) right: bool,
    pub(super) family_right: bool,
}

pub(super) fn statements(rows: &[Row]) -> Vec<Statement> {
    let mut list = Vec::new();
    for r in rows {
        let Some(v) = r.verdict().filter(|v| v.alarmed()) else { continue };
        for s in &v.effects {
            list.push(Statement {
                probability: s.probability,
                family_probability: s.family_probability,
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
