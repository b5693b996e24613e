//! Outputs that measure what a force changes at once: an accelerometer's expression holds the forces of the equation of motion, and what is missing
//! there is missing in the output too.

use hysid_plant::{BinaryOp, ClockSource, Compiled, Drive, Expr, Output, Parameter, Run, Simulation, Unit};
use rand_pcg::rand_core::Rng;

use super::algebra::{Factors, product};
use super::balance::is_power_of_ten;
use super::find::is_one_of;
use crate::random::generator;

/// What a sensor feels of a force.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Felt {
    /// The acceleration that comes of it.
    Rate,
    /// The force itself.
    Force,
    /// This share of the force of an element, before any lever by which a state feels it.
    Share(Expr),
}

/// An output that is a multiple of the derivative of a state, or of the forces that hold it, but for what no state moves.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sensed {
    /// Which of these it is.
    pub felt: Felt,
    /// The state.
    pub state: String,
    /// The output's column.
    pub column: String,
    /// The multiple; the sign of a share.
    pub times: f64,
}

/// Points at which expressions are compared.
const POINTS: usize = 6;
/// Difference of two expressions, over their size, that is rounding.
const ROUNDING: f64 = 1e-9;

/// The outputs of a simulation that measure derivatives of its states.
pub(crate) fn sensed(simulation: &Simulation) -> Vec<Sensed> {
    let rates: Vec<_> = simulation.states.iter().map(|s| (&s.name, peeled(&s.derivative))).collect();
    let mut found = Vec::new();
    for output in &simulation.outputs {
        let (factor, inner) = peeled(&output.expression);
        for (state, (scale, rate)) in &rates {
            if !shares(simulation, &inner, rate) {
                continue;
            }
            let alike = |shaking| multiple(simulation, &inner, rate, shaking).map(|times| factor / scale * times);
            let with_any_numbers = alike(true);
            let times = if with_any_numbers.is_some() && *scale == 1.0 {
                with_any_numbers
            } else {
                // Numbers among the factors or the terms of the rate may turn one unit into the other.
                let units = measures_a_rate(simulation, output, state);
                let of_terms = || if states_in(simulation, &inner, rate) > 1 { alike(false) } else { None };
                let converted = || with_any_numbers.or_else(of_terms);
                (units != Some(false)).then(converted).flatten().filter(|t| units.is_some() || is_power_of_ten(*t, 1.0))
            };
            if let Some(times) = times {
                found.push(Sensed { felt: Felt::Rate, state: (*state).clone(), column: output.column.clone(), times });
            }
        }
    }
    found
}

/// The numbers that a product or quotient has among its factors, and what they multiply: an acceleration in m/s^2 where the state is in mm.
pub(super) fn peeled(e: &Expr) -> (f64, Expr) {
    let mut factors = Factors::of(e.clone());
    let number = factors.take_number();
    (number, product(factors.above) / product(factors.below))
}

/// Whether an output measures what the rate of a state is, by their units; `None` where these are not told. What a controller puts out is a multiple of an
/// acceleration where the mass is a number, and no accelerometer.
fn measures_a_rate(simulation: &Simulation, output: &Output, state: &str) -> Option<bool> {
    let rate = simulation.unit_of(state)?.per(&Unit::parse("s").ok()?);
    let measured = Unit::of_column(&output.column)?;
    // Of an accelerometer `g` is no gram.
    Some(measured.same_dimension(&rate) || (is_one_of(&measured, &["g"]) && is_one_of(&rate, &["m/s^2"])))
}

/// How many states two expressions have in common.
fn states_in(simulation: &Simulation, a: &Expr, b: &Expr) -> usize {
    simulation.states.iter().filter(|s| a.uses(&s.name) && b.uses(&s.name)).count()
}

/// Whether two expressions have a state and a parameter in common: forces in both.
pub(super) fn shares(simulation: &Simulation, a: &Expr, b: &Expr) -> bool {
    let both = |name: &str| a.uses(name) && b.uses(name);
    states_in(simulation, a, b) > 0 && simulation.parameters.iter().any(|p| both(&p.name))
}

/// The number by which `b` must be multiplied to move with the states as `a` does; `None` where there is none. It must be the same for other
/// parameters, and where numbers are `shaking` for other numbers in the equations: `v` is a multiple of `(u - 2*v)/3` in one simulation only.
pub(super) fn multiple(simulation: &Simulation, a: &Expr, b: &Expr, shaking: bool) -> Option<f64> {
    let mut known: Option<f64> = None;
    for round in 0..3 {
        let values = values(simulation, [a, b].map(|e| if shaking { shaken(e, round) } else { e.clone() }), round)?;
        let (first, others) = values.split_first()?;
        let moved: Vec<[f64; 2]> = others.iter().map(|v| [v[0] - first[0], v[1] - first[1]]).collect();
        let most = |i: usize| moved.iter().map(|m| m[i].abs()).fold(0.0, f64::max);
        let furthest = moved.iter().max_by(|x, y| x[1].abs().total_cmp(&y[1].abs()))?;
        let times = furthest[0] / furthest[1];
        let sizes = values.iter().flatten().map(|v| v.abs()).fold(0.0, f64::max);
        let same = moved.iter().all(|m| (m[0] - times * m[1]).abs() <= ROUNDING * (most(0) + sizes));
        let agrees = known.is_none_or(|k| (times - k).abs() <= 1e3 * ROUNDING * k.abs());
        if !(times.is_finite() && times != 0.0 && same && agrees) {
            return None;
        }
        known = Some(times);
    }
    // What is the same for all numbers is a count of equal terms: whole, but for rounding.
    known.map(|k| if (k - k.round()).abs() <= 1e3 * ROUNDING { k.round() } else { k })
}

/// An expression with other numbers in it, the same ones for the same; exponents stay, since a negative number has no other powers.
fn shaken(e: &Expr, round: u64) -> Expr {
    let mut exponents = Vec::new();
    let held = e.clone().map(&mut |e| match e {
        Expr::Binary(BinaryOp::Pow, a, b) if matches!(*b, Expr::Number(_)) => {
            exponents.push(*b);
            Expr::Binary(BinaryOp::Pow, a, Box::new(Expr::symbol(format!("?{}", exponents.len() - 1))))
        }
        other => other,
    });
    let moved = held.map(&mut |e| match e {
        Expr::Number(n) if n != 0.0 && n != 1.0 => Expr::Number(n * (1.0 + 0.2 * scatter(round, n.to_bits()))),
        other => other,
    });
    exponents.iter().enumerate().fold(moved, |e, (i, n)| e.substitute(&format!("?{i}"), n))
}

/// Values of two expressions at points that differ in the states only.
fn values(simulation: &Simulation, expressions: [Expr; 2], round: u64) -> Option<Vec<[f64; 2]>> {
    let mut probe = simulation.clone();
    probe.time.clock = ClockSource::Period(1.0);
    let own = probe.parameters.len();
    let still = |name: &String| Parameter { fixed: true, ..Parameter::new(name, 0.0) };
    probe.parameters.extend(simulation.states.iter().map(|s| still(&s.name)));
    probe.states.clear();
    // A document refuses outputs that nothing moves.
    let idle = Expr::Number(0.0) * Expr::symbol(&probe.inputs.first()?.symbol);
    let output = |(i, e): (usize, Expr)| Output { column: format!("probe_{i}"), expression: e + idle.clone() };
    probe.outputs = expressions.into_iter().enumerate().map(output).collect();
    let compiled = Compiled::new(&probe).ok()?;
    let samples = |i: usize| (0..3).map(|n| scatter(round, 1000 + (10 * i + n) as u64)).collect();
    let drive = Drive::new(0.0, 1.0, 3, (0..probe.inputs.len()).map(samples).collect()).ok()?;
    let shaken = |(i, p): (usize, &Parameter)| p.value * (1.0 + 0.3 * scatter(round, 2000 + i as u64));
    let mut theta: Vec<f64> = probe.parameters.iter().enumerate().map(shaken).collect();
    let mut out = Vec::new();
    for point in 0..POINTS {
        for (place, state) in theta[own..].iter_mut().enumerate() {
            *state = scatter(round, (100 * point + place) as u64);
        }
        let response = compiled.simulate(&Run::new(&drive, &theta));
        let at = |o: usize| response.outputs.get(o).and_then(|y| y.get(1)).copied().filter(|y| y.is_finite());
        out.push([at(0)?, at(1)?]);
    }
    Some(out)
}

/// A number between -1 and 1 that looks random.
fn scatter(round: u64, of: u64) -> f64 {
    2.0 * (generator(round, of).next_u64() >> 11) as f64 / (1u64 << 53) as f64 - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(outputs: &str) -> Vec<(String, String, f64)> {
        let text = format!(
            "[time]\nperiod_s = 0.01\n[inputs]\na = \"ground_mps2\"\n[parameters]\nm = {{ value = 2.0, min = 0.1 }}\nk = {{ value = 50.0, min = 1.0 }}\n\
             c = {{ value = 0.3, min = 0.0 }}\n[states]\nx = {{ derivative = \"v\", initial = 0.0 }}\n\
             v = {{ derivative = \"-(1000*k*x + c*v + 3*x^3)/m - a\", initial = 0.0 }}\nw = {{ derivative = \"(a - 2*w)/3\", initial = 0.0 }}\n[outputs]\n{outputs}\n"
        );
        let simulation = Simulation::parse(&text, "test.sim.toml").unwrap();
        sensed(&simulation).into_iter().map(|s| (s.state, s.column, s.times)).collect()
    }

    #[test]
    fn accelerations_are_multiples_of_a_derivative_but_for_the_inputs() {
        let one = |state: &str, column: &str, times: f64| vec![(state.to_owned(), column.to_owned(), times)];
        assert_eq!(of("acc = \"-(1000*k*x + c*v + 3*x^3)/m\""), one("v", "acc", 1.0));
        assert_eq!(of("acc = \"-(1000*k*x + c*v + 3*x^3)/m - a + 0*x\""), one("v", "acc", 1.0));
        let in_g = of("acc_g = \"(-(3*x^3 + c*v + 1000*k*x)/m + 0.5*a)/9.81\"");
        assert!(in_g.len() == 1 && (in_g[0].2 - 1.0 / 9.81).abs() < 1e-12, "{in_g:?}");
        // The numbers that turn one unit into the other may stand on either side.
        let times = |rate: &str, output: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nf = \"force_kN\"\n[parameters]\nm = {{ value = 2.0, min = 0.1 }}\nk = {{ value = 50.0, min = 1.0 }}\n\
                 [states]\ns = {{ derivative = \"v\", initial = 0.0, unit = \"mm\" }}\nv = {{ derivative = \"{rate}\", initial = 0.0, unit = \"mm/s\" }}\n\
                 [outputs]\n{output} = \"(f - 0.001*v - k*s)/m\"\n"
            );
            let found = sensed(&Simulation::parse(&text, "test.sim.toml").unwrap());
            found.first().map(|s| s.times)
        };
        let thousandth = [
            "(f - 0.001*v - k*s)/m*1000",
            "1000*(f - 0.001*v - k*s)/m",
            "1e6/(m*1000)*(f - 0.001*v - k*s)",
            "(1000*f - v - 1000*k*s)/m",
        ];
        for rate in thousandth {
            for column in ["acc_m_s2", "acc_g"] {
                assert!(times(rate, column).is_some_and(|t| (t - 1e-3).abs() < 1e-12), "{rate}");
            }
            // What a controller puts out is none, though it is a multiple as well.
            assert_eq!(times(rate, "command_N"), None, "{rate}");
        }
        assert_eq!(times("(f - 0.001*v - k*s)/m/0.7", "out"), None);
    }

    #[test]
    fn positions_velocities_and_parts_of_the_force_are_none() {
        for other in
            ["y = \"x\"", "y = \"1000*v\"", "y = \"1000*k*x + c*v\"", "y = \"w\"", "y = \"k*x/m\"", "y = \"2*w + a\""]
        {
            assert!(of(other).is_empty(), "{other}");
        }
    }
}
