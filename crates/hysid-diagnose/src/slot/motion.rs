//! What moves in a simulation: velocities with their displacements, told by the equations, by units, by names; how a force enters.

use hysid_plant::{BinaryOp, Expr, Simulation, State, Unit};

use super::algebra::{constant_coefficient, only_parameters, signals_in};
use super::find::{has_unit, is_one_of};
use super::pattern::factors;
use super::turn::{is_rate_of_turn, is_turn};

/// How forces enter the derivative of a velocity.
pub(crate) enum ForcePath<'a> {
    /// `(force)/mass`.
    Quotient(&'a Expr, &'a Expr),
    /// A sum of terms that are all divided by the same mass.
    Divided(&'a Expr),
    /// No mass in sight: a force has the unit of the derivative.
    Bare,
}

impl<'a> ForcePath<'a> {
    /// What divides the forces.
    pub fn mass(self) -> Option<&'a Expr> {
        match self {
            Self::Quotient(_, mass) | Self::Divided(mass) => Some(mass),
            Self::Bare => None,
        }
    }
}

/// The force path of a derivative.
pub(crate) fn force_path<'a>(simulation: &Simulation, derivative: &'a Expr) -> ForcePath<'a> {
    fn divisor(term: &Expr) -> Option<&Expr> {
        match term {
            Expr::Binary(BinaryOp::Div, _, below) => Some(below),
            Expr::Binary(BinaryOp::Mul, a, b) => divisor(a).or_else(|| divisor(b)),
            Expr::Neg(a) => divisor(a),
            _ => None,
        }
    }
    if let Expr::Binary(BinaryOp::Div, above, below) = derivative {
        return ForcePath::Quotient(above, below);
    }
    let mut divisors = derivative.terms().into_iter().map(|(_, term)| divisor(term));
    match divisors.next().flatten() {
        Some(mass) if only_parameters(simulation, mass) && divisors.all(|d| d == Some(mass)) => {
            ForcePath::Divided(mass)
        }
        _ => ForcePath::Bare,
    }
}

/// The sum of the forces in a derivative, and the mass by which each of its terms is divided where they are not divided as a whole.
pub(super) fn force_of<'a>(simulation: &Simulation, derivative: &'a Expr) -> (&'a Expr, Option<&'a Expr>) {
    match force_path(simulation, derivative) {
        ForcePath::Quotient(force, _) => (force, None),
        ForcePath::Divided(mass) => (derivative, Some(mass)),
        ForcePath::Bare => (derivative, None),
    }
}

/// A moving part: a velocity, mostly with its displacement.
pub(super) struct Motion<'a> {
    pub x: Option<&'a str>,
    /// The angle that was added where it turns and the user's simulation has its speed only.
    pub turn: Option<&'a str>,
    pub v: &'a str,
    /// The state whose derivative holds the forces: the velocity, or what is integrated to it.
    pub state: &'a str,
    pub derivative: &'a Expr,
    /// What the rate of the displacement is for each unit of the velocity where that is not one: `1000` from m/s to mm, `1/m` from a momentum.
    pub scale: Option<Expr>,
    /// Whether it is a flow, whose mass moves in a pipe between stores.
    pub flow: bool,
}

impl Motion<'_> {
    pub fn name(&self) -> &str {
        self.x.unwrap_or(self.v)
    }

    /// The rate of the displacement; the velocity where it has none.
    pub fn rate(&self) -> Expr {
        match &self.scale {
            Some(scale) => scale.clone() * Expr::symbol(self.v),
            None => Expr::symbol(self.v),
        }
    }
}

/// What a quantity is by its unit, else by its name.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kinematic {
    Displacement,
    Velocity,
    Neither,
}

pub(super) fn kinematic(unit: Option<&Unit>, name: &str) -> Kinematic {
    let Some(unit) = unit else {
        return match name.to_ascii_lowercase().as_str() {
            "x" | "q" | "z" | "disp" | "displacement" | "pos" | "position" | "theta" | "phi" | "alpha" | "angle" => {
                Kinematic::Displacement
            }
            "v" | "vel" | "velocity" | "speed" | "omega" | "xdot" | "dx" | "x_dot" => Kinematic::Velocity,
            _ => Kinematic::Neither,
        };
    };
    if is_one_of(unit, &["m"]) || angle(unit).is_some() {
        Kinematic::Displacement
    } else if is_one_of(unit, &["m/s"]) || is_rate_of_turn(unit) {
        Kinematic::Velocity
    } else {
        Kinematic::Neither
    }
}

/// Whether an input is a displacement by its unit, else by its name.
pub(crate) fn is_place(simulation: &Simulation, input: &str) -> bool {
    kinematic(simulation.unit_of(input).as_ref(), input) == Kinematic::Displacement
}

/// The factor that turns a unit of angle into radians.
pub(super) fn angle(unit: &Unit) -> Option<Expr> {
    match unit.to_string().as_str() {
        "rad" => Some(Expr::Number(1.0)),
        "mrad" => Some(Expr::Number(1e-3)),
        "deg" => Some(Expr::symbol("pi") / 180.0),
        "rev" | "turn" => Some(Expr::symbol("pi") * 2.0),
        _ => None,
    }
}

/// Units of what a capacitor has.
pub(super) const CHARGED: &[&str] = &["C", "V"];

/// Units of what a spring pulls with.
const FORCES: &[&str] = &["N", "N m"];

/// The constant by which a state's derivative is a multiple of a velocity, where the state is a displacement by its unit or name, a capacitor that
/// a current charges, the force of a spring that the velocity winds up and that acts back on it, or one of two states without dimension of which the same is
/// true, as in equations that are made dimensionless.
fn scale(simulation: &Simulation, position: &State, velocity: &State) -> Option<Expr> {
    let unit = || shown_unit(simulation, &position.name);
    let charged = || has_unit(simulation.unit_of(&velocity.name), &["A"]) && has_unit(unit(), CHARGED);
    let bare = |unit: Option<Unit>| unit.is_none_or(|u| u.is_none());
    let driving = || shown_unit(simulation, &velocity.name);
    let wound = || {
        has_unit(unit(), FORCES) && kinematic(driving().as_ref(), &velocity.name) == Kinematic::Velocity
            || bare(unit()) && bare(driving())
    };
    let moved = kinematic(unit().as_ref(), &position.name) == Kinematic::Displacement
        || charged()
        || velocity.derivative.uses(&position.name) && wound();
    if signals_in(simulation, &position.derivative).any(|s| s != velocity.name) || !moved {
        return None;
    }
    constant_coefficient(simulation, &position.derivative, &velocity.name)
}

/// Units of what a mass holds of its velocity.
const MOMENTA: &[&str] = &["kg m/s", "kg m^2/s"];
/// Units of masses.
const MASSES: &[&str] = &["kg", "kg m^2"];

/// The unit of a state; where it has none, that of an output which shows the state as it is.
pub(super) fn shown_unit(simulation: &Simulation, state: &str) -> Option<Unit> {
    simulation.unit_of(state).or_else(|| {
        let shown = simulation.outputs.iter().find(|o| o.expression == Expr::symbol(state));
        shown.and_then(|o| Unit::of_column(&o.column))
    })
}

/// Whether a state is the momentum of a part: by its unit, and where it has none by the masses that divide it.
pub(super) fn is_momentum(simulation: &Simulation, state: &State) -> bool {
    if let Some(unit) = simulation.unit_of(&state.name) {
        return is_one_of(&unit, MOMENTA);
    }
    let (mut divided, mut otherwise) = (0, 0);
    let by_a_mass = |above: &Expr, below: &Expr| {
        factors(above).contains(&&Expr::symbol(&state.name)) && has_unit(simulation.unit_of_expr(below), MASSES)
    };
    for (_, e) in simulation.expressions() {
        e.visit(&mut |e| match e {
            Expr::Binary(BinaryOp::Div, above, below) if by_a_mass(above, below) => divided += 1,
            Expr::Symbol(name) => otherwise += usize::from(*name == state.name),
            _ => {}
        });
    }
    divided > 0 && otherwise == divided
}

/// Units of flows.
const FLOWS: &[&str] = &["m^3/s", "kg/s"];

/// Whether a state is the flow in a pipe, of which the mass moves: a level or a pressure that it fills drives it back. What only follows, as the flow of a valve
/// that opens slowly, has no mass.
fn is_inert_flow(simulation: &Simulation, state: &State) -> bool {
    let acts_back =
        |s: &State| s.name != state.name && s.derivative.uses(&state.name) && state.derivative.uses(&s.name);
    has_unit(simulation.unit_of(&state.name), FLOWS) && simulation.states.iter().any(acts_back)
}

pub(super) fn motions<'a>(simulation: &'a Simulation, original: &Simulation) -> Vec<Motion<'a>> {
    let of_the_user = |s: &&State| original.state(&s.name).is_some();
    let (turns, others): (Vec<&State>, Vec<&State>) =
        simulation.states.iter().filter(of_the_user).partition(|s| is_turn(original, &s.name));
    let known = || others.iter().copied();
    let mut found = Vec::new();
    for velocity in known() {
        let scaled = |s: &&State| scale(simulation, s, velocity);
        let position = known().find(|s| s.derivative == Expr::symbol(&velocity.name));
        let (position, scale) = match position {
            Some(x) => (Some(x), None),
            None => known().find_map(|s| Some((s, scaled(&s)?))).unzip(),
        };
        let passes_on = matches!(&velocity.derivative, Expr::Symbol(s) if original.state(s).is_some());
        let unit = shown_unit(simulation, &velocity.name);
        let alone =
            kinematic(unit.as_ref(), &velocity.name) == Kinematic::Velocity || is_momentum(simulation, velocity);
        let flow = position.is_none() && !alone && is_inert_flow(simulation, velocity);
        if passes_on || !(position.is_some() || alone || flow) {
            continue;
        }
        // A chain x' = v, v' = a, a' = ...: what acts on a depends on where and how fast the part is; v is no displacement.
        let first = position
            .filter(|_| scale.is_none())
            .and_then(|v| known().find(|x| x.derivative == Expr::symbol(&v.name)).map(|x| (x, v)));
        let (x, v) = first.map_or((position, velocity), |(x, v)| (Some(x), v));
        found.push(Motion {
            x: x.map(|s| s.name.as_str()),
            turn: turns.iter().find(|s| s.derivative.uses(&v.name)).map(|s| s.name.as_str()),
            v: &v.name,
            state: &velocity.name,
            derivative: &velocity.derivative,
            scale,
            flow,
        });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_without_dimension_is_a_displacement_where_it_acts_back() {
        let found = |unit: &str, rate: &str, force: &str| {
            let text = format!(
                "[time]\nperiod_s = 1e-6\n[inputs]\nu = \"drive_V\"\n[parameters]\nw = {{ value = 1e4, min = 1.0, unit = \"1/s\" }}\n\
                 [states]\ns = {{ derivative = \"w*({force})\", initial = 0.0, unit = \"{unit}\" }}\n\
                 y = {{ derivative = \"{rate}\", initial = 0.0, unit = \"{unit}\" }}\n[outputs]\nout = \"y\"\n"
            );
            let simulation = Simulation::parse(&text, "comb.sim.toml").unwrap();
            motions(&simulation, &simulation)
                .iter()
                .map(|m| (m.x.map(str::to_owned), m.state.to_owned()))
                .collect::<Vec<_>>()
        };
        let moving = vec![(Some("y".to_owned()), "s".to_owned())];
        assert_eq!(found("-", "w*s", "u - s/50 - y"), moving);
        assert_eq!(found("-", "w*s", "u - s/50 - sin(y)"), moving);
        assert!(found("-", "w*s", "u - s/50").is_empty(), "a sum of what a lag shows");
        assert!(found("-", "w*(s - y)", "u - s/50 - y").is_empty(), "a second lag");
        assert!(found("mol/l", "w*s", "u - s/50 - y").is_empty());
    }

    #[test]
    fn a_flow_has_mass_where_what_it_fills_drives_it_back() {
        let found = |flow: &str, level: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.5\n[inputs]\nq = \"turbine_m3_s\"\n[parameters]\nr = {{ value = 0.2, min = 0.01 }}\n[states]\n\
                 Q = {{ derivative = \"{flow}\", initial = 0.0, unit = \"L/s\" }}\nz = {{ derivative = \"{level}\", initial = 0.0, unit = \"m\" }}\n[outputs]\nlevel_m = \"z\"\n"
            );
            let simulation = Simulation::parse(&text, "surge.sim.toml").unwrap();
            let slots = crate::slot::Structure::of(&simulation).slots;
            let at = |label: &str| slots.iter().find(|s| s.label == label).map(|s| s.place);
            (at("state:Q"), at("state:z"))
        };
        use crate::slot::Place::{Force, Store};
        assert_eq!(found("0.1*(38 - z - r*Q)", "(Q - q)/33"), (Some(Force), Some(Store)));
        assert_eq!(found("(q - Q)/r", "(Q - r*z)/33").0, Some(Store), "it follows a valve");
    }

    #[test]
    fn the_force_of_a_spring_is_a_displacement_to_its_mass() {
        let found = |force: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nF = \"rod_kN\"\n[parameters]\nk = {{ value = 150.0, min = 1.0, unit = \"kN/m\" }}\nm = {{ value = 190.0, min = 1.0, unit = \"kg\" }}\n\
                 [states]\nf = {{ derivative = \"k*v\", initial = 0.0, unit = \"kN\" }}\n\
                 v = {{ derivative = \"1000*({force})/m\", initial = 0.0, unit = \"m/s\" }}\n[outputs]\nvel_mm_s = \"1000*v\"\n"
            );
            let simulation = Simulation::parse(&text, "bush.sim.toml").unwrap();
            motions(&simulation, &simulation).iter().map(|m| m.x.map(str::to_owned)).collect::<Vec<_>>()
        };
        assert_eq!(found("F - f"), [Some("f".to_owned())]);
        assert_eq!(found("F"), [None], "it pulls at nothing");
    }

    #[test]
    fn a_momentum_is_told_by_its_unit_or_its_mass_and_a_speed_by_what_shows_it() {
        let found = |p: &str, unit: &str, torque: &str, n: &str, output: &str| -> Vec<String> {
            let unit = if unit.is_empty() { String::new() } else { format!(", unit = \"{unit}\"") };
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nT = \"T_Nm\"\n[parameters]\nJ = {{ value = 1.0, min = 0.1, unit = \"kg m^2\" }}\n\
                 C = {{ value = 1.0, min = 0.1 }}\n[states]\n{p} = {{ derivative = \"{torque}\", initial = 0.0{unit} }}\n\
                 s = {{ derivative = \"(T - {n})/C\", initial = 0.0 }}\n[outputs]\n{output} = \"s\"\n"
            );
            let simulation = Simulation::parse(&text, "drive.sim.toml").unwrap();
            motions(&simulation, &simulation).iter().map(|m| m.v.to_owned()).collect()
        };
        assert_eq!(found("p", "kg m^2/s", "T - C*p/J", "s", "level"), ["p"]);
        assert_eq!(found("p", "", "T - C*p/J", "p/J", "level"), ["p"]);
        assert!(found("p", "", "T - C*p/J", "p", "level").is_empty(), "it stands somewhere without its mass");
        assert!(found("p", "", "T - C*p/C", "s", "level").is_empty());
        assert!(found("p", "m^3", "T - C*p/J", "s", "level").is_empty());
        assert_eq!(found("p", "m^3", "T - C*p/J", "s", "fan_rpm"), ["s"]);
    }
}
