//! The slots between a moving part and a motion that an input prescribes: the ground under a structure, the road under a tyre.

use hysid_plant::{Expr, State};

use super::Slot;
use super::algebra::{constant_coefficient, quotient, signals_in, unless_one};
use super::connections::{Stretch, forces_of, is_negative};
use super::find::Finder;
use super::motion::{Kinematic, Motion, force_of, kinematic};

impl Finder<'_> {
    /// Connections with a motion that an input prescribes: a force that holds a velocity and the rate of the input together, or a spring between the two. A
    /// controller's gain is known, a spring's rate is not.
    pub(super) fn grounds(&self) -> Vec<Slot> {
        let mut slots = Vec::new();
        for one in &self.motions {
            let Some(x) = one.x.filter(|x| one.derivative.uses(x)) else { continue };
            for input in &self.simulation.inputs {
                let rate = Expr::symbol(&input.symbol).derivative_of_input();
                let holds_rate = |term: &Expr| {
                    let mut found = false;
                    term.visit(&mut |e| found |= *e == rate);
                    found && term.uses(one.v)
                };
                let scale = self.travel(one, x, &input.symbol);
                if scale.is_none() && !forces_of(self.simulation, one).any(|(_, term)| holds_rate(term)) {
                    continue;
                }
                let scale = scale.and_then(unless_one);
                let of_input = |e: Expr| match &scale {
                    Some(scale) => scale.clone() * e,
                    None => e,
                };
                let stretch = Stretch {
                    x: Expr::symbol(x) - of_input(Expr::symbol(&input.symbol)),
                    v: one.rate() - of_input(rate),
                    symbol: &input.symbol,
                    lever: None,
                    other: None,
                    words: format!("between {x} and {}", input.symbol),
                };
                slots.push(self.connection(one, stretch));
            }
        }
        slots
    }

    /// The connection whose deflection is a state of its own, the velocity that an input prescribes less that of a part, or the other way round: a cable on a drum.
    pub(super) fn twist_to_ground(&self, state: &State) -> Option<Slot> {
        let (name, rate) = (state.name.as_str(), &state.derivative);
        let mut felt = self.motions.iter().filter(|m| rate.uses(m.v) && m.derivative.uses(name));
        let (one, None) = (felt.next()?, felt.next()) else { return None };
        let own = constant_coefficient(self.simulation, rate, one.v)?;
        let symbols = rate.symbols();
        let mut given = symbols.iter().filter(|s| self.simulation.input(s).is_some());
        let (input, None) = (given.next()?, given.next()) else { return None };
        let ground = rate.replace(&Expr::symbol(input).derivative_of_input(), &Expr::symbol(input));
        let moves = match self.kinematic_input(input) {
            Kinematic::Velocity => ground == *rate,
            Kinematic::Displacement => ground != *rate,
            Kinematic::Neither => false,
        };
        let other = constant_coefficient(self.simulation, &ground, input)?;
        let others = |s: String| s != one.v && s != *input;
        // The integral of a controller's error is as long as a deflection; its gain is known, a spring's rate is not.
        let length = kinematic(self.simulation.unit_of(name).as_ref(), name) == Kinematic::Displacement;
        let rates = self.springs(one, name)?;
        if !(moves && length && rates.iter().all(|rate| self.is_estimated(rate, one)))
            || is_negative(&own) == is_negative(&other)
            || signals_in(self.simulation, rate).any(others)
        {
            return None;
        }
        // The part's own motion counts positively.
        let of_the_part = |e: Expr| if is_negative(&own) { -e } else { e };
        let stretch = Stretch {
            x: of_the_part(Expr::symbol(name)),
            v: of_the_part(rate.clone()).simplified(),
            symbol: name,
            lever: None,
            other: None,
            words: format!("across {name}"),
        };
        Some(self.connection(one, stretch))
    }

    /// Whether a parameter in the rate of a spring at a part is not known, but for the mass by which all its forces are divided.
    fn is_estimated(&self, rate: &Expr, part: &Motion<'_>) -> bool {
        let (_, mass) = force_of(self.simulation, part.derivative);
        let open = |s: &String| self.simulation.parameter(s).is_some_and(|p| !p.fixed);
        rate.symbols().iter().any(|s| open(s) && !mass.is_some_and(|mass| mass.uses(s)))
    }

    /// What a spring whose rate is estimated compares a displacement with for each unit of an input that is one too, by what is known: `0.001` of a road in mm,
    /// `pi/180` of a rod in degrees, the radius of a pinion.
    fn travel(&self, one: &Motion<'_>, x: &str, input: &str) -> Option<Expr> {
        // The rate of an acceleration balances no forces: what stands there is a servo's.
        if self.kinematic_input(input) != Kinematic::Displacement || one.state != one.v {
            return None;
        }
        forces_of(self.simulation, one).find_map(|(_, term)| {
            let [held, given] = [x, input].map(|s| constant_coefficient(self.simulation, term, s));
            let (held, given) = (held?, given?);
            let scale = quotient(-given, held.clone());
            let known = |s: &String| self.simulation.parameter(s).is_none_or(|p| p.fixed);
            let is_known = scale.symbols().iter().all(known);
            (self.is_estimated(&held, one) && is_known && !is_negative(&scale)).then_some(scale)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::Place;
    use super::super::connections::tests::{slots, slots_driven};

    #[test]
    fn a_cable_on_a_drum_stretches_between_the_load_and_what_the_input_prescribes() {
        let check = |column: &str, stretch: &str, pull: &str, expected: Option<[&str; 4]>| {
            let found = slots_driven(column, Place::Connection, &[("z", stretch, "m"), ("w2", pull, "m/s")]);
            let expected: Vec<_> = expected.map(|slot| slot.map(str::to_owned)).into_iter().collect();
            assert_eq!(found, expected, "{column} {stretch}");
        };
        check("drum_m_s", "u - w2", "(k*z + c*(u - w2))/J", Some(["-z", "-(u - w2)", "k", "-w2"]));
        check("drum_m_s", "w2 - u", "(-k*z - c*w2)/J", Some(["z", "w2 - u", "k", "-w2"]));
        check("drum_m", "d(u) - w2", "k*z/J", Some(["-z", "-(d(u) - w2)", "k", "-w2"]));
        check("drum_m", "u - w2", "k*z/J", None);
        check("pull_N", "u - w2", "k*z/J", None);
        check("drum_m_s", "u + w2", "-k*z/J", None);
        // A velocity loop with a known gain.
        check("ref_m_s", "u - w2", "(n*z + c*(u - w2))/J", None);
        check("ref_m_s", "u - w2", "n*z/J + c*(u - w2)/J", None);
    }

    #[test]
    fn a_motion_that_an_input_prescribes_is_ground_and_a_reference_is_none() {
        let (rad, rate) = ("rad", "rad/s");
        let based = [("q2", "w2", rad), ("w2", "(k*(u - q2) + c*(d(u) - w2))/J", rate)];
        assert_eq!(slots(Place::Connection, &based), [["q2 - u", "w2 - d(u)", "k", "-w2"].map(str::to_owned)]);
        // A controller's reference is no ground.
        assert!(slots(Place::Connection, &[based[0], ("w2", "(k*(u - q2) - c*w2)/J", rate)]).is_empty());
        let road = "road_mm";
        let driven = |spring: &str| slots_driven(road, Place::Connection, &[("q2", "w2", "m"), ("w2", spring, "m/s")]);
        assert!(driven("(n*(0.001*u - q2) - k*q2 - c*w2)/J").is_empty());
        let tyre = driven("(k*(0.001*u - q2) - c*w2)/J");
        assert_eq!(tyre, [["q2 - 0.001*u", "w2 - 0.001*d(u)", "k", "-w2"].map(str::to_owned)]);
        // What is known of the input's travel is a number, a constant or a parameter that is fixed.
        let pushed = |scale: &str| {
            let spring = format!("(k*(u*{scale} - q2) - c*w2)/J");
            slots_driven("rod_deg", Place::Connection, &[("q2", "w2", "rad"), ("w2", &spring, "rad/s")])
        };
        let rod = |scale: &str| [format!("q2 - {scale}*u"), format!("w2 - {scale}*d(u)"), "k".into(), "-w2".into()];
        assert_eq!(pushed("pi/180"), [rod("pi/180")]);
        assert_eq!(pushed("n"), [rod("n")]);
        assert!(pushed("c").is_empty());
    }
}
