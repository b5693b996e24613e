//! What switches: relays of a coordinate, by themselves and as the gain of an input.

use hysid_signal::range;

use super::shapes::{Kind, Shape, both, free, in_turn, sorted, widths};
use super::varying::course::Series;
use crate::evidence::quantile;

/// Shares of the samples below the levels between which the gain of an input may change.
const SHIFTS: [(f64, f64); 4] = [(0.2, 0.5), (0.5, 0.8), (0.2, 0.8), (0.3, 0.7)];

/// The same of the levels between which a force may switch.
const SWITCHES: [(f64, f64); 6] = [(0.1, 0.35), (0.35, 0.65), (0.65, 0.9), (0.1, 0.65), (0.35, 0.9), (0.1, 0.9)];

/// Relays of a coordinate of the plant: a force that switches. No sensor does. About zero, or, where a coordinate stays on one side of it as a level or a
/// temperature does, between two of its levels.
pub fn relays(name: &str, x: &[Vec<f64>]) -> Vec<Shape> {
    let of = |(lower, upper): (f64, f64)| {
        let text = format!("relay({name}, {}, {})", free(lower), free(upper));
        Shape::new(text, Kind::Play, switched(x, lower, upper))
    };
    let (low, high) = range(x.iter().flatten().copied());
    if low > 0.0 || high < 0.0 {
        return levels(x, &SWITCHES).map(of).collect();
    }
    widths(x).map(|r| of((-r, r))).collect()
}

/// Pairs of levels at these shares of a coordinate's samples; none that are one.
fn levels(x: &[Vec<f64>], shares: &[(f64, f64)]) -> impl Iterator<Item = (f64, f64)> {
    let all = sorted(x, |v| v);
    let pair = move |&(low, high): &(f64, f64)| Some((quantile(&all, low)?, quantile(&all, high)?));
    shares.iter().filter_map(pair).filter(|(lower, upper)| upper > lower)
}

/// A relay of a coordinate, as the operator has it: at rest it is down.
fn switched(x: &[Vec<f64>], lower: f64, upper: f64) -> Series {
    let switch = |up: &mut f64, v: f64| {
        if v > upper {
            *up = 1.0;
        } else if v < lower {
            *up = -1.0;
        }
        *up
    };
    in_turn(x, |_| -1.0, switch)
}

/// An input whose gain changes as a coordinate rises beyond one level and changes back below another, as that of a motor behind a gear that shifts.
pub fn gears((u, input): (&str, &[Vec<f64>]), (name, x): (&str, &[Vec<f64>])) -> Vec<Shape> {
    let of = |(lower, upper): (f64, f64)| {
        let text = format!("{u}*relay({name}, {}, {})", free(lower), free(upper));
        Shape::new(text, Kind::Play, both(input, &switched(x, lower, upper), |u, gear| u * gear))
    };
    levels(x, &SHIFTS).map(of).collect()
}

/// What a term of [`relays`] or [`gears`] tells, in words.
pub fn told_switch(term: &str) -> Option<String> {
    let (input, relay) = term.split_once("relay(")?;
    let [name, lower, upper] = <[&str; 3]>::try_from(relay.strip_suffix(')')?.split(", ").collect::<Vec<_>>()).ok()?;
    let what = match input.strip_suffix('*') {
        Some(u) => format!("the gain of `{u}`"),
        None if input.is_empty() => "something".to_owned(),
        None => return None,
    };
    Some(format!("{what} switches as `{name}` rises above {upper}, and back as it falls below {lower}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_shifts_up_at_one_level_and_down_at_another() {
        let up_and_down: Vec<f64> = (0..=100).chain((0..100).rev()).map(f64::from).collect();
        let input = vec![vec![2.0; up_and_down.len()]];
        let gear = gears(("u", &input), ("w", &[up_and_down])).swap_remove(2);
        assert_eq!(gear.text, "u*relay(w, 20, 80)");
        let high: Vec<usize> = (0..201).filter(|&n| gear.series[0][n] > 0.0).collect();
        assert!(high.iter().copied().eq(81..=180) && gear.series[0].iter().all(|g| g.abs() == 2.0), "{high:?}");
        // What stands still shifts nothing.
        assert!(gears(("u", &input), ("w", &[vec![1.0; 201]])).is_empty());
    }

    #[test]
    fn a_switch_is_told_in_words() {
        let told = |term| told_switch(term).unwrap_or_default();
        assert_eq!(
            told("relay(V, 0.902, 1.81)"),
            "something switches as `V` rises above 1.81, and back as it falls below 0.902"
        );
        assert!(told("u*relay(w, 20, 80)").starts_with("the gain of `u` switches as `w` rises above 80,"));
        assert!(["V^2", "relay(V, 1)", "sin(2*V)relay(V, 1, 2)"].into_iter().all(|t| told_switch(t).is_none()));
    }

    #[test]
    fn a_level_switches_between_two_of_its_own_and_a_motion_about_zero() {
        let filled: Vec<f64> = (0..=100).chain((0..100).rev()).map(f64::from).map(|x| 40.0 + x).collect();
        let texts = |x: &[f64]| relays("h", &[x.to_vec()]).into_iter().map(|s| s.text).collect::<Vec<_>>();
        let of_level = relays("h", std::slice::from_ref(&filled));
        let siphon = of_level.iter().find(|s| s.text == "relay(h, 50, 130)").expect("a tenth and nine tenths");
        // Down until it is full, then up until it is nearly empty.
        let up = |n: usize| siphon.series[0][n] > 0.0;
        assert!(of_level.len() == SWITCHES.len() && (0..201).all(|n| up(n) == (91..=190).contains(&n)));
        let below: Vec<f64> = filled.iter().map(|x| -x).collect();
        assert!(texts(&below).contains(&"relay(h, -130, -50)".to_owned()), "{:?}", texts(&below));
        let swing: Vec<f64> = filled.iter().map(|x| x - 90.0).collect();
        assert!(texts(&swing).iter().all(|t| t.starts_with("relay(h, -")) && !texts(&swing).is_empty());
        // What stands still switches nothing.
        assert!(texts(&[1.0; 201]).is_empty());
    }
}
