//! Glitches: single samples of an output that stand out of their neighbours, as a lost bit or a spark leaves them.
//!
//! A few samples that are wrong by a hundred times the noise bend a least-squares calibration and hide everything that is below them. What moves by its
//! inertia never leaves its course for one sample: beside the simulation such a sample is no physics, whatever the simulation leaves out. An output that holds
//! anything that may jump (an input, the sign of a velocity) is left as it is.

use hysid_plant::{Expr, Simulation};
use hysid_signal::{median, range};

use super::DataSet;
use crate::evidence::Series;
use crate::text::number;

/// Deviations from the mean of its neighbours, in standard deviations of what all samples have, beyond which a sample is none of them: less than
/// once in a million samples of white noise.
const BEYOND: f64 = 5.0;
/// Steps of a converter that a deviation must have besides.
const LEVELS: f64 = 3.0;
/// Share of it by which a glitch stands off the straight course of the two samples before it, and of those behind it.
const OFF_COURSE: f64 = 0.5;
/// Largest share of samples that are wrong; more of them are a property of the noise.
const MOST: f64 = 0.02;
/// Standard deviation of a normal variable over its median size.
const NORMAL: f64 = 1.4826;

/// The data (each row a sample) with glitches replaced by what their neighbours say of the error, with a note for each output; `None` where there are none.
pub fn mended(simulation: &Simulation, data: &DataSet, residual: &[f64]) -> Option<DataSet> {
    let found = found(simulation, data, residual);
    if found.is_empty() {
        return None;
    }
    let mut out = data.clone();
    for glitch in found.iter().flat_map(|(_, all)| all) {
        out.move_sample(glitch.series, glitch.row, -glitch.deviation);
    }
    out.notes.extend(
        words(simulation, data, &found).map(|w| format!("{w}: taken for glitches of the sensor, and replaced")),
    );
    Some(out)
}

/// Sentences about glitches in data that only score, where they stay.
pub fn told(simulation: &Simulation, data: &DataSet, residual: &[f64]) -> Vec<String> {
    let found = found(simulation, data, residual);
    words(simulation, data, &found)
        .map(|w| format!("hold-out: {w}: glitches of the sensor, which stand in the errors"))
        .collect()
}

/// A sample that stands out of its neighbours.
struct Glitch<'d> {
    series: &'d Series,
    /// Its place in the series.
    row: usize,
    /// What it is off from what the neighbours say of the error.
    deviation: f64,
}

/// The glitches of each output that has some.
fn found<'d>(simulation: &Simulation, data: &'d DataSet, residual: &[f64]) -> Vec<(usize, Vec<Glitch<'d>>)> {
    let smooth = simulation.outputs.iter().enumerate().filter(|(_, o)| is_smooth(simulation, &o.expression));
    let of = |output: usize| {
        let series = data.layout.series.iter().filter(move |s| s.output == output);
        let all = series.flat_map(|s| {
            let places = glitches(&residual[s.rows.clone()], &data.y[s.rows.clone()]);
            places.into_iter().map(move |(row, deviation)| Glitch { series: s, row, deviation })
        });
        (output, all.collect::<Vec<_>>())
    };
    smooth.map(|(output, _)| of(output)).filter(|(_, all)| !all.is_empty()).collect()
}

/// What was found, in words for each output.
fn words<'a>(
    simulation: &'a Simulation,
    data: &'a DataSet,
    found: &'a [(usize, Vec<Glitch<'_>>)],
) -> impl Iterator<Item = String> + 'a {
    found.iter().filter_map(|(output, all)| {
        let first = all.first()?;
        let at_s = data.time_of_rows(first.series).nth(first.row)?;
        let many = if all.len() == 1 { "1 sample stands" } else { &format!("{} samples stand", all.len()) };
        let column = &simulation.outputs[*output].column;
        Some(format!("{many} out of the neighbours in `{column}` (the first at {} s), as no motion does", number(at_s)))
    })
}

/// Whether an output moves as smoothly as the states do.
fn is_smooth(simulation: &Simulation, e: &Expr) -> bool {
    let of = |e: &Expr| is_smooth(simulation, e);
    match e {
        Expr::Number(_) => true,
        Expr::Symbol(name) => simulation.input(name).is_none() && name != "t",
        Expr::Neg(a) => of(a),
        Expr::Binary(_, a, b) => of(a) && of(b),
        Expr::Call(..) | Expr::Memory(..) => false,
    }
}

/// Places in a series of errors `e` of the measured `y` that are glitches, each with its deviation from what the neighbours say.
fn glitches(e: &[f64], y: &[f64]) -> Vec<(usize, f64)> {
    let deviation = |n: usize| e[n] - 0.5 * (e[n - 1] + e[n + 1]);
    let inner = 1..e.len().saturating_sub(1);
    let sizes: Vec<f64> = inner.clone().map(|n| deviation(n).abs()).collect();
    let scale = NORMAL * median(sizes.clone());
    let level = y.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min);
    let least = (BEYOND * scale).max(if level.is_finite() { LEVELS * level } else { 0.0 });
    // A sensor at its limit holds back the outermost readings, and the course may be out there for one sample only.
    let (lowest, highest) = range(y.iter().copied());
    let held_back = |n: usize| {
        let off = deviation(n);
        (off < 0.0 && y[n] > highest - least) || (off > 0.0 && y[n] < lowest + least)
    };
    let stands_out = |n: &usize| {
        let size = sizes[n - 1];
        let beside = [n.wrapping_sub(2), *n].map(|i| sizes.get(i).copied().unwrap_or(0.0));
        // What bends sharply goes on along its course on one side: a sensor that is blind to the sign turns at zero.
        let before = n.checked_sub(2).map(|m| 2.0 * e[n - 1] - e[m]);
        let after = e.get(n + 2).map(|further| 2.0 * e[n + 1] - further);
        let off_course = |course: f64| (e[*n] - course) * deviation(*n).signum() > OFF_COURSE * size;
        // A step shows at both of its sides, and its neighbours differ.
        size > least
            && !held_back(*n)
            && beside.iter().all(|b| *b < size)
            && (e[n + 1] - e[n - 1]).abs() < size
            && [before, after].into_iter().flatten().all(off_course)
    };
    let found: Vec<(usize, f64)> = inner.filter(stands_out).map(|n| (n, deviation(n))).collect();
    if scale > 0.0 && found.len() as f64 <= MOST * e.len() as f64 { found } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::random::generator;

    fn normal(seed: u64) -> impl FnMut() -> f64 {
        let mut rng = generator(seed, 0);
        move || StandardNormal.sample(&mut rng)
    }

    fn places(e: &[f64]) -> Vec<usize> {
        glitches(e, e).into_iter().map(|(n, _)| n).collect()
    }

    #[test]
    fn single_samples_that_stand_out_are_found_and_their_neighbours_are_not() {
        let mut random = normal(1);
        let clean: Vec<f64> = (0..3000).map(|n| (0.01 * n as f64).sin() * 20.0 + random()).collect();
        assert_eq!(places(&clean), [0; 0]);
        let mut bad = clean.clone();
        for n in [20, 700, 2000] {
            bad[n] += 90.0;
        }
        assert_eq!(places(&bad), [20, 700, 2000]);
        let (_, size) = glitches(&bad, &bad)[0];
        assert!((size - 90.0).abs() < 5.0, "{size}");
    }

    #[test]
    fn steps_ramps_and_levels_of_a_converter_are_no_glitches() {
        let mut random = normal(2);
        let step: Vec<f64> = (0..2000).map(|n| if n > 900 { 300.0 } else { 0.0 } + random()).collect();
        assert_eq!(places(&step), [0; 0]);
        // A slow course behind a coarse converter: between its levels the last bit flickers now and then.
        let slow: Vec<f64> = (0..2000).map(|n| 0.004 * n as f64 + 0.02 * random()).collect();
        let levels: Vec<f64> = slow.iter().map(|x| x.round()).collect();
        let error: Vec<f64> = levels.iter().zip(0..).map(|(y, n)| y - 0.004 * f64::from(n)).collect();
        assert_eq!(glitches(&error, &levels).len(), 0);
    }

    /// Where a sensor is blind to the sign its output turns sharply at zero; a sample at the turn goes on along one of its sides.
    #[test]
    fn sharp_turns_are_no_glitches() {
        let mut random = normal(4);
        let mut swings: Vec<f64> = (0..3000)
            .map(|n| (50.0 * (0.037 * f64::from(n)).sin() * (0.011 * f64::from(n)).cos()).abs() + 0.1 * random())
            .collect();
        assert_eq!(places(&swings), [0; 0]);
        swings[1234] += 40.0;
        assert_eq!(places(&swings), [1234]);
    }

    /// The one sample that goes beyond a sensor's limit is read at the limit, which no other reading reaches.
    #[test]
    fn the_outermost_reading_that_is_held_back_is_no_glitch() {
        let mut random = normal(5);
        let course = |n: u32| 50.0 * (0.9 * f64::from(n)).sin() + if n == 700 { 60.0 } else { 0.0 };
        let noise: Vec<f64> = (0..2000).map(|_| 0.5 * random()).collect();
        let limit = 70.0;
        let read = |n: u32| course(n).min(limit) + noise[n as usize];
        let y: Vec<f64> = (0..2000).map(read).collect();
        let e: Vec<f64> = y.iter().zip(0..).map(|(y, n)| y - course(n)).collect();
        assert!(course(700) > limit + 20.0, "{}", course(700));
        assert_eq!(glitches(&e, &y).len(), 0);
        // The same error on a reading within the range is a glitch.
        let mut inside = noise.clone();
        inside[800] -= course(700) - limit;
        let y: Vec<f64> = inside.iter().zip(0..).map(|(e, n)| e + course(n)).collect();
        assert_eq!(glitches(&inside, &y).len(), 1);
    }

    #[test]
    fn noise_with_heavy_tails_throughout_is_left_alone() {
        let mut random = normal(3);
        let heavy: Vec<f64> = (0..2000).map(|_| random().powi(5)).collect();
        assert_eq!(places(&heavy), [0; 0]);
    }

    #[test]
    fn only_what_the_states_move_smoothly_is_mended() {
        let text = "[time]\nperiod_s = 0.1\n[inputs]\nu = \"u_N\"\n[parameters]\nk = { value = 1.0, min = 0.0 }\n[states]\nx = { derivative = \"u - k*x\", initial = 0.0 }\n[outputs]\ny_m = \"k*x\"\n";
        let simulation = Simulation::parse(text, "test.sim.toml").unwrap();
        let smooth = |e: &str| is_smooth(&simulation, &Expr::parse(e).unwrap());
        assert!(smooth("2*k*x - x^2"));
        assert!(!smooth("u - k*x") && !smooth("k*sign(x)") && !smooth("relay(x, 0.1, 0.2)") && !smooth("x + t"));
    }
}
