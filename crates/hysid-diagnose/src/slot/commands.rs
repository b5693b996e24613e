//! The commands of loops that the simulation closes: what a controller in its equations puts out, as `j - kp*x - kd*v` in
//! `(ks*x + ki*(j - kp*x - kd*v))/m`. What an actuator leaves out acts on the whole of it, the fed-back part too. The voltage that a controller puts across
//! a winding is one as well, as `kp*(r - w)` in `(kp*(r - w) - R*i)/L`.

use hysid_plant::{BinaryOp, Expr, Simulation, State};

use super::algebra::{constant_coefficient, only_parameters};
use super::find::Finder;
use super::motion::{Kinematic, Motion, force_of, kinematic};
use super::{Place, Slot, Target};

impl Finder<'_> {
    /// One slot for each command, whichever states it drives.
    pub(super) fn commands(&self) -> Vec<Slot> {
        let known = self.simulation.states.iter().filter(|s| self.original.state(&s.name).is_some());
        let mut found: Vec<(Expr, Vec<String>)> = Vec::new();
        for state in known {
            let all = commands_in(self.simulation, &state.derivative);
            let voltage = self.voltage(state).map(|v| v.command);
            for command in all.into_iter().chain(followed(self.simulation, state)).chain(voltage) {
                match found.iter_mut().find(|(e, _)| *e == *command) {
                    Some((_, driven)) => driven.push(state.name.clone()),
                    None => found.push((command.clone(), vec![state.name.clone()])),
                }
            }
        }
        let slot = |(command, driven): (Expr, Vec<String>)| {
            let first = driven.first()?;
            let mut slot = Slot::new(
                Place::Command,
                format!("state:{first}"),
                format!("where the command {command} drives {first}"),
                Target::PartIn(command.clone(), driven.clone()),
            );
            let across = self.voltage(self.simulation.state(first)?).filter(|v| *v.command == command);
            slot.offer(self.simulation, "u", command);
            slot.context = self.derivatives_of(&driven);
            if let Some(motion) = across.and_then(|v| v.unfelt) {
                slot.offer(self.simulation, "i", Expr::symbol(first));
                slot.offer(self.simulation, "v", Expr::symbol(motion.v));
            }
            Some(slot)
        };
        found.into_iter().filter_map(slot).collect()
    }

    /// The voltage that a controller puts across the winding of which this state is the current: what is left of its balance, from the left, without what the
    /// winding resists and what it feels of a speed.
    fn voltage<'e>(&'e self, state: &'e State) -> Option<Voltage<'e>> {
        let simulation = self.simulation;
        if !self.is_current(state) {
            return None;
        }
        let motion = self.motions.iter().find(|m| m.derivative.uses(&state.name))?;
        let is_of = |e: &Expr, name: &str| constant_coefficient(simulation, e, name).is_some();
        let (mut command, (mut resisted, mut feels)) = (force_of(simulation, &state.derivative).0, (false, false));
        while let Expr::Binary(BinaryOp::Add | BinaryOp::Sub, rest, last) = command {
            let (own, speed) = (is_of(last, &state.name), self.motions.iter().any(|m| is_of(last, m.v)));
            if !own && !speed {
                break;
            }
            (resisted, feels, command) = (resisted || own, feels || speed, rest);
        }
        let unfelt = (!feels).then_some(motion);
        (resisted && closes_a_loop(simulation, command)).then_some(Voltage { command, unfelt })
    }
}

/// What a controller puts across a winding.
struct Voltage<'e> {
    /// The voltage.
    command: &'e Expr,
    /// What the winding moves, where it does not feel the speed of that.
    unfelt: Option<&'e Motion<'e>>,
}

/// Whether an input and fed-back states are in what would be a command.
fn closes_a_loop(simulation: &Simulation, command: &Expr) -> bool {
    let drives = simulation.inputs.iter().any(|i| command.uses(&i.symbol));
    drives && simulation.states.iter().any(|s| command.uses(&s.name))
}

/// The commands in a derivative: sums of an input and of fed-back states that parameters alone multiply, one term of several in the balance of forces.
fn commands_in<'e>(simulation: &Simulation, derivative: &'e Expr) -> Vec<&'e Expr> {
    let (balance, _) = force_of(simulation, derivative);
    let mut found: Vec<&Expr> = Vec::new();
    if balance.terms().len() < 2 {
        return found;
    }
    balance.visit(&mut |e| {
        let part = match e {
            Expr::Binary(BinaryOp::Mul, a, b) if is_gain(simulation, a) => b,
            Expr::Binary(BinaryOp::Mul, a, b) if is_gain(simulation, b) => a,
            _ => return,
        };
        // What a loop inside this one compares with its own state: the current that is asked for, as in `K*(kp*(r - w) + ki*q - i)`.
        let part = match &**part {
            Expr::Binary(BinaryOp::Sub, asked, own)
                if bare(simulation, own) && !asked.terms().iter().any(|(_, e)| bare(simulation, e)) =>
            {
                asked
            }
            _ => part,
        };
        let inside = |outer: &&Expr| {
            let mut is = false;
            outer.visit(&mut |e| is |= e == &**part);
            is
        };
        // A controller's own error, as `r - q` in `kp*(r - q) - kd*w`, is a part of what it puts out.
        if is_command(simulation, part) && !found.iter().any(inside) {
            found.push(part);
        }
    });
    found
}

/// The command that an actuator follows, where its state is one: `c` in `(c - a)/T` of a state `a`, of an input and fed-back states. What a winding feels of
/// its motor's speed is no command: its own current stands there with the resistance.
pub(super) fn followed<'e>(simulation: &Simulation, state: &'e State) -> Option<&'e Expr> {
    followed_at_once(simulation, state).or_else(|| swung_to(simulation, state))
}

/// As [`followed`], of an actuator that lags.
fn followed_at_once<'e>(simulation: &Simulation, state: &'e State) -> Option<&'e Expr> {
    let behind = match &state.derivative {
        Expr::Binary(BinaryOp::Div, behind, time) if only_parameters(simulation, time) => behind,
        Expr::Binary(BinaryOp::Mul, a, b) if only_parameters(simulation, a) => b,
        Expr::Binary(BinaryOp::Mul, a, b) if only_parameters(simulation, b) => a,
        _ => return None,
    };
    let Expr::Binary(BinaryOp::Sub, command, own) = &**behind else { return None };
    let follows = **own == Expr::symbol(&state.name) && !command.uses(&state.name);
    (follows && closes_a_loop(simulation, command) && command.terms().len() > 1).then_some(command)
}

/// As [`followed`], of an actuator that swings, such as a valve with its cylinder: `c` in `w^2*(c - v) - 2*d*w*a`, where `a` is the rate of a speed `v` and
/// `c` feeds back the way that it has gone. Between two parts on springs neither has the other's speed.
fn swung_to<'e>(simulation: &Simulation, state: &'e State) -> Option<&'e Expr> {
    let is_rate_of = |rate: &str, e: &State| e.derivative == Expr::symbol(rate);
    let asked = |(sign, term): (f64, &'e Expr)| {
        let Expr::Binary(BinaryOp::Mul, gain, behind) = term else { return None };
        let Expr::Binary(BinaryOp::Sub, command, speed) = &**behind else { return None };
        let Expr::Symbol(speed) = &**speed else { return None };
        let swings = simulation.state(speed).is_some_and(|v| is_rate_of(&state.name, v));
        let gone = simulation.states.iter().any(|x| is_rate_of(speed, x) && command.uses(&x.name));
        let follows = sign > 0.0 && only_parameters(simulation, gain) && !command.uses(speed);
        (swings && gone && follows && closes_a_loop(simulation, command)).then_some(&**command)
    };
    state.derivative.terms().into_iter().find_map(asked)
}

/// Whether this is a factor that an actuator has, and not the inverse of a mass before the forces themselves.
fn is_gain(simulation: &Simulation, e: &Expr) -> bool {
    let inverse = matches!(e, Expr::Binary(BinaryOp::Div, one, _) if matches!(**one, Expr::Number(_)));
    only_parameters(simulation, e) && !inverse
}

/// Whether this is a state by itself.
fn bare(simulation: &Simulation, e: &Expr) -> bool {
    matches!(e, Expr::Symbol(s) if simulation.state(s).is_some())
}

/// Whether a part of an equation is what a controller puts out. A difference of displacements is what a spring feels, and no command.
fn is_command(simulation: &Simulation, part: &Expr) -> bool {
    let terms = part.terms();
    if !closes_a_loop(simulation, part) || terms.len() < 2 || terms.iter().any(|(_, e)| bare(simulation, e)) {
        return false;
    }
    match simulation.unit_of_expr(part) {
        Some(unit) => kinematic(Some(&unit), "") == Kinematic::Neither,
        None => simulation.states.iter().filter(|s| part.uses(&s.name)).count() > 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The commands of a drive with this balance of its forces.
    fn commands(balance: &str, units: bool) -> Vec<String> {
        let unit = |u: &str| if units { format!(", unit = \"{u}\"") } else { String::new() };
        let parameter = |name: &str, u: &str| format!("{name} = {{ value = 1.0, min = 0.1{} }}\n", unit(u));
        let column = if units { "r = \"ref_rad\"\ni = \"current_A\"" } else { "r = \"first\"\ni = \"second\"" };
        let parameters = [
            parameter("J", "kg m^2"),
            parameter("k", "N m/rad"),
            parameter("b", "N m s/rad"),
            parameter("K", "N m/A"),
            parameter("P", "A/rad"),
            parameter("D", "A s/rad"),
            parameter("g", "1"),
        ];
        let text = format!(
            "[time]\nperiod_s = 0.01\n[inputs]\n{column}\n[parameters]\n{}[states]\nq = {{ derivative = \"w\", initial = 0.0{} }}\nw = {{ derivative = \"{balance}\", \
             initial = 0.0{} }}\n[outputs]\ny = \"q + 0*r + 0*i\"\n",
            parameters.concat(),
            unit("rad"),
            unit("rad/s")
        );
        let simulation = Simulation::parse(&text, "drive.sim.toml").unwrap();
        let found = crate::slot::Structure::of(&simulation).slots;
        let commands = found.iter().filter(|s| s.place == Place::Command);
        commands.map(|s| s.quantity("u").unwrap().expression.to_string()).collect()
    }

    #[test]
    fn what_a_controller_puts_out_is_a_command() {
        for units in [true, false] {
            assert_eq!(commands("(K*(i - P*q - D*w) - b*w)/J", units), ["i - P*q - D*w"]);
            assert_eq!(commands("(K*(P*(r - q) - D*w) - b*w)/J", units), ["P*(r - q) - D*w"]);
            assert_eq!(commands("K*(i - P*q - D*w)/J - b*w/J", units), ["i - P*q - D*w"]);
        }
    }

    #[test]
    fn an_actuator_follows_a_command_and_moves_the_plant() {
        let found = |servo: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.1\n[inputs]\nr = \"course_deg\"\n[parameters]\nK = {{ value = 0.1, min = 0.01 }}\nT = {{ value = 3.0, min = 0.1, unit = \"s\" }}\n\
                 [states]\npsi = {{ derivative = \"w\", initial = 0.0, unit = \"deg\" }}\nw = {{ derivative = \"K*de - 0.1*w\", initial = 0.0, unit = \"deg/s\" }}\n\
                 de = {{ derivative = \"{servo}\", initial = 0.0, unit = \"deg\" }}\n[outputs]\nheading_deg = \"psi\"\n"
            );
            let slots = crate::slot::Structure::of(&Simulation::parse(&text, "ship.sim.toml").unwrap()).slots;
            let at = |place: Place| {
                let mut signals = slots.iter().filter(|s| s.place == place).filter_map(|s| s.quantity("u"));
                signals.next().map(|q| q.expression.to_string())
            };
            (at(Place::Command), at(Place::Between))
        };
        let whole = |command: &str| (Some(command.to_owned()), Some("de".to_owned()));
        assert_eq!(found("(0.8*(r - psi) - 14*w - de)/T"), whole("0.8*(r - psi) - 14*w"));
        assert_eq!(found("0.3*(r - psi - 14*w - de)"), whole("r - psi - 14*w"));
        // What reacts upon it is no controller.
        assert_eq!(found("(r - psi - 2*de)/T"), (None, None));
    }

    #[test]
    fn a_valve_and_its_cylinder_swing_to_a_command() {
        let found = |balance: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nr = \"ram_set_mm\"\n[parameters]\nK = {{ value = 56.0, min = 15.0 }}\nw = {{ value = 49.0, min = 25.0, unit = \"rad/s\" }}\n\
                 [states]\nx = {{ derivative = \"v\", initial = 0.0, unit = \"mm\" }}\nv = {{ derivative = \"a\", initial = 0.0, unit = \"mm/s\" }}\n\
                 a = {{ derivative = \"{balance}\", initial = 0.0, unit = \"mm/s^2\" }}\n[outputs]\nram_mm = \"x\"\n"
            );
            let slots = crate::slot::Structure::of(&Simulation::parse(&text, "press.sim.toml").unwrap()).slots;
            let commands = slots.iter().filter(|s| s.place == Place::Command);
            let commands: Vec<String> = commands.map(|s| s.quantity("u").unwrap().expression.to_string()).collect();
            (commands, slots.iter().any(|s| s.place == Place::Connection))
        };
        assert_eq!(found("w^2*(0.2*K*(r - x) - v) - 0.7*w*a"), (vec!["0.2*K*(r - x)".to_owned()], false));
        // A valve that is driven from outside closes no loop.
        assert_eq!(found("w^2*(0.2*K*r - v) - 0.7*w*a"), (Vec::new(), false));
    }

    /// The slots for commands of a motor's winding with this balance of voltages: what each replaces, and whether a speed could be felt there.
    fn windings(balance: &str) -> Vec<(String, bool)> {
        let text = format!(
            "[time]\nperiod_s = 0.01\n[inputs]\nr = \"asked_rad_s\"\n[parameters]\nL = {{ value = 0.01, min = 0.001, unit = \"H\" }}\n\
             R = {{ value = 1.0, min = 0.1, unit = \"ohm\" }}\n[states]\nw = {{ derivative = \"(0.05*i - 0.001*w)/0.001\", initial = 0.0, unit = \"rad/s\" }}\n\
             i = {{ derivative = \"{balance}\", initial = 0.0, unit = \"A\" }}\nq = {{ derivative = \"r - w\", initial = 0.0, unit = \"rad\" }}\n\
             [outputs]\nspeed_rad_s = \"w\"\n"
        );
        let slots = crate::slot::Structure::of(&Simulation::parse(&text, "motor.sim.toml").unwrap()).slots;
        let commands = slots.iter().filter(|s| s.place == Place::Command);
        commands.map(|s| (s.quantity("u").unwrap().expression.to_string(), s.has("v") && s.has("i"))).collect()
    }

    #[test]
    fn what_a_controller_puts_across_a_winding_is_a_command() {
        let whole = |command: &str, free: bool| vec![(command.to_owned(), free)];
        assert_eq!(windings("(0.2*(r - w) + 1.4*q - R*i)/L"), whole("0.2*(r - w) + 1.4*q", true));
        assert_eq!(windings("(0.2*(r - w) - R*i)/L"), whole("0.2*(r - w)", true));
        assert_eq!(windings("(0.2*(r - w) + 1.4*q - 0.05*w - R*i)/L"), whole("0.2*(r - w) + 1.4*q", false));
        // The current that is asked for, and the voltage that a loop around it puts out.
        let cascaded = windings("(8*(0.2*(r - w) + 1.4*q - i) - R*i)/L");
        assert_eq!(
            cascaded,
            [("0.2*(r - w) + 1.4*q".to_owned(), false), ("8*(0.2*(r - w) + 1.4*q - i)".to_owned(), true)]
        );
        // A voltage that is prescribed.
        assert_eq!(windings("(0.2*r - 0.05*w - R*i)/L"), []);
    }

    #[test]
    fn what_a_spring_feels_and_the_balance_of_forces_are_none() {
        for units in [true, false] {
            for balance in [
                "(k*(r - q) - b*w)/J",
                "(K*i - b*w - k*q)/J",
                "1/J*(K*i - b*w - k*q) - b*w/J",
                "(K*i - b*w)/J - k*q/J",
                "(k*(g*r - q) - b*w)/J",
                "g*(K*i - b*w - k*q)/J",
                "(k*(g*r - g*q) - b*w)/J",
            ] {
                assert_eq!(commands(balance, units), [""; 0], "{balance}");
            }
        }
    }
}
