//! The slots between two moving parts: of two displacements, of a deflection that is a state of its own.

use hysid_plant::{BinaryOp, Expr, Simulation, State};

use super::algebra::{
    coefficient, constant_coefficient, linear_coefficient, only_parameters, quotient, signals_in, unless_one,
};
use super::find::Finder;
use super::motion::{Motion, angle, force_of};
use super::turn::is_rate_of_turn;
use super::{Place, Pull, Slot, Target};

/// Whether a product is told with a minus.
pub(super) fn is_negative(product: &Expr) -> bool {
    signed(product.clone()).0
}

/// Whether a product is told with a minus, and the product without it.
pub(super) fn signed(product: Expr) -> (bool, Expr) {
    match quotient(product, Expr::Number(1.0)) {
        Expr::Neg(size) => (true, *size),
        Expr::Number(n) if n < 0.0 => (true, Expr::Number(-n)),
        size => (false, size),
    }
}

/// The terms of the force on a part, each with its sign.
pub(super) fn forces_of<'e>(simulation: &Simulation, motion: &Motion<'e>) -> impl Iterator<Item = (f64, &'e Expr)> {
    force_of(simulation, motion.derivative).0.terms().into_iter()
}

/// The terms of a sum, also of one that is divided as a whole, each but for its sign and its divisor.
fn addends(term: &Expr) -> Vec<&Expr> {
    match term {
        Expr::Binary(BinaryOp::Div, above, _) => {
            above.terms().into_iter().flat_map(|(_, term)| addends(term)).collect()
        }
        _ => vec![term],
    }
}

/// What connects two parts.
pub(super) struct Stretch<'a> {
    /// The deflection.
    pub x: Expr,
    /// Its rate.
    pub v: Expr,
    /// A symbol that the force on the first part is linear in, where the connection is.
    pub symbol: &'a str,
    /// What the first part feels of the force, where that is not all of it.
    pub lever: Option<Expr>,
    /// The part at its other end; none where that is a motion which an input prescribes.
    pub other: Option<&'a Motion<'a>>,
    /// Where it is, for people.
    pub words: String,
}

impl Finder<'_> {
    pub(super) fn connections(&self) -> Vec<Slot> {
        let mut slots = Vec::new();
        let elements = self.elements();
        for (i, one) in self.motions.iter().enumerate() {
            for other in &self.motions[i + 1..] {
                let (Some(x1), Some(x2)) = (one.x, other.x) else { continue };
                // A deflection is no place, and nothing lies between it and one.
                if elements.iter().any(|e| e.pulls_at(one.state) && e.pulls_at(other.state)) {
                    continue;
                }
                let units = (self.simulation.unit_of(x1), self.simulation.unit_of(x2));
                let alike = match &units {
                    (Some(a), Some(b)) => a.same_dimension(b),
                    _ => true,
                };
                if alike && one.derivative.uses(x2) && other.derivative.uses(x1) {
                    let ratio = self.ratio(one, x1, x2);
                    let of = |one: Expr| ratio.as_ref().map_or(one.clone(), |r| r.clone() * one.clone());
                    let stretch = Stretch {
                        x: of(Expr::symbol(x1)) - Expr::symbol(x2),
                        v: of(one.rate()) - other.rate(),
                        symbol: x2,
                        lever: ratio.clone(),
                        other: Some(other),
                        words: format!("between {x1} and {x2}"),
                    };
                    slots.push(self.connection(one, stretch));
                }
            }
        }
        slots.extend(self.twists());
        slots.extend(self.grounds());
        slots.extend(elements);
        slots
    }

    /// What a connection takes of the first displacement for each unit of the second where that is not one, as a gear has it: the terms of the
    /// first part's force that hold the second displacement hold both in that proportion.
    fn ratio(&self, one: &Motion<'_>, x1: &str, x2: &str) -> Option<Expr> {
        let forces = forces_of(self.simulation, one).flat_map(|(_, term)| addends(term));
        let mut shared = forces.filter(|term| term.uses(x1) && term.uses(x2));
        let (one, two) = shared.find_map(|t| Some((coefficient(t, x1)?, coefficient(t, x2)?)))?;
        let ratio = quotient(-one.simplified(), two.simplified());
        unless_one(ratio).filter(|ratio| only_parameters(self.simulation, ratio))
    }

    /// Connections whose deflection is a state of its own, the velocity of one part less that of another: a shaft's twist, also where it is told
    /// as the torque or the second part is behind a gear.
    fn twists(&self) -> Vec<Slot> {
        let twist = |state: &State| {
            let (name, rate) = (state.name.as_str(), &state.derivative);
            let felt = |m: &&Motion<'_>| rate.uses(m.v) && m.derivative.uses(name);
            let mut between = self.motions.iter().filter(felt);
            let (Some(one), Some(other), None) = (between.next(), between.next(), between.next()) else {
                return self.twist_to_ground(state);
            };
            if signals_in(self.simulation, rate).any(|s| s != one.v && s != other.v) {
                return None;
            }
            let coefficients = [one, other].map(|m| constant_coefficient(self.simulation, rate, m.v));
            let [Some(a), Some(b)] = coefficients else { return None };
            // The part whose velocity counts positively is the first.
            let ((one, first), (other, second)) = match (is_negative(&a), is_negative(&b)) {
                (false, true) => ((one, a), (other, b)),
                (true, false) => ((other, b), (one, a)),
                _ => return None,
            };
            let stretch = Stretch {
                x: Expr::symbol(name),
                v: rate.clone(),
                symbol: name,
                lever: unless_one(quotient(-first, second)),
                other: Some(other),
                words: format!("across {name}"),
            };
            Some(self.connection(one, stretch))
        };
        let known = self.simulation.states.iter().filter(|s| self.original.state(&s.name).is_some());
        known.filter_map(twist).collect()
    }

    /// The force between two parts, over the deflection of what connects them.
    pub(super) fn connection(&self, one: &Motion<'_>, stretch: Stretch<'_>) -> Slot {
        let Stretch { x, v, symbol, lever, other, words } = stretch;
        let mut pulls = vec![Pull { lever: lever.clone(), ..Pull::new(one.state, 1.0) }];
        pulls.extend(other.map(|other| Pull::new(other.state, -1.0)));
        let mut slot = Slot::new(Place::Connection, format!("state:{}", one.state), words, Target::Derivatives(pulls));
        slot.loops = self.loops(&v);
        slot.offer(self.simulation, "x", x.clone());
        slot.offer(self.simulation, "v", v.clone());
        let unit = |name: &str| self.simulation.unit_of(name);
        slot.turns =
            unit(one.v).is_some_and(|u| is_rate_of_turn(&u)) || one.x.and_then(unit).as_ref().and_then(angle).is_some();
        let (force, divided) = force_of(self.simulation, one.derivative);
        let whole = |e: Expr| {
            let e = match divided {
                Some(mass) => (mass.clone() * e).simplified(),
                None => e,
            };
            quotient(e, lever.clone().unwrap_or(Expr::Number(1.0)))
        };
        let held = |t: &Expr| t.uses(symbol) || other.is_some_and(|other| t.uses(other.v));
        let coupling = force.terms().into_iter().filter(|(_, t)| held(t));
        if let Some(size) = coupling.map(|(_, t)| t.clone().abs()).reduce(|a, b| a + b) {
            slot.offer(self.simulation, "F", whole(size));
        }
        // For each unit of the deflection or of its rate, which may count a symbol in another unit.
        let rate = |symbol: &str, within: &Expr| {
            let rate = linear_coefficient(self.simulation, force, symbol)?;
            let count = constant_coefficient(self.simulation, within, symbol);
            Some(whole(count.map_or(rate.clone(), |count| quotient(rate, -count))))
        };
        if let Some(k) = rate(symbol, &x) {
            slot.offer(self.simulation, "k", k);
        }
        if let Some(c) = other.and_then(|other| rate(other.v, &v)) {
            slot.offer(self.simulation, "c", c);
        }
        slot.context = vec![one.derivative.clone()];
        slot.offer_own_sign(self.simulation);
        slot
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::Structure;
    use super::*;

    /// Displacement, velocity and stiffness of the slots of a kind, with the states that they pull at.
    pub fn slots(place: Place, states: &[(&str, &str, &str)]) -> Vec<[String; 4]> {
        slots_driven("torque_Nm", place, states)
    }

    /// The same with an input from this column.
    pub fn slots_driven(column: &str, place: Place, states: &[(&str, &str, &str)]) -> Vec<[String; 4]> {
        let told = |slot: &Slot| {
            let of = |symbol: &str| slot.quantity(symbol).map_or(String::new(), |q| q.expression.to_string());
            let Target::Derivatives(pulls) = &slot.target else { panic!("{}", slot.label) };
            let pull = |p: &Pull| format!("{}{}", if p.sign > 0.0 { "-" } else { "+" }, p.of(&Expr::symbol(&p.state)));
            [of("x"), of("v"), of("k"), pulls.iter().map(pull).collect::<Vec<_>>().join(" ")]
        };
        found(column, place, states).iter().map(told).collect()
    }

    /// The slots of a kind, of a simulation with these states (name, derivative, unit).
    pub fn slots_of(place: Place, states: &[(&str, &str, &str)]) -> Vec<Slot> {
        found("torque_Nm", place, states)
    }

    fn found(column: &str, place: Place, states: &[(&str, &str, &str)]) -> Vec<Slot> {
        let states: String = states
            .iter()
            .map(|(name, derivative, unit)| {
                format!("{name} = {{ derivative = \"{derivative}\", initial = 0.0, unit = \"{unit}\" }}\n")
            })
            .collect();
        let text = format!(
            "[time]\nperiod_s = 0.01\n[inputs]\nu = \"{column}\"\n[parameters]\nJ = {{ value = 2.0, min = 0.1 }}\nk = {{ value = 50.0, min = 1.0 }}\n\
             c = {{ value = 0.3, min = 0.0 }}\nn = {{ value = 4.0, fixed = true }}\np = {{ value = 90.0, min = 1.0 }}\n[states]\n{states}[outputs]\nspeed_rad_s = \"w2\"\n"
        );
        let simulation = Simulation::parse(&text, "test.sim.toml").unwrap();
        Structure::of(&simulation).slots.into_iter().filter(|s| s.place == place).collect()
    }

    #[test]
    fn what_connects_two_parts_is_found_however_it_is_written() {
        let check = |states: &[(&str, &str, &str)], expected: [&str; 4]| {
            assert_eq!(slots(Place::Connection, states), [expected.map(str::to_owned)]);
        };
        let (rad, rate) = ("rad", "rad/s");
        let ends = [("q1", "w1", rad), ("q2", "w2", rad)];
        let with = |rest: &[(&'static str, &'static str, &'static str)]| [&ends[..], rest].concat();
        check(
            &with(&[("w1", "(u - k*(q1 - q2))/J", rate), ("w2", "k*(q1 - q2)/J", rate)]),
            ["q1 - q2", "w1 - w2", "k", "-w1 +w2"],
        );
        check(
            &with(&[("w1", "(u - k*(q1/n - q2)/n)/J", rate), ("w2", "k*(q1/n - q2)/J", rate)]),
            ["1/n*q1 - q2", "1/n*w1 - w2", "k", "-1/n*w1 +w2"],
        );
        // The terms of the difference may stand apart.
        check(
            &with(&[("w1", "(-(p + k)*q1 + k*q2 - c*w1)/J", rate), ("w2", "(k*q1 - k*q2)/J", rate)]),
            ["q1 - q2", "w1 - w2", "k", "-w1 +w2"],
        );
        // A spring to the ground beside it is no part of a gear, wherever the sum of the forces stands.
        check(
            &with(&[("w1", "(u - p*q1 - k*(q1 - q2))/J - c", rate), ("w2", "k*(q1 - q2)/J - c", rate)]),
            ["q1 - q2", "w1 - w2", "k/J", "-w1 +w2"],
        );
        let twisted = |twist, w1, w2| [("z", twist, rad), ("w1", w1, rate), ("w2", w2, rate)];
        check(&twisted("w1 - w2", "(u - k*z)/J", "k*z/J"), ["z", "w1 - w2", "k", "-w1 +w2"]);
        check(&twisted("w2 - w1", "(u + k*z)/J", "(-k*z - c*w2)/J"), ["z", "w2 - w1", "k", "-w2 +w1"]);
        check(&twisted("w1/n - w2", "(u - k*z/n)/J", "k*z/J"), ["z", "w1/n - w2", "k", "-1/n*w1 +w2"]);
        check(&twisted("k*(w1 - w2)", "(u - z)/J", "(z - c*w2)/J"), ["z", "k*(w1 - w2)", "1", "-w1 +w2"]);
        // A damping is that for each unit of the rate of the deflection.
        let milli = twisted("1000*(w1 - w2)", "(u - k*z - c*(w1 - w2))/J", "(k*z + c*(w1 - w2))/J");
        let damping = slots_of(Place::Connection, &milli)[0].quantity("c").map(|q| q.expression.to_string());
        assert_eq!(damping.as_deref(), Some("c/1000"));
        // Drifts of storeys: what an element pulls with stands in the equations of its neighbours.
        let drifts = [
            ("d1", "v1", "m"),
            ("v1", "-u - (k*d1 + c*v1) + (k*d2 + c*v2)", "m/s"),
            ("d2", "v2", "m"),
            ("v2", "(k*d1 + c*v1) - 2*(k*d2 + c*v2)", "m/s"),
            ("w2", "u - c*w2", "rad/s"),
        ];
        let found = slots(Place::Connection, &drifts);
        let expected = [["d1", "v1", "k", "-v1 +v2"], ["d2", "v2", "2*k", "-v2 +1/2*v1"]];
        assert_eq!(found, expected.map(|slot| slot.map(str::to_owned)));
        // A deflection whose rate tells the force of its element for both of its ends, each with its mass; in that of its base stands what holds this, too.
        let relative = [
            ("q1", "w1", "m"),
            ("w1", "(u - n*q1 + k*d + c*w2)/J", "m/s"),
            ("d", "w2", "m"),
            ("w2", "-(k*d + c*w2)/n - (u - n*q1 + k*d + c*w2)/J", "m/s"),
        ];
        let found = slots(Place::Connection, &relative);
        let expected = [["q1", "w1", "n", "-w1 +1/J*w2"], ["d", "w2", "k", "-(1/n + 1/J)*w2 +w1"]];
        assert_eq!(found, expected.map(|slot| slot.map(str::to_owned)));
        // A suspension over its own deflection, above a tyre.
        let suspended = [
            ("q1", "w1", "m"),
            ("w1", "(k*d + c*w2)/J", "m/s"),
            ("d", "w2", "m"),
            ("w2", "(p*(u - q1 - d) - k*d - c*w2)/n - (k*d + c*w2)/J", "m/s"),
        ];
        let found = slots(Place::Connection, &suspended);
        assert_eq!(found, [["d", "w2", "k", "-(1/n + 1/J)*w2 +w1"].map(str::to_owned)]);
        // An absorber over its stroke, on a part of which it has a share of the mass.
        let absorbed = [
            ("q1", "w1", "m"),
            ("w1", "u - k*q1 + n*(2*c*p*w2 + p^2*d)", "m/s"),
            ("d", "w2", "m"),
            ("w2", "-2*c*p*w2 - p^2*d - (u - k*q1 + n*(2*c*p*w2 + p^2*d))", "m/s"),
        ];
        let found = slots(Place::Connection, &absorbed);
        let expected = [["q1", "w1", "k", "-w1 +w2"], ["d", "w2", "p^2", "-(1 + n)*w2 +n*w1"]];
        assert_eq!(found, expected.map(|slot| slot.map(str::to_owned)));
        // A first effect in an element leaves the second its place.
        let stiffened = [
            drifts[0],
            ("v1", "-u - (k*d1 + c*v1 + n*d1^3) + (k*d2 + c*v2)", "m/s"),
            drifts[2],
            ("v2", "(k*d1 + c*v1 + n*d1^3) - 2*(k*d2 + c*v2)", "m/s"),
            drifts[4],
        ];
        assert_eq!(
            slots(Place::Connection, &stiffened).iter().map(|s| &s[..2]).collect::<Vec<_>>(),
            [["d1", "v1"], ["d2", "v2"]]
        );
        // The free play of a rod is a clearance, that of a shaft is backlash.
        let loose = |id: &str, states: &[(&str, &str, &str)]| {
            let law = crate::mechanism::mechanism(id).unwrap();
            slots_of(Place::Connection, states).iter().filter(|s| law.fits(s)).count()
        };
        let shaft = with(&[("w1", "(u - k*(q1 - q2))/J", rate), ("w2", "k*(q1 - q2)/J", rate)]);
        let rod: Vec<_> = shaft.iter().map(|&(name, e, _)| (name, e, if name < "w" { "m" } else { "m/s" })).collect();
        assert_eq!(["backlash", "spring_clearance"].map(|id| loose(id, &shaft)), [1, 0]);
        assert_eq!(["backlash", "spring_clearance"].map(|id| loose(id, &rod)), [0, 1]);
        assert!(slots(Place::Connection, &twisted("w1 + w2", "(u - k*z)/J", "-k*z/J")).is_empty());
    }
}
