//! The records of a verdict: what the fitted hypotheses say, in the form in which it is written to the file.

use std::collections::BTreeMap;

use hysid_plant::{Expr, Simulation};

use super::bootstrap::{ratio_of_rms, rms};
use super::locate;
use super::report_values::{reported, sentence};
use crate::data::DataSet;
use crate::evidence::{Series, norm2};
use crate::file::*;
use crate::mechanism::{Block, Family, number_with_unit};
use crate::model::base::{Base, Interval};
use crate::model::hold::FreeRun;
use crate::model::hypothesis::{Effect, Hypothesis};
use crate::request::{Question, words};
use crate::search::candidate::Candidate;
use crate::text::number;
use crate::verdict::Support;
use crate::verdict::weigh::Contest;

/// Values of the outputs by their columns.
pub fn by_column(simulation: &Simulation, values: &[f64]) -> BTreeMap<String, f64> {
    simulation.outputs.iter().map(|o| o.column.clone()).zip(values.iter().copied()).collect()
}

/// The effects of the best set.
pub fn effects(best: &Hypothesis<'_>, support: &[Support]) -> Vec<EffectRecord> {
    let record = |(e, s): (&Effect, &Support)| {
        let parameters = reported(&best.base, e);
        EffectRecord {
            mechanism: e.mechanism.id.into(),
            family: e.mechanism.family.name().into(),
            slot: e.slot.label.clone(),
            probability: s.mechanism,
            family_probability: s.family,
            support: s.mechanism,
            family_support: s.family,
            concealment: e.concealment,
            sentence: sentence(e, &parameters),
            parameters,
        }
    };
    best.effects.iter().zip(support).map(record).collect()
}

/// From when on the recordings part, where a change at one moment is among the effects: its moment to the end of the first recording.
pub fn from_moment(effects: &[EffectRecord], data: &DataSet) -> Option<[f64; 2]> {
    let changes = || effects.iter().filter(|e| e.mechanism == "abrupt_change");
    let moment = changes().find_map(|e| e.parameters.iter().find(|p| p.name == "t_0"))?;
    let last = data.stretches.iter().rfind(|s| s.recording == 0)?;
    Some([moment.value, last.start_s + last.len() as f64 * data.period_s])
}

/// Rival explanations: for each effect that is not in the winning set, the likeliest set that has it, and the probability of all that have it. A set that says
/// what the winner says and more is no rival of it, and counts for nothing but what it shares with it.
pub fn alternatives(contest: &Contest<'_, '_>, kind: VerdictKind) -> Vec<AlternativeRecord> {
    let Contest { pool, weighed, probability, winner } = *contest;
    let mut out: Vec<AlternativeRecord> = Vec::new();
    let mut order: Vec<usize> = (0..pool.len()).collect();
    order.sort_by(|&a, &b| weighed[b].log_evidence.total_cmp(&weighed[a].log_evidence));
    let says_more: Vec<bool> = weighed.iter().map(|w| w.says_more_than(&weighed[winner])).collect();
    for i in order {
        for e in &pool[i].effects {
            let winning = pool[winner].effects.iter().any(|w| w.states_the_same(e));
            let listed = out.iter().any(|a| a.mechanism == e.mechanism.id && a.slot == e.slot.label);
            let left_out = if winning { kind != VerdictKind::Ambiguous } else { says_more[i] };
            if listed || left_out {
                continue;
            }
            let total: f64 = (weighed.iter().zip(probability).zip(&says_more))
                .filter(|(_, more)| winning || !**more)
                .filter(|((w, _), _)| w.claims.iter().any(|c| c.mechanism == e.mechanism.id && c.slot == e.slot.label))
                .map(|((_, p), _)| p)
                .sum();
            out.push(AlternativeRecord {
                mechanism: e.mechanism.id.into(),
                family: e.mechanism.family.name().into(),
                slot: e.slot.label.clone(),
                probability: total.min(1.0),
                // An effect that is told stands in the set that is told.
                evidence_gap: if winning {
                    0.0
                } else {
                    2.0 * (weighed[winner].log_evidence - weighed[i].log_evidence)
                },
                separation: None,
            });
        }
    }
    out.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    out.truncate(12);
    out
}

/// Where the first effect of the best set (the one that was found first) shows; without effects, where the likeliest candidate does.
pub fn location(none: &Hypothesis<'_>, best: &Hypothesis<'_>, candidates: &[Candidate]) -> Option<LocationRecord> {
    let effect = best.effects.first();
    let candidate = match effect {
        Some(e) => candidates.iter().find(|c| c.mechanism.id == e.mechanism.id && c.slot.is_at(&e.slot))?,
        None => candidates.first()?,
    };
    let data = none.base.model.data();
    let (_, r) = none.base.evidence();
    // What the effects took away, whitened: evidence in output space.
    let white = none.base.whitener.apply(&data.layout, &none.base.fit.residual);
    let taken: Vec<f64> = none.base.fit.residual.iter().zip(&best.base.fit.residual).map(|(b, a)| b - a).collect();
    let g = if best.effects.is_empty() { white } else { none.base.whitener.apply(&data.layout, &taken) };
    let mut time_s: Vec<[f64; 2]> = Vec::new();
    for s in &data.layout.series {
        if data.stretches[s.stretch].recording != 0 {
            continue;
        }
        let start = data.stretches[s.stretch].start_s + s.first as f64 * data.period_s;
        for rows in locate::active_rows(s, &r, &g) {
            let at = |row: usize| start + (row - s.rows.start) as f64 * data.row_period_s();
            time_s.push([at(rows.start), at(rows.end.max(1) - 1)]);
        }
    }
    // Where it shows most.
    let shown = |s: &Series| norm2(&g[s.rows.clone()]);
    let loudest = data.layout.series.iter().max_by(|a, b| shown(a).total_cmp(&shown(b)))?;
    let band_hz = locate::bands(
        &none.base.fit.residual[loudest.rows.clone()],
        &best.base.fit.residual[loudest.rows.clone()],
        data.row_period_s(),
    );
    let region = super::region::words(none, best).unwrap_or_else(|| "everywhere on the trajectory".into());
    Some(LocationRecord {
        slot: candidate.slot.label.clone(),
        block: candidate.mechanism.block_at(&candidate.slot).name().into(),
        time_s,
        band_hz,
        region,
    })
}

/// The block in which a correction acts, by its loudest term: with memory, along a velocity (the state itself whose equation it enters, or an
/// input that is called one), or along a position.
pub fn block_of(correction: &CorrectionRecord) -> Block {
    let slot = &correction.slot;
    let own = slot.split_once(':').map_or("", |(_, own)| own);
    let symbols = correction.loudest().and_then(|t| Expr::parse(&t.term).ok()).map(|e| e.symbols()).unwrap_or_default();
    if slot.starts_with("parameter:") {
        Block::TimeVariation
    } else if slot.starts_with("input:") {
        Block::Input
    } else if correction.signature.side == "output" {
        Block::Output
    } else if correction.signature.memory != "none" {
        Block::Hysteresis
    } else if symbols.iter().any(|s| s == own || s.starts_with('v')) {
        Block::Damping
    } else {
        Block::Restoring
    }
}

/// Free-run errors on the hold-out by recording and output, `before` and `after` the effects; `blocks`: it is made of blocks of the estimation recordings.
pub fn fits(
    simulation: &Simulation,
    held: &DataSet,
    before: Option<&FreeRun>,
    after: Option<&FreeRun>,
    seed: u64,
    blocks: bool,
) -> Vec<FitRecord> {
    let mut out = Vec::new();
    for (r, name) in held.recordings.iter().enumerate() {
        for (o, output) in simulation.outputs.iter().enumerate() {
            let errors = |run: &FreeRun| -> Vec<f64> {
                held.layout
                    .series
                    .iter()
                    .filter(|s| s.output == o && held.stretches[s.stretch].recording == r)
                    .flat_map(|s| s.rows.clone())
                    .filter(|&row| before.is_none_or(|b| b.scored[row]) && after.is_none_or(|a| a.scored[row]))
                    .map(|row| held.y[row] - run.prediction[row])
                    .collect()
            };
            let b = before.map(errors);
            let a = after.map(errors);
            let rmse_before = b.as_ref().map(|e| rms(e)).and_then(finite);
            let rmse_after = a.as_ref().map(|e| rms(e)).and_then(finite);
            let ratio = match (&a, &b) {
                (Some(a), Some(b)) => Some(ratio_of_rms(a, b, seed)),
                _ => None,
            };
            out.push(FitRecord {
                recording: if blocks { format!("{name}: held-out blocks") } else { name.clone() },
                output: output.column.clone(),
                rmse_before,
                rmse_after,
                ratio: ratio.and_then(|r| finite(r.value)),
                ratio_low: ratio.and_then(|r| finite(r.low)),
                ratio_high: ratio.and_then(|r| finite(r.high)),
                rmse_black_box: None,
            });
        }
    }
    out
}

/// The simulation's own parameters as they were fitted.
pub fn calibrated(base: &Base<'_>, simulation: &Simulation) -> Vec<ParameterRecord> {
    base.intervals()
        .into_iter()
        .filter_map(|i| {
            let p = simulation.parameter(&i.name)?;
            let unit = p.unit.as_ref().map(ToString::to_string).unwrap_or_default();
            let (low, high) = i.low_and_high();
            let (low, high) = (low.and_then(finite), high.and_then(finite));
            Some(ParameterRecord { name: i.name, value: i.value, low, high, unit })
        })
        .collect()
}

/// Parameters of the calibrated simulation that stand at a bound or far from what the user gave.
pub fn absorbing(base: &Base<'_>, simulation: &Simulation) -> Vec<String> {
    let mut out = Vec::new();
    for Interval { name, value, ends, at_bound } in base.intervals() {
        let Some(p) = simulation.parameter(&name) else { continue };
        let unit = p.unit.as_ref();
        if at_bound {
            out.push(format!("parameter `{name}` of the recalibrated simulation stands at a bound ({}): it may be absorbing something", number_with_unit(value, unit)));
        } else if p.value != 0.0
            && (value / p.value > 2.0 || value / p.value < 0.5)
            && ends.is_none_or(|[low, high]| p.value < low || p.value > high)
        {
            out.push(format!(
                "parameter `{name}` of the recalibrated simulation is {}, the file says {}",
                number_with_unit(value, unit),
                number_with_unit(p.value, unit)
            ));
        }
    }
    out
}

/// Probability below which a rival is not told in the summary.
const WORTH_TELLING: f64 = 0.005;

/// The verdict in a sentence or two; `varying` says what varies, where a correction without a name says so, `unequal` which strength may depend on
/// the motion.
pub fn summary(file: &DiagnosisFile, varying: Option<&str>, unequal: Option<&str>) -> String {
    let sentences = || file.effects.iter().map(|e| e.sentence.clone()).collect::<Vec<_>>().join(" ");
    let rivals: Vec<String> = (file.alternatives.iter().take(3))
        .filter(|a| a.probability >= WORTH_TELLING)
        .map(|a| format!("{} at {} ({:.0} %)", a.mechanism, a.slot, 100.0 * a.probability))
        .collect();
    match file.verdict {
        VerdictKind::NoSignificantMismatch => {
            "The recalibrated simulation and the recording differ by no more than the noise.".into()
        }
        VerdictKind::Named => sentences(),
        VerdictKind::Family => {
            let families: Vec<&str> = file.effects.iter().map(|e| e.family.as_str()).collect();
            format!("The family is firm ({}), the member is not. The likeliest: {}", families.join(", "), sentences())
        }
        VerdictKind::Ambiguous if file.effects.is_empty() => {
            "Something is missing, and nothing that was fitted explains it.".into()
        }
        VerdictKind::Ambiguous => {
            let or = unequal.map_or_else(String::new, |u| format!(", or a law that the catalogue does not have ({u})"));
            match rivals.as_slice() {
                [] | [_] if or.is_empty() => format!("Not firm, and no rival of weight: {}", sentences()),
                _ => format!(
                    "Several explanations remain: {}{or}. The likeliest set: {}",
                    rivals.join(", "),
                    sentences()
                ),
            }
        }
        VerdictKind::NotInCatalogue => match varying.or(unequal) {
            Some(varying) => {
                format!(
                    "Something is missing that no mechanism of the catalogue explains. What it looks like: {varying}."
                )
            }
            None => {
                let loudest = file.correction.as_ref().and_then(|c| Some((c.loudest()?, c)));
                let told = loudest.map_or_else(String::new, |(t, c)| {
                    format!(", first of all {} times `{}` at {}", number(t.coefficient), t.term, c.slot)
                });
                format!(
                    "Something is missing that no mechanism of the catalogue explains; a sparse correction describes it{told}."
                )
            }
        },
    }
}

/// The verdict that nothing is missing where the simulation explains next to nothing of these outputs, each with the share that it leaves; `None` where there
/// is no such output.
pub fn without_mismatch(unexplained: &[(&str, f64)]) -> Option<String> {
    let told: Vec<String> =
        unexplained.iter().map(|(output, share)| format!("{:.0} % of `{output}`", 100.0 * share)).collect();
    (!told.is_empty()).then(|| {
        format!("The recalibrated simulation leaves {}: it explains next to nothing of it, and no mechanism of the catalogue is told from noise there.", told.join(" and "))
    })
}

/// Families whose effects go by the clock of a recording.
const IN_TIME: [Family; 3] = [Family::TimeVariation, Family::SensorDrift, Family::ExternalDisturbance];

/// What the hold-out says against the augmented simulation, which it has not chosen and does not take back; `None` where it says nothing.
pub fn refutation(fit: &[FitRecord], effects: &[EffectRecord]) -> Option<String> {
    let worse = |fit: &FitRecord| {
        let told = |ratio: f64| format!("{} times the error of `{}` on {}", number(ratio), fit.output, fit.recording);
        fit.refuted().map(told)
    };
    let told: Vec<String> = fit.iter().filter_map(worse).collect();
    let in_time = effects.iter().any(|e| IN_TIME.iter().any(|family| e.family == family.name()));
    let why = if in_time { ": what changed during one recording need not change in another" } else { "" };
    (!told.is_empty()).then(|| {
        format!("The hold-out does not bear it out: the simulation makes {} with it{why}.", told.join(" and "))
    })
}

/// What became of the sets that the caller wanted weighed.
pub fn answers(pool: &[Hypothesis<'_>], questions: &[Question]) -> Vec<String> {
    let top = pool.iter().map(|h| h.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    questions
        .iter()
        .filter_map(|q| {
            let mut asked: Vec<(&str, &str)> = q.iter().map(|(m, s)| (m.as_str(), s.as_str())).collect();
            asked.sort_unstable();
            // A force on a part and one between it and another are asked for by one label.
            let says_so = pool.iter().filter(|h| h.names() == asked);
            let h = says_so.max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))?;
            let values: Vec<String> = h.effects.iter().map(|e| sentence(e, &reported(&h.base, e))).collect();
            Some(format!(
                "considered {}: log evidence {:.1} below the best set that was fitted, {:.1} above none. {}",
                words(q),
                top - h.log_evidence,
                h.log_evidence - pool[0].log_evidence,
                values.join(" ")
            ))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_correction_has_the_place_of_its_loudest_term() {
        let place = |slot: &str, side: &str, memory: &str, terms: &[(&str, f64)]| {
            let term =
                |&(t, err): &(&str, f64)| TermRecord { term: t.into(), slot: slot.into(), coefficient: 1.0, err };
            let terms = terms.iter().map(term);
            let signature = SignatureRecord {
                memory: memory.into(),
                rate_dependent: false,
                symmetry: "odd".into(),
                side: side.into(),
            };
            block_of(&CorrectionRecord { slot: slot.into(), terms: terms.collect(), signature, ratio: None }).name()
        };
        assert_eq!(place("state:w", "plant", "none", &[("sin(2.5*q)*w", 0.9), ("q^3", 0.1)]), "damping");
        assert_eq!(place("state:w", "plant", "none", &[("sin(2.5*q)*w", 0.1), ("q^3", 0.9)]), "restoring");
        assert_eq!(place("state:w", "plant", "rate_independent", &[("play(q, 0.3)", 0.9)]), "hysteresis");
        assert_eq!(place("output:force_N", "plant", "none", &[("abs(x)*v", 0.9)]), "damping");
        assert_eq!(place("output:x_m", "output", "none", &[("y^2", 0.9)]), "output");
        assert_eq!(place("input:u", "input", "none", &[("u^2", 0.9)]), "input");
        assert_eq!(place("parameter:k", "time", "none", &[("k*sin(2.5*t)", 0.9)]), "time_variation");
    }

    #[test]
    fn what_the_hold_out_refutes_is_told() {
        let fit = |ratio: f64, low: f64| FitRecord {
            recording: "val.csv".into(),
            output: "h_m".into(),
            rmse_before: Some(1.0),
            rmse_after: Some(ratio),
            ratio: Some(ratio),
            ratio_low: Some(low),
            ratio_high: Some(2.0 * ratio),
            rmse_black_box: None,
        };
        let refuted = |ratio, low| fit(ratio, low).refuted();
        assert_eq!(refuted(1.5, 1.2), Some(1.5));
        assert_eq!((refuted(1.5, 0.9), refuted(1.01, 1.005), refuted(0.5, 0.4)), (None, None, None));
        assert_eq!(refutation(&[fit(0.5, 0.4)], &[]), None);
        let told = refutation(&[fit(0.5, 0.4), fit(1.5, 1.2)], &[]).unwrap();
        assert!(told.contains("1.5 times the error of `h_m` on val.csv"), "{told}");
    }
}
