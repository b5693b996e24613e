//! Load cells: outputs that measure what holds a part, or what connects it to another. An effect that acts there is in them too, or beside them: what a
//! bearing of the machine rubs with is not in what a cell under the spring feels.

use hysid_plant::{Expr, Output, Unit};

use super::balance::is_power_of_ten;
use super::find::{Finder, presses};
use super::motion::Motion;
use super::sensed::{Felt, Sensed, multiple, peeled, shares};
use super::{Place, Slot, Target};

impl Finder<'_> {
    /// The force slots once more whose forces a load cell measures, as those that it feels.
    pub(super) fn in_load_cells(&self, slots: &[Slot]) -> Vec<Slot> {
        slots.iter().filter_map(|slot| self.in_load_cell(slot)).collect()
    }

    /// What a connection pulls at a part with where its deflection is a state of its own, but for what goes by the rate of that.
    fn force_of_deflection(&self, slot: &Slot, motion: &Motion<'_>) -> Option<Expr> {
        let symbols = slot.quantity("x")?.expression.symbols();
        let mut states = symbols.iter().filter(|s| self.simulation.state(s).is_some());
        let (deflection, None) = (states.next()?, states.next()) else { return None };
        let counts = |term: &Expr| !self.moves(deflection) && term.uses(deflection);
        self.sum_of_forces(motion, &counts)
    }

    /// All that pulls at a part by the deflection of a connection and its rate, as across what is led at its other end.
    fn force_across(&self, slot: &Slot, motion: &Motion<'_>) -> Option<Expr> {
        let across = ["x", "v"].map(|n| slot.quantity(n)).into_iter().flatten();
        let symbols: Vec<String> = across.flat_map(|q| q.expression.symbols()).collect();
        let states = || symbols.iter().filter(|s| self.simulation.state(s).is_some());
        self.sum_of_forces(motion, &|term| states().any(|s| term.uses(s)))
    }

    fn in_load_cell(&self, slot: &Slot) -> Option<Slot> {
        let simulation = self.original;
        let connects = match slot.place {
            Place::Force => false,
            Place::Connection => true,
            _ => return None,
        };
        let Target::Derivatives(pulls) = &slot.target else { return None };
        // What a gear passes on is measured before it or behind it.
        let ends = pulls.iter().filter_map(|pull| self.motions.iter().find(|m| m.state == pull.state));
        let held: Vec<(&str, f64, Expr)> = ends
            .flat_map(|motion| {
                let mut held: Vec<Expr> = self.forces_on(motion, connects).into_iter().collect();
                if connects {
                    held.extend(self.force_of_deflection(slot, motion));
                    held.extend(self.force_across(slot, motion));
                }
                held.into_iter().map(|held| peeled(&held)).map(|(scale, held)| (motion.state, scale, held))
            })
            .collect();
        let cell = |output: &Output| {
            let (factor, inner) = peeled(&output.expression);
            let is_force = Unit::of_column(&output.column).is_none_or(|u| presses(&u));
            if !is_force || slot.sensed.iter().any(|s| s.column == output.column) {
                return None;
            }
            held.iter().filter(|(_, _, held)| shares(simulation, &inner, held)).find_map(|(state, scale, held)| {
                let times = factor / scale * multiple(simulation, &inner, held, true)?;
                let (state, column) = ((*state).to_owned(), output.column.clone());
                is_power_of_ten(times, 1.0).then_some(Sensed { felt: Felt::Force, state, column, times })
            })
        };
        let cells: Vec<Sensed> = simulation.outputs.iter().filter_map(cell).collect();
        let columns: Vec<&str> = cells.iter().map(|c| c.column.as_str()).collect();
        let whereabouts = format!("{} (felt by {})", slot.whereabouts, columns.join(" and "));
        (!cells.is_empty()).then(|| Slot {
            whereabouts,
            sensed: slot.sensed.iter().cloned().chain(cells).collect(),
            ..slot.clone()
        })
    }
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use crate::mechanism::conformance::example_signals;
    use crate::mechanism::{Purpose, mechanism};
    use crate::slot::{Place, Slot, Structure};

    fn caliper(cell: &str) -> Simulation {
        let text = format!(
            "[time]\nperiod_s = 0.01\n[inputs]\np = \"line_bar\"\n[parameters]\nk = {{ value = 25.0, min = 1.0, unit = \"kN/mm\" }}\n\
             c = {{ value = 0.1, min = 0.01, unit = \"kN s/mm\" }}\nm = {{ value = 200.0, min = 10.0, unit = \"kg\" }}\n\
             [states]\nx = {{ derivative = \"v\", initial = 0.0, unit = \"mm\" }}\nv = {{ derivative = \"(0.23*p - c*v - k*x)/(m/1000000)\", initial = 0.0, unit = \"mm/s\" }}\n\
             [outputs]\npad_kN = \"{cell}\"\npiston_mm = \"x\"\n"
        );
        Simulation::parse(&text, "caliper.sim.toml").unwrap()
    }

    /// The slots of a curved spring, each with what the output of this number is with the spring there.
    fn sprung(simulation: &Simulation, output: usize) -> Vec<(Slot, String)> {
        let spring = mechanism("quadratic_stiffness").unwrap();
        let written = |slot: Slot| {
            let signals = example_signals(simulation, &slot);
            let written = spring.rewrite(simulation, &slot, &signals, Purpose::Refit).unwrap().simulation;
            let read = written.outputs[output].expression.to_string();
            (slot, read)
        };
        spring.slots(&Structure::of(simulation)).into_iter().map(written).collect()
    }

    #[test]
    fn what_a_cable_pulls_with_is_measured_where_it_is_all_that_its_stretch_does() {
        let text = "[time]\nperiod_s = 0.01\n[inputs]\nu = \"drum_m_s\"\n[parameters]\nk = { value = 25.0, min = 1.0, unit = \"N/m\" }\n\
            c = { value = 0.1, min = 0.01, unit = \"N s/m\" }\nm = { value = 2.0, min = 0.1, unit = \"kg\" }\n\
            [states]\ne = { derivative = \"u - v\", initial = 0.0, unit = \"m\" }\nv = { derivative = \"(k*e + c*(u - v))/m\", initial = 0.0, unit = \"m/s\" }\n\
            [outputs]\nload_m_s2 = \"(k*e + c*(u - v))/m\"\ncable_N = \"k*e\"\n";
        let simulation = Simulation::parse(text, "hoist.sim.toml").unwrap();
        let found = sprung(&simulation, 1);
        assert!(found.iter().any(|(_, read)| read == "k*e - k_2*(-e)^2"), "{found:?}");
    }

    #[test]
    fn what_stands_on_a_table_is_held_by_what_the_cell_under_it_measures() {
        let text = "[time]\nperiod_s = 0.01\n[inputs]\nz = \"table_mm\"\n[parameters]\nk = { value = 25.0, min = 1.0, unit = \"N/m\" }\n\
            c = { value = 0.1, min = 0.01, unit = \"N s/m\" }\nm = { value = 2.0, min = 0.1, unit = \"kg\" }\n\
            [states]\nr = { derivative = \"w - 0.001*d(z)\", initial = 0.0, unit = \"m\" }\nw = { derivative = \"-(k*r + c*(w - 0.001*d(z)))/m\", initial = 0.0, unit = \"m/s\" }\n\
            [outputs]\ncell_kN = \"(k*r + c*(w - 0.001*d(z)))/1000\"\ncar_m_s2 = \"-(k*r + c*(w - 0.001*d(z)))/m\"\n";
        let simulation = Simulation::parse(text, "rig.sim.toml").unwrap();
        let felt = |slot: &Slot| slot.place == Place::Connection && slot.sensed.len() > 1;
        let (_, read) = sprung(&simulation, 0).into_iter().find(|(slot, _)| felt(slot)).unwrap();
        assert!(read.starts_with("(k*r + c*(w - 0.001*d(z)))/1000 + 0.001*(k_2*"), "{read}");
    }

    #[test]
    fn the_torque_behind_a_gear_is_that_of_its_shaft() {
        let text = "[time]\nperiod_s = 0.01\n[inputs]\nu = \"motor_Nm\"\n[parameters]\nk = { value = 25.0, min = 1.0, unit = \"N m/rad\" }\n\
            c = { value = 0.1, min = 0.01, unit = \"N m s/rad\" }\nn = { value = 80.0, fixed = true }\nJ = { value = 2.0, min = 0.1, unit = \"kg m^2\" }\n\
            [states]\nq1 = { derivative = \"w1\", initial = 0.0, unit = \"rad\" }\nw1 = { derivative = \"(u - (k*(q1/n - q2) + c*(w1/n - w2))/n)/J\", initial = 0.0, unit = \"rad/s\" }\n\
            q2 = { derivative = \"w2\", initial = 0.0, unit = \"rad\" }\nw2 = { derivative = \"(k*(q1/n - q2) + c*(w1/n - w2))/J\", initial = 0.0, unit = \"rad/s\" }\n\
            [outputs]\nq2_rad = \"q2\"\nshaft_Nm = \"k*(q1/n - q2) + c*(w1/n - w2)\"\n";
        let simulation = Simulation::parse(text, "joint.sim.toml").unwrap();
        let felt = |slot: &Slot| slot.place == Place::Connection && !slot.sensed.is_empty();
        let (_, read) = sprung(&simulation, 1).into_iter().find(|(slot, _)| felt(slot)).unwrap();
        assert!(read.ends_with(" + k_2*(1/n*q1 - q2)^2"), "{read}");
    }

    #[test]
    fn what_a_load_cell_feels_is_written_into_it() {
        let written = |cell: &str| sprung(&caliper(cell), 0).into_iter().map(|(_, read)| read).collect::<Vec<_>>();
        assert_eq!(written("k*x + c*v"), ["k*x + c*v", "k*x + c*v + k_2*x^2"]);
        assert_eq!(written("-1000*(k*x + c*v)"), ["-1000*(k*x + c*v)", "-1000*(k*x + c*v) - 1000*(k_2*x^2)"]);
        // What measures a part of that is no load cell.
        assert_eq!(written("k*x").len(), 1);
    }
}
