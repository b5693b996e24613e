//! Is it the simulation's own numerics? Variants of hold, clock and smoothing, fitted like any other explanation.

use super::finish::without_slight_colour;
use crate::budget::Step;
use crate::mechanism::numerics::{SHARPER, SOLVER_ARTEFACT, variants};
use crate::mechanism::{Purpose, Rewritten};
use crate::model::hypothesis::{Effect, Hypothesis, Setting};
use crate::slot::{Slot, Structure};

/// Log likelihood that a variant must gain to be listed at all.
const LEAST: f64 = 3.0;
/// Times that the same kind of variant is applied again (friction smoothed three times too wide may be nine times too wide).
const AGAIN: usize = 3;

/// The best variant of the numerics as a hypothesis; `None` where none gains.
pub fn artefact<'d>(setting: &Setting<'d>, none: &Hypothesis<'d>) -> Option<Hypothesis<'d>> {
    let mut best: Option<(f64, Hypothesis<'d>)> = None;
    for variant in variants(&none.base.document(), setting.data.period_s) {
        if setting.budget.omits(Step::Numerics) {
            break;
        }
        let odds_against = variant.odds_against();
        let mut document = variant.simulation;
        for round in 0..AGAIN {
            let Some(base) = setting.fit(&document, &none.base.values(), Some(&none.base.whitener), 2, 12) else {
                break;
            };
            let evidence = setting.evidence(&base) - odds_against;
            let reached = best.as_ref().map_or(none.log_evidence + LEAST, |(_, b)| b.log_evidence);
            if evidence <= reached {
                break;
            }
            let Some(mut slot) = changed(setting, &document) else { break };
            slot.whereabouts = variant.what.to_owned();
            let written = Rewritten {
                simulation: document.clone(),
                amplitudes: Vec::new(),
                shapes: Vec::new(),
                neutral: Vec::new(),
                apart: false,
                linear: false,
                report: Vec::new(),
                states: Vec::new(),
                sum_of_others: false,
                purpose: Purpose::Refit,
            };
            let effect = Effect { mechanism: &SOLVER_ARTEFACT, slot, written, concealment: None };
            best = Some((odds_against, Hypothesis { effects: vec![effect], base, log_evidence: evidence }));
            // Further the same way.
            let further = variants(&document, setting.data.period_s).into_iter().find(|v| v.what == variant.what);
            match further.map(|v| v.simulation) {
                Some(next) if round + 1 < AGAIN && variant.what == SHARPER => document = next,
                _ => break,
            }
        }
    }
    if let Some((odds_against, b)) = &mut best
        && !setting.budget.omits(Step::Numerics)
        && let Some(base) = without_slight_colour(setting, &b.base)
    {
        b.log_evidence = setting.evidence(&base) - *odds_against;
        b.base = base;
    }
    best.map(|(_, h)| h)
}

/// The slot of the equation that a variant changed; the first input where only the hold changed.
fn changed(setting: &Setting<'_>, document: &hysid_plant::Simulation) -> Option<Slot> {
    let original = &setting.original;
    let structure = Structure::of(original);
    let has_slot = |label: &str| structure.slots.iter().any(|s| s.label == label);
    let differs = |name: &str, e: &hysid_plant::Expr| document.state(name).is_some_and(|d| d.derivative != *e);
    let changed = original.states.iter().filter(|s| differs(&s.name, &s.derivative));
    // Of several the first at which something could be missing.
    let state = changed.clone().find(|s| has_slot(&format!("state:{}", s.name))).or_else(|| changed.clone().next());
    let output =
        original.outputs.iter().find(|o| document.output(&o.column).is_some_and(|d| d.expression != o.expression));
    let label = match (state, output, original.inputs.first()) {
        (Some(s), _, _) => format!("state:{}", s.name),
        (None, Some(o), _) => format!("output:{}", o.column),
        (None, None, Some(u)) => format!("input:{}", u.symbol),
        _ => return structure.slots.first().cloned(),
    };
    structure.slots.iter().find(|s| s.label == label).or_else(|| structure.slots.first()).cloned()
}
