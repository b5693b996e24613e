//! Elements: connections whose deflection is a coordinate of the simulation, as the drift of a storey.

use hysid_plant::{BinaryOp, Expr};

use super::algebra::{coefficient, linear_coefficient, only_parameters, quotient, signals_in, unless_one};
use super::connections::{Stretch, forces_of, signed};
use super::find::Finder;
use super::motion::{Motion, force_of};
use super::sensed::{Felt, Sensed};
use super::{Pull, Slot, Target};

/// Whether a sum of products is told with a minus, and its size; `None` where some of them are and others not.
fn one_way(sum: &Expr) -> Option<(bool, Expr)> {
    let sized = |(sign, term): (f64, &Expr)| {
        let (negative, size) = signed(term.clone());
        (negative != (sign < 0.0), size)
    };
    let (negative, sizes): (Vec<bool>, Vec<Expr>) = sum.terms().into_iter().map(sized).unzip();
    let whole = sizes.into_iter().reduce(|a, b| a + b)?;
    negative.iter().all(|n| *n == negative[0]).then_some((negative[0], whole))
}

impl Finder<'_> {
    /// Connections of a simulation in relative coordinates, as the drifts of storeys: what the deflection of an element pulls with stands in the
    /// equations of several coordinates, in a term of that deflection alone.
    pub(super) fn elements(&self) -> Vec<Slot> {
        let element = |one: &Motion<'_>| {
            let x = one.x?;
            // The rate of the deflection may tell the force of its element once for each of the masses at its ends.
            let own = self.springs(one, x)?;
            let mut felt = Vec::new();
            for other in self.motions.iter().filter(|m| m.v != one.v) {
                let mut terms = self.terms_with(other, x).into_iter();
                if terms.any(|(_, t)| t.uses(other.v) || other.x.is_some_and(|x2| t.uses(x2))) {
                    return None;
                }
                let Some(springs) = self.springs(other, x) else { continue };
                if own.len() == 1 && self.lie_apart(one, other) {
                    return None;
                }
                let [there] = <[Expr; 1]>::try_from(springs).ok()?;
                felt.push((other, there));
            }
            let (other, first) = felt.first()?;
            // What cancels is the same force, in another share.
            let of = |unit: &Expr, spring: &Expr| {
                let share = quotient(spring.clone(), unit.clone());
                (!unit.symbols().iter().any(|s| share.uses(s))).then_some(share)
            };
            let told_by = |unit: &&Expr| own.iter().filter(|spring| of(unit, spring).is_some()).count();
            // The force is that of the deflection's own equation, or the one that the first of the others feels where its own holds several shares of it.
            let felt_first = -first.clone();
            let units = if own.len() > 1 { Some(&felt_first) } else { None };
            // Of several that tell as much the first, where `max_by_key` would take the last.
            let unit = units.into_iter().chain(&own).rev().max_by_key(told_by)?.clone();
            let share = |springs: &[Expr]| {
                let shares: Option<Vec<Expr>> = springs.iter().map(|spring| of(&unit, spring)).collect();
                let (negative, whole) = one_way(&shares?.into_iter().reduce(|a, b| a + b)?)?;
                Some((if negative { -1.0 } else { 1.0 }, unless_one(whole)))
            };
            // Another spring may be at the same coordinate: the tyre under a suspension.
            let own: Vec<Expr> = own.iter().filter(|spring| of(&unit, spring).is_some()).cloned().collect();
            let (_, lever) = share(&own).filter(|(sign, _)| *sign > 0.0)?;
            let mut pulls = vec![Pull { lever: lever.clone(), ..Pull::new(one.state, 1.0) }];
            for (other, there) in &felt {
                let (sign, lever) = share(std::slice::from_ref(there))?;
                pulls.push(Pull { lever, ..Pull::new(other.state, sign) });
            }
            let stretch = Stretch {
                x: Expr::symbol(x),
                v: one.rate(),
                symbol: x,
                lever,
                other: Some(other),
                words: format!("in {x}, which pulls at {} coordinates", pulls.len()),
            };
            let mut slot = Slot { target: Target::Derivatives(pulls), ..self.connection(one, stretch) };
            slot.offer(self.simulation, "k", (-unit).simplified());
            Some(slot)
        };
        // What sensors feel of it is told by the stiffness alone.
        let either = |one: &Motion<'_>| match self.element_of_a_parameter(one) {
            Some(slot) if !slot.sensed.is_empty() => Some(slot),
            other => element(one).or(other),
        };
        self.motions.iter().filter_map(either).collect()
    }

    /// An element by its stiffness, a parameter that multiplies nothing but the deflection of a part, wherever it stands: what pulls at the coordinates, and what
    /// sensors feel of it, are its multiples, whatever masses or levers they hold. `None` where one equation tells all of it.
    fn element_of_a_parameter(&self, one: &Motion<'_>) -> Option<Slot> {
        let x = one.x?;
        let stiffness = |name: &str| {
            let (pulled, mass) = force_of(self.simulation, one.derivative);
            let own = self.multiple_of(pulled, name, x)?;
            // Of what is above the line of a quotient by a mass.
            let above = |multiple: Expr, mass: Option<&Expr>| {
                let (negative, size) = one_way(&multiple)?;
                Some((negative, mass.map_or(size.clone(), |mass| (mass.clone() * size).simplified())))
            };
            let (true, lever) = above(own, mass)? else { return None };
            let mut pulls = vec![Pull { lever: unless_one(lever.clone()), ..Pull::new(one.state, 1.0) }];
            let mut felt = Vec::new();
            for other in self.motions.iter().filter(|m| m.v != one.v && m.derivative.uses(name)) {
                let (pulled, mass) = force_of(self.simulation, other.derivative);
                let (negative, lever) = above(self.multiple_of(pulled, name, x)?, mass)?;
                let sign = if negative { 1.0 } else { -1.0 };
                pulls.push(Pull { lever: unless_one(lever), ..Pull::new(other.state, sign) });
                felt.push(other);
            }
            let mut sensed = Vec::new();
            for output in self.simulation.outputs.iter().filter(|o| o.expression.uses(name)) {
                let (negative, share) = one_way(&self.multiple_of(&output.expression, name, x)?)?;
                let (state, column) = (one.state.to_owned(), output.column.clone());
                let times = if negative { 1.0 } else { -1.0 };
                sensed.push(Sensed { felt: Felt::Share(share), state, column, times });
            }
            let stretch = Stretch {
                x: Expr::symbol(x),
                v: one.rate(),
                symbol: x,
                lever: unless_one(lever),
                other: Some(*felt.first()?),
                words: format!("in {x}, which pulls at {} coordinates", pulls.len()),
            };
            let mut slot = Slot { target: Target::Derivatives(pulls), sensed, ..self.connection(one, stretch) };
            slot.offer(self.simulation, "k", Expr::symbol(name));
            Some(slot)
        };
        self.simulation.parameters.iter().find_map(|p| stiffness(&p.name))
    }

    /// What an expression has of the product of a parameter and a displacement, where the parameter multiplies nothing else in it.
    fn multiple_of(&self, e: &Expr, parameter: &str, x: &str) -> Option<Expr> {
        let multiplied = coefficient(e, parameter)?;
        let multiple = coefficient(&multiplied, x)?.simplified();
        let alone = signals_in(self.simulation, &multiplied).all(|s| s == x);
        (alone && only_parameters(self.simulation, &multiple)).then_some(multiple)
    }

    /// Whether two displacements are places, and what is between them pulls at both with one stiffness: neither is a deflection, also where the terms of their
    /// difference stand apart, as in `(-(k_1 + k_2)*x_1 + k_2*x_2)/m_1` and `(k_2*x_1 - k_2*x_2)/m_2`.
    fn lie_apart(&self, one: &Motion<'_>, other: &Motion<'_>) -> bool {
        let (Some(x1), Some(x2)) = (one.x, other.x) else { return false };
        let pull = |part: &Motion<'_>, x: &str| {
            linear_coefficient(self.simulation, force_of(self.simulation, part.derivative).0, x)
        };
        let Some(stiffness) = pull(one, x2).filter(|k| pull(other, x1).as_ref() == Some(k)) else { return false };
        let holds = |part: &Motion<'_>, x: &str| {
            let own = pull(part, x).map(|k| -k);
            own.is_some_and(|own| stiffness.terms().iter().all(|term| own.terms().contains(term)))
        };
        // The rate of a deflection tells its force once for each of the masses at its ends.
        let told_once = self.springs(other, x2).is_some_and(|own| own.len() == 1);
        told_once && holds(one, x1) && holds(other, x2)
    }

    /// The terms of the force on a part that hold a displacement, each with its sign, also those of a sum that is divided or multiplied as a whole, which may
    /// hold several springs.
    fn terms_with(&self, part: &Motion<'_>, x: &str) -> Vec<(f64, Expr)> {
        let each = forces_of(self.simulation, part).flat_map(|(sign, term)| self.spread(sign, term));
        each.filter(|(_, term)| term.uses(x)).collect()
    }

    /// A term as those of the sum that it is a multiple of: a sum of forces, each with its own stiffness. What a stiffness multiplies, as in `k*(x_1 - x_2)`, is one force.
    fn spread(&self, sign: f64, term: &Expr) -> Vec<(f64, Expr)> {
        let constant = |e: &Expr| only_parameters(self.simulation, e);
        let stiff = |(_, t): (f64, &Expr)| t.symbols().iter().any(|s| self.simulation.parameter(s).is_some());
        let forces = |sum: &Expr| sum.terms().into_iter().all(stiff);
        let each = |sum: &Expr, scaled: &dyn Fn(Expr) -> Expr| -> Vec<(f64, Expr)> {
            let within = sum
                .terms()
                .into_iter()
                .flat_map(|(own, t)| if t == sum { vec![(sign * own, t.clone())] } else { self.spread(sign * own, t) });
            within.map(|(sign, t)| (sign, scaled(t))).collect()
        };
        match term {
            Expr::Binary(BinaryOp::Div, sum, by) => each(sum, &|t| t / (**by).clone()),
            Expr::Binary(BinaryOp::Mul, by, sum) if constant(by) && forces(sum) => each(sum, &|t| (**by).clone() * t),
            Expr::Binary(BinaryOp::Mul, sum, by) if constant(by) && forces(sum) => each(sum, &|t| t * (**by).clone()),
            _ => vec![(sign, term.clone())],
        }
    }

    /// What a deflection pulls with for each unit of it, in each term of the force on a part that is linear in it; `None` where there is none. Another
    /// term may be what a first effect has put there.
    pub(super) fn springs(&self, part: &Motion<'_>, x: &str) -> Option<Vec<Expr>> {
        let (_, mass) = force_of(self.simulation, part.derivative);
        let all: Vec<Expr> = self
            .terms_with(part, x)
            .into_iter()
            .filter_map(|(sign, term)| {
                let rate = linear_coefficient(self.simulation, &term, x)?;
                // A force, also where each term is divided by the mass.
                let rate = mass.map_or(rate.clone(), |mass| quotient(mass.clone() * rate, Expr::Number(1.0)));
                Some(if sign < 0.0 { -rate } else { rate })
            })
            .collect();
        (!all.is_empty()).then_some(all)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use hysid_plant::{Compiled, Drive, Expr, Run, Simulation};

    use crate::mechanism::conformance::example_signals;
    use crate::mechanism::{Purpose, Signals, mechanism};
    use crate::slot::{Place, Slot, Structure};

    /// A frame of two storeys on a table, in their drifts, with these rates of them and this accelerometer on its roof.
    fn frame([first, second, roof]: [&str; 3], parameters: &[&str]) -> Simulation {
        let parameter = |name: &&str| format!("{name} = {{ value = 2.0, min = 0.1 }}\n");
        let parameters: String = ["m1", "m2", "k1", "k2", "c1", "c2"].iter().chain(parameters).map(parameter).collect();
        let text = format!(
            "[time]\nperiod_s = 0.01\n[inputs]\nag = \"table_m_s2\"\n[parameters]\n{parameters}[states]\nd1 = {{ derivative = \"v1\", initial = 0.0, unit = \"m\" }}\n\
             v1 = {{ derivative = \"{first}\", initial = 0.0, unit = \"m/s\" }}\nd2 = {{ derivative = \"v2\", initial = 0.0, unit = \"m\" }}\n\
             v2 = {{ derivative = \"{second}\", initial = 0.0, unit = \"m/s\" }}\n[outputs]\ndrift_mm = \"1000*d1\"\nroof_m_s2 = \"{roof}\"\n"
        );
        Simulation::parse(&text, "frame.sim.toml").unwrap()
    }

    /// What both outputs show where each parameter has a value of its own.
    fn shown(simulation: &Simulation) -> Vec<Vec<f64>> {
        let ag: Vec<f64> = (0..300).map(|i| 4.0 * (0.05 * f64::from(i)).sin()).collect();
        let drive = Drive::new(0.0, 0.01, ag.len(), vec![ag]).unwrap();
        let value = |name: &str| match name {
            "x_0" => 0.02,
            "m1" | "c1" => 1.5,
            "k1" | "k2" => 40.0,
            "k_b" => 30.0,
            _ => 0.7,
        };
        let parameters: Vec<f64> = simulation.parameters.iter().map(|p| value(&p.name)).collect();
        Compiled::new(simulation).unwrap().simulate(&Run::new(&drive, &parameters)).outputs
    }

    /// A mass on isolators under another one, in frequencies: what the isolators put on the ground acts back on both by the masses' shares.
    #[test]
    fn a_spring_that_is_told_by_a_frequency_pulls_at_both_masses() {
        let (isolators, storey) = ("((2*pi*k1)^2*d1 + 4*pi*k1*c1*v1)", "(2*pi*k2)^2*d2 + 4*pi*k2*c2*v2");
        let first = format!("-ag - {isolators} + m1/(1 - m1)*({storey}) - m1/(1 - m1)*{isolators}");
        for second in [
            format!("(1/(1 - m1))*({isolators} - ({storey}))"),
            "(1/(1 - m1))*((2*pi*k1)^2*d1 + 4*pi*k1*c1*v1 - (2*pi*k2)^2*d2 - 4*pi*k2*c2*v2)".to_owned(),
            format!("({isolators} - ({storey}))/(1 - m1)"),
        ] {
            let slots = Structure::of(&frame([&first, &second, "d2"], &[])).slots;
            let slot = slots.into_iter().find(|s| s.place == Place::Connection && s.label == "state:v1").unwrap();
            let plain = frame([&first, &second, "d2"], &[]);
            let law = mechanism("cubic_stiffness").unwrap();
            let written =
                law.rewrite(&plain, &slot, &example_signals(&plain, &slot), Purpose::Refit).unwrap().simulation;
            let cubic = |by: f64, of: &str| {
                let e = &written.state(of).unwrap().derivative;
                let values = [("m1", 0.5), ("d1", 0.1), ("k1", 1.0), ("k_3", by), ("pi", 1.0)];
                let rest = ["ag", "c1", "v1", "k2", "d2", "c2", "v2"].map(|s| (s, 0.0));
                let at = values.iter().chain(&rest).fold(e.clone(), |e, (s, v)| e.substitute(s, &Expr::Number(*v)));
                Signals::new(0.01, 0.0, BTreeMap::new()).size_of(&at).unwrap()
            };
            let pull = |of: &str| cubic(1.0, of) - cubic(0.0, of);
            let (one, two) = (pull("v1"), pull("v2"));
            assert!(one < 0.0 && (one + two).abs() < 1e-9 * two, "{second}: {one} {two}");
        }
    }

    #[test]
    fn a_spring_pulls_and_is_felt_wherever_its_stiffness_stands() {
        for second in [
            "(k1*d1 + c1*v1)/m1 - (k2*d2 + c2*v2)*(1/m1 + 1/m2)",
            "(k1*d1 + c1*v1)/m1 - (k2*d2 + c2*v2)/m1 - (k2*d2 + c2*v2)/m2",
        ] {
            is_felt(["-ag - (k1*d1 + c1*v1 - k2*d2 - c2*v2)/m1", second, "-(k2*d2 + c2*v2)/m2"]);
        }
    }

    /// Holds what is written at each spring against what would have stood there.
    fn is_felt(equations: [&str; 3]) {
        let plain = frame(equations, &[]);
        let slots: Vec<Slot> =
            Structure::of(&plain).slots.into_iter().filter(|s| s.place == Place::Connection).collect();
        let stiffness = |slot: &Slot| slot.quantity("k").map(|q| q.expression.to_string());
        let found: Vec<_> = slots.iter().map(|s| (s.label.as_str(), stiffness(s).unwrap())).collect();
        assert_eq!(found, [("state:v1", "k1/m1".to_owned()), ("state:v2", "k2".to_owned())]);
        let law = mechanism("bilinear_stiffness").unwrap();
        // Where the equation divides it by the mass, the new one is, too.
        for (slot, (x, unit)) in slots.iter().zip([("d1", "m1*"), ("d2", "")]) {
            let written = law.rewrite(&plain, slot, &example_signals(&plain, slot), Purpose::Refit).unwrap().simulation;
            // As if another spring had stood there from the first.
            let spring = format!("k{}*{x}", &x[1..]);
            let bent = format!("({spring} + {unit}k_b*max({x} - x_0, 0))");
            let wanted = equations.map(|e| e.replace(&spring, &bent));
            let wanted = shown(&frame([&wanted[0], &wanted[1], &wanted[2]], &["k_b", "x_0"]));
            assert!(wanted != shown(&plain), "it is never reached");
            for (a, b) in shown(&written).iter().zip(&wanted) {
                assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9 * (1.0 + b.abs())), "{written:?}");
            }
        }
    }
}
