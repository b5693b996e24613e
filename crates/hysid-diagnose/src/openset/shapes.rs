//! The shapes of generic terms: curves, knees and plays of one coordinate, coefficients that change in time, and products of a function of the
//! displacement with one of the velocity. What lags and delays make of a coordinate: [`super::past`].

use std::f64::consts::TAU;

use hysid_signal::range;

use super::varying::course::Series;
use super::written::FORM;
use crate::data::DataSet;
use crate::evidence::quantile;
use crate::text::number;

/// What a generic term is a function of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// An odd function of its coordinate.
    Odd,
    /// An even or one-sided one.
    Even,
    /// A play.
    Play,
    /// What a lag leaves.
    Lag,
    /// Something that changes over the record.
    Time,
}

/// A shape with its samples.
pub struct Shape {
    /// As it is written over the names of its coordinates.
    pub text: String,
    /// What it is a function of.
    pub kind: Kind,
    /// Its samples.
    pub series: Series,
}

impl Shape {
    pub(super) fn new(text: String, kind: Kind, series: Series) -> Self {
        Self { text, kind, series }
    }
}

/// Shares of the samples that lie within a knee, and within the half width of a play or relay over [`WIDTH`].
const KNEES: [f64; 2] = [0.5, 0.8];
/// The same within a limit.
const LIMITS: [f64; 4] = [0.5, 0.75, 0.9, 0.97];
const WIDTHS: [f64; 3] = [0.2, 0.5, 0.8];
const WIDTH: f64 = 0.7;

/// Tents over the recording by which a coordinate's coefficient may change.
const TENTS: usize = 6;

/// Cycles over the range of a displacement: half octaves, so that the fit of a wave number begins in the right valley. More cycles go by between samples
/// of a fast motion.
const CYCLES: [f64; 5] = [1.0, 1.41, 2.0, 2.83, 4.0];

/// Width of a gate over the distance of its knee.
const GATE: f64 = 0.1;

/// A knee, a width or a wave number as it is written: three digits, and more where they would make it one of the numbers that are part of a term's form
/// ([`FORM`]), which no fit moves.
pub(super) fn free(x: f64) -> String {
    let rounded = number(x);
    if !FORM.iter().any(|n| rounded.parse() == Ok(*n)) {
        return rounded;
    }
    let near = if x == x.round() { x * (1.0 + 1e-4) } else { x };
    format!("{near:.6}")
}

/// A moment as it is written, to a thousandth of a width.
fn moment(t: f64, width: f64) -> String {
    let digits = (3.0 - width.log10().floor()).clamp(0.0, 15.0) as usize;
    format!("{t:.digits$}")
}

/// A function of each sample.
fn each(x: &[Vec<f64>], f: impl Fn(f64) -> f64) -> Series {
    x.iter().map(|s| s.iter().map(|v| f(*v)).collect()).collect()
}

/// A function of two series.
pub(super) fn both(a: &[Vec<f64>], b: &[Vec<f64>], f: impl Fn(f64, f64) -> f64) -> Series {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| f(*a, *b)).collect()).collect()
}

/// What follows from each sample and what was before, from the first sample of each stretch on.
pub(super) fn in_turn<S>(x: &[Vec<f64>], start: impl Fn(f64) -> S, next: impl Fn(&mut S, f64) -> f64) -> Series {
    let stretch = |s: &Vec<f64>| {
        let mut state = start(s.first().copied().unwrap_or(0.0));
        s.iter().map(|v| next(&mut state, *v)).collect()
    };
    x.iter().map(stretch).collect()
}

/// A function of all samples, in order of size.
pub(super) fn sorted(x: &[Vec<f64>], f: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut all: Vec<f64> = x.iter().flatten().map(|v| f(*v)).collect();
    all.sort_by(f64::total_cmp);
    all
}

/// Quantiles of a coordinate's size.
fn quantiles<const N: usize>(x: &[Vec<f64>], at: [f64; N]) -> [f64; N] {
    let size = sorted(x, f64::abs);
    at.map(|q| quantile(&size, q).unwrap_or(0.0))
}

/// Curves and knees of one coordinate, and what remembers it at any rate.
pub fn curves(name: &str, x: &[Vec<f64>], velocity: bool) -> Vec<Shape> {
    let mut out = vec![
        Shape::new(format!("{name}^2"), Kind::Even, each(x, |v| v * v)),
        Shape::new(format!("{name}^3"), Kind::Odd, each(x, |v| v * v * v)),
        Shape::new(format!("abs({name})"), Kind::Even, each(x, f64::abs)),
        Shape::new(format!("abs({name})*{name}"), Kind::Odd, each(x, |v| v * v.abs())),
        Shape::new(format!("sign({name})*sqrt(abs({name}))"), Kind::Odd, each(x, |v| v.signum() * v.abs().sqrt())),
    ];
    if velocity {
        let [small] = quantiles(x, [0.8]).map(|q| 0.05 * q);
        if small > 0.0 {
            out.push(Shape::new(format!("tanh({name}/{})", free(small)), Kind::Odd, each(x, |v| (v / small).tanh())));
        }
    }
    for g in quantiles(x, KNEES) {
        let n = free(g);
        out.push(Shape::new(format!("max({name} - {n}, 0)"), Kind::Even, each(x, |v| (v - g).max(0.0))));
        out.push(Shape::new(format!("max(-{n} - {name}, 0)"), Kind::Even, each(x, |v| (-g - v).max(0.0))));
    }
    if !velocity {
        out.extend(widths(x).map(|r| {
            let play = |w: &mut f64, v: f64| {
                *w = w.max(v - r).min(v + r);
                *w
            };
            // Chosen as if each began in the middle of its band: where a recording begins far from zero, plays that all begin at one edge are so many steps at
            // its first samples, and follow whatever happens there. What is written begins as the operator does, and is refitted.
            Shape::new(format!("play({name}, {})", free(r)), Kind::Play, in_turn(x, |first| first, play))
        }));
    }
    out
}

/// Half widths of the plays of a coordinate, and distances at which its relays switch.
pub(super) fn widths(x: &[Vec<f64>]) -> impl Iterator<Item = f64> {
    quantiles(x, WIDTHS).into_iter().map(|q| WIDTH * q).filter(|r| *r > 0.0)
}

/// A coordinate with a coefficient that drifts, and one that changes during a part of the recording.
pub fn changes(name: &str, x: &[Vec<f64>], data: &DataSet) -> Vec<Shape> {
    let over = |f: &dyn Fn(f64) -> f64| -> Series {
        x.iter().zip(&data.stretches).map(|(s, st)| s.iter().zip(st.times()).map(|(v, t)| v * f(t)).collect()).collect()
    };
    let mut out = vec![Shape::new(format!("t*{name}"), Kind::Time, over(&|t| t))];
    let ends = data.stretches.iter().map(|s| (s.start_s, s.start_s + s.len() as f64 * s.drive.period_s()));
    let (first, last) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (c, d)| (a.min(c), b.max(d)));
    let width = (last - first) / (TENTS - 1) as f64;
    if width > 0.0 {
        out.extend((0..TENTS).map(|i| {
            let at = first + i as f64 * width;
            let text = format!("max(1 - abs(t - {})/{}, 0)*{name}", moment(at, width), moment(width, width));
            Shape::new(text, Kind::Time, over(&|t| (1.0 - (t - at).abs() / width).max(0.0)))
        }));
    }
    out
}

/// A coordinate with a coefficient that follows an input, its size or its square, as a brake in series with a motor does; an input with one that follows a
/// coordinate on either side of the middle, as the force of a coil that leaves its magnet.
pub fn driven((u, input): (&str, &[Vec<f64>]), (name, x): (&str, &[Vec<f64>])) -> [Shape; 5] {
    [
        product((u, input), (name, x)),
        Shape::new(format!("{u}^2*{name}"), Kind::Odd, both(input, x, |u, x| u * u * x)),
        Shape::new(format!("abs({u})*{name}"), Kind::Odd, both(input, x, |u, x| u.abs() * x)),
        Shape::new(format!("{u}*{name}^2"), Kind::Odd, both(input, x, |u, x| u * x * x)),
        Shape::new(format!("{u}*abs({name})"), Kind::Odd, both(input, x, |u, x| u * x.abs())),
    ]
}

/// What is beyond limits on either side, at a few places.
pub fn limits((a, x): (&str, &[Vec<f64>])) -> Vec<Shape> {
    let places = quantiles(x, LIMITS).into_iter().filter(|r| *r > 0.0);
    let one = |r: f64| {
        let n = free(r);
        let text = format!("max({a} - {n}, 0) - max(-{n} - {a}, 0)");
        Shape::new(text, Kind::Odd, each(x, |v| (v - r).max(0.0) - (-r - v).max(0.0)))
    };
    places.map(one).collect()
}

/// A rate by its size: what rises faster than it falls, or the other way round, as the needle of a level meter or the charge behind a diode.
pub fn one_way_faster((a, x): (&str, &[Vec<f64>])) -> Shape {
    Shape::new(format!("abs({a})"), Kind::Even, each(x, f64::abs))
}

/// What a term of [`limits`] or [`one_way_faster`] tells of a rate, in words.
pub fn told_rate(term: &str) -> Option<String> {
    if let Some(state) = term.strip_prefix("abs(rate_").and_then(|rest| rest.strip_suffix(')')) {
        return Some(format!("`{state}` rises at another rate than it falls"));
    }
    let (state, rest) = term.strip_prefix("max(rate_")?.split_once(" - ")?;
    let (limit, _) = rest.split_once(',')?;
    Some(format!("the rate of `{state}` is limited, at about {limit} of its unit per second"))
}

/// A signal as it is.
pub fn proportional((a, x): (&str, &[Vec<f64>])) -> Shape {
    Shape::new(a.to_owned(), Kind::Odd, x.to_vec())
}

/// Two signals multiplied, which may be the same.
pub fn product((a, x): (&str, &[Vec<f64>]), (b, y): (&str, &[Vec<f64>])) -> Shape {
    let text = if a == b { format!("{a}^2") } else { format!("{a}*{b}") };
    Shape::new(text, Kind::Even, both(x, y, |x, y| x * y))
}

/// A signal with its name.
type Named<'s> = (&'s str, &'s [Vec<f64>]);

/// What a linkage puts on a part that stands at `x` (where it has a coordinate) and moves with `v`, of another that stands and moves so: centrifugal and
/// Coriolis forces to first order of the coordinates (products of these and two velocities), and inertia and stiffness that grow with how far the other stands
/// out.
pub fn linked(
    (x, v): (Option<Named<'_>>, Named<'_>),
    (place, rate): (Named<'_>, Named<'_>),
    acceleration: Named<'_>,
) -> Vec<Shape> {
    let cubic = |lever: Named<'_>, one: Named<'_>, other: Named<'_>| {
        let Shape { text, series, .. } = product(one, other);
        Shape::new(format!("{}*{text}", lever.0), Kind::Odd, both(lever.1, &series, |a, b| a * b))
    };
    let levers = x.into_iter().chain([place]);
    let mut out: Vec<Shape> = levers.flat_map(|lever| [cubic(lever, v, rate), cubic(lever, rate, rate)]).collect();
    out.push(cubic(place, v, v));
    out.extend(x.map(|x| cubic(x, place, place)));
    let Shape { text, series, .. } = product(place, place);
    out.push(Shape::new(format!("{text}*{}", acceleration.0), Kind::Odd, both(&series, acceleration.1, |a, b| a * b)));
    out
}

/// What comes round with the turns of another part, of this speed and angle in rad: the centrifugal force of its unbalance, and a force that is the same
/// at any speed. Nothing where it does not turn around.
pub fn unbalanced((w, speed): Named<'_>, (a, angle): Named<'_>) -> Vec<Shape> {
    if spread(angle) < TAU {
        return Vec::new();
    }
    let waves = [("sin", f64::sin as fn(f64) -> f64), ("cos", f64::cos)];
    let of_wave = |(wave, f): (&str, fn(f64) -> f64)| {
        [
            Shape::new(format!("{w}^2*{wave}({a})"), Kind::Even, both(speed, angle, |w, a| w * w * f(a))),
            Shape::new(format!("{wave}({a})"), Kind::Even, each(angle, f)),
        ]
    };
    waves.into_iter().flat_map(of_wave).collect()
}

/// A factor of a product: how it is written, whether it is odd, and its values.
type Factor<'f> = (String, bool, Box<dyn Fn(f64) -> f64 + 'f>);

/// Products of a function of the displacement `x` and one of the velocity `v`, and what is periodic in the displacement. A resistance
/// that is proportional to the speed, one that has its sign only and one that has its size only may each depend on the place: in proportion to it or
/// to its size, by the side of the middle, on one side of a knee, or in waves: some over its range, and where it is an angle (`radians` for each of its
/// unit) those that return with every turn and with every half.
pub fn surface((a, x): (&str, &[Vec<f64>]), (b, v): (&str, &[Vec<f64>]), radians: Option<f64>) -> Vec<Shape> {
    let speeds: [Factor<'_>; 3] = [
        (b.to_owned(), true, Box::new(|v| v)),
        (format!("sign({b})"), true, Box::new(f64::signum)),
        (format!("abs({b})"), false, Box::new(f64::abs)),
    ];
    let mut places: Vec<Factor<'_>> = vec![
        (a.to_owned(), true, Box::new(|x| x)),
        (format!("abs({a})"), false, Box::new(f64::abs)),
        (format!("{a}^2"), false, Box::new(|x| x * x)),
        (format!("sign({a})"), true, Box::new(f64::signum)),
    ];
    for g in quantiles(x, KNEES).into_iter().filter(|g| *g > 0.0) {
        let (n, s, width) = (free(g), GATE * g, free(GATE * g));
        places.push((format!("(1 + tanh(({a} - {n})/{width}))"), false, Box::new(move |x| 1.0 + ((x - g) / s).tanh())));
        places.push((format!("(1 - tanh(({a} + {n})/{width}))"), false, Box::new(move |x| 1.0 - ((x + g) / s).tanh())));
    }
    let kind = |odd: bool| if odd { Kind::Odd } else { Kind::Even };
    let mut out = vec![Shape::new(format!("{a}*{b}^2"), Kind::Odd, both(x, v, |x, v| x * v * v))];
    let span = spread(x);
    let turns = radians.into_iter().flat_map(|r| [r, 2.0 * r]).filter(|k| k * span > TAU * CYCLES[0]);
    for k in CYCLES.into_iter().filter(|_| span > 0.0).map(|cycles| TAU * cycles / span).chain(turns) {
        let n = free(k);
        for (text, odd, f) in
            [(format!("sin({n}*{a})"), true, f64::sin as fn(f64) -> f64), (format!("cos({n}*{a})"), false, f64::cos)]
        {
            out.push(Shape::new(text.clone(), kind(odd), each(x, |x| f(k * x))));
            places.push((text, odd, Box::new(move |x| f(k * x))));
        }
    }
    for (place, of_place, p) in &places {
        for (speed, of_speed, s) in &speeds {
            out.push(Shape::new(
                format!("{place}*{speed}"),
                kind(of_place != of_speed),
                both(x, v, |x, v| p(x) * s(v)),
            ));
        }
    }
    out
}

/// Largest less smallest value.
fn spread(x: &[Vec<f64>]) -> f64 {
    let (low, high) = range(x.iter().flatten().copied());
    if high > low { high - low } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_told_as_it_is_written() {
        let rate = vec![(0..100).map(f64::from).collect::<Vec<_>>()];
        let texts: Vec<String> = limits(("rate_fin", &rate)).into_iter().map(|s| s.text).collect();
        assert_eq!(texts[1], "max(rate_fin - 74.2, 0) - max(-74.2 - rate_fin, 0)");
        assert!(told_rate(&texts[1]).unwrap().contains("`fin` is limited, at about 74.2"));
        let faster = told_rate(&one_way_faster(("rate_fin", &rate)).text);
        assert_eq!(faster.as_deref(), Some("`fin` rises at another rate than it falls"));
        assert_eq!(told_rate("fin^2"), None);
    }

    #[test]
    fn a_linkage_pulls_and_stiffens_with_what_stands_and_moves_elsewhere() {
        let [x, v, place, rate, acceleration] = [2.0, 3.0, 5.0, 7.0, 11.0].map(|value| [vec![value]]);
        let of = |x| linked((x, ("v", &v)), (("y", &place), ("w", &rate)), ("acc", &acceleration));
        let told = |s: Shape| (s.text, s.series[0][0]);
        let own: Vec<(String, f64)> = of(Some(("x", &x))).into_iter().map(told).collect();
        let terms = [
            ("x*v*w", 42.0),
            ("x*w^2", 98.0),
            ("y*v*w", 105.0),
            ("y*w^2", 245.0),
            ("y*v^2", 45.0),
            ("x*y^2", 50.0),
            ("y^2*acc", 275.0),
        ];
        assert_eq!(own, terms.map(|(text, value)| (text.to_owned(), value)));
        // Without a coordinate of its own nothing has one for a lever.
        assert!(of(None).into_iter().all(|s| !s.text.contains('x')));
    }

    #[test]
    fn what_depends_on_an_angle_returns_with_every_turn() {
        let of = |reach: f64, radians: Option<f64>| -> Vec<String> {
            let x = [(0..400).map(|n| reach * (0.1 * f64::from(n)).sin()).collect()];
            surface(("q", &x), ("w", &x), radians).into_iter().map(|s| s.text).collect()
        };
        let has = |texts: &[String], text: &str| texts.iter().any(|t| t == text);
        // A resistance that depends on the angle: half a turn is as likely as a whole one.
        let radians = of(10.0, Some(1.0));
        assert!(has(&radians, "sin(1.000100*q)*w") && has(&radians, "cos(2.000200*q)*sign(w)"), "{radians:?}");
        assert!(has(&of(600.0, Some(1f64.to_radians())), "sin(0.0175*q)*w"));
        // No angle, and one that does not go around: nothing is said of a turn.
        assert_eq!(of(10.0, None).len(), of(1.0, Some(1.0)).len());
        assert!(radians.len() > of(10.0, None).len());
    }
}
