//! Whether a change at a moment may as well be a change with the place.
//!
//! A tank that falls below the limit of a hidden thermostat once, at the end, has a heater from then on: nothing in the recording tells that from a parameter
//! that changed at that moment. What was never there before the moment, or never after it, may be what depends on where the machine is.

use hysid_plant::Expr;

use crate::model::along;
use crate::model::hypothesis::{Effect, Hypothesis};
use crate::slot::is_turn;
use crate::text::number;

/// Share of the smaller side that may be on the wrong side of a level which parts before from after.
const MIXED: f64 = 0.2;

/// A level of one quantity that parts what is before a moment from what is after it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Level {
    at: f64,
    /// Whether the smaller side is above it.
    above: bool,
    /// Samples on the wrong side.
    wrong: usize,
}

/// What may change with the place in the place of such an effect, in words; `None` where an effect has no moment, or the recording has been everywhere before it and after it.
pub fn place_of_change(h: &Hypothesis<'_>, effect: &Effect) -> Option<String> {
    let values = h.base.values();
    let moment = effect.moments().next()?;
    let moment = *values.parameters.get(&moment.name)?;
    let (data, simulation) = (h.base.model.data(), h.base.model.simulation());
    let inputs = simulation.inputs.iter().map(|u| u.symbol.as_str());
    let states = simulation.states.iter().map(|s| s.name.as_str()).filter(|name| !is_turn(simulation, name));
    let names: Vec<&str> = states.chain(inputs).collect();
    let expressions: Vec<Expr> = names.iter().map(|n| Expr::symbol(*n)).collect();
    let mut best: Option<(Level, &str, bool)> = None;
    for (name, series) in names.into_iter().zip(along(&h.base, &expressions)?) {
        let sided = data
            .stretches
            .iter()
            .zip(&series)
            .flat_map(|(s, x)| x.iter().zip(s.times()).map(|(x, t)| (*x, t >= moment)));
        let Some((level, after)) = level(sided.collect()) else { continue };
        if best.is_none_or(|(b, ..)| level.wrong < b.wrong) {
            best = Some((level, name, after));
        }
    }
    best.map(|(level, name, after)| {
        let (side, when) = (if level.above { "above" } else { "below" }, if after { "after" } else { "before" });
        let (level, moment) = (number(level.at), number(moment));
        format!(
            "something that changes where `{name}` is {side} {level} (the recording is there only {when} {moment} s)"
        )
    })
}

/// The level that parts the values on one side of a moment from those on the other, if one does, and whether the smaller side is the later one.
fn level(mut sided: Vec<(f64, bool)>) -> Option<(Level, bool)> {
    let later = sided.iter().filter(|(_, after)| *after).count();
    let smaller_is_later = 2 * later <= sided.len();
    let smaller = if smaller_is_later { later } else { sided.len() - later };
    let others = sided.len() - smaller;
    sided.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut below, mut others_below) = (0, 0);
    let mut best: Option<Level> = None;
    for pair in sided.windows(2) {
        let [(x, after), (next, _)] = [pair[0], pair[1]];
        if after == smaller_is_later {
            below += 1
        } else {
            others_below += 1
        }
        if x == next {
            continue;
        }
        // The smaller side below the level, or above it.
        for (above, wrong) in [(false, smaller - below + others_below), (true, below + others - others_below)] {
            if best.is_none_or(|b| wrong < b.wrong) {
                best = Some(Level { at: 0.5 * (x + next), above, wrong });
            }
        }
    }
    best.filter(|b| (b.wrong as f64) < MIXED * smaller as f64).map(|b| (b, smaller_is_later))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_parts_what_was_never_there_before() {
        // A slow fall that goes on: later is lower throughout.
        let fall = (0..100).map(|i| (10.0 - 0.1 * f64::from(i), i >= 80)).collect();
        let (found, later) = level(fall).unwrap();
        assert!(later && !found.above && found.wrong == 0 && (found.at - 2.05).abs() < 1e-9, "{found:?}");
        // The same upwards, with the smaller side first.
        let rise = (0..100).map(|i| (0.1 * f64::from(i), i >= 20)).collect();
        let (found, later) = level(rise).unwrap();
        assert!(!later && !found.above && found.wrong == 0, "{found:?}");
        // What moves to and fro has been everywhere.
        let wave: Vec<(f64, bool)> = (0..400).map(|i| ((0.1 * f64::from(i)).sin(), i >= 300)).collect();
        assert_eq!(level(wave), None);
        // One input that is switched on at that moment.
        let step = (0..50).map(|i| (f64::from(u8::from(i >= 30)), i >= 30)).collect();
        let (found, later) = level(step).unwrap();
        assert!(later && found.above && found.at == 0.5 && found.wrong == 0);
        assert_eq!(level(Vec::new()), None);
        assert_eq!(level(vec![(1.0, false); 5]), None);
    }
}
