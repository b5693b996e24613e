//! What several sensors see of one moving part: a structure that bends in a further shape shows it to each of them.

use hysid_plant::Output;

use super::find::Finder;
use super::motion::Motion;
use super::{Place, Rate, Seen, Sensed, Slot, Target};

impl Finder<'_> {
    /// The sensors of the only part that moves, where they are several or measure its acceleration: what one that measures the displacement sees is told by
    /// itself.
    pub(super) fn sensors_together(&self, accelerations: &[Sensed]) -> Option<Slot> {
        let ([motion], [_]) = (&self.motions[..], &self.simulation.inputs[..]) else { return None };
        let accelerates = |o: &Output| accelerations.iter().any(|s| s.column == o.column && s.state == motion.state);
        let outputs = self.simulation.outputs.iter();
        let seen: Vec<Seen> = outputs
            .filter_map(|o| {
                let rate = if accelerates(o) { Rate::Acceleration } else { self.rate(motion, o)? };
                Some(Seen { column: o.column.clone(), rate })
            })
            .collect();
        if seen.len() < 2 && seen.iter().all(|s| s.rate != Rate::Acceleration) {
            return None;
        }
        let outputs = seen.iter().filter_map(|s| self.simulation.output(&s.column)).cloned().collect::<Vec<_>>();
        let (label, words) = (format!("state:{}", motion.state), format!("in what is measured of {}", motion.name()));
        let mut slot = Slot::new(Place::Sensors, label, words, Target::Outputs(seen));
        for (i, output) in (1..).zip(&outputs) {
            let symbol = format!("y_{i}");
            slot.offer(self.simulation, &symbol, output.expression.clone());
            self.name_unit(&mut slot, &symbol, &output.column);
        }
        Some(slot)
    }

    /// What an output measures of a motion; `None` where it is of neither the displacement nor the velocity alone.
    fn rate(&self, motion: &Motion<'_>, output: &Output) -> Option<Rate> {
        let own = self.original.output(&output.column)?;
        let used = |name: &str| own.expression.uses(name);
        match (motion.x.is_some_and(used), used(motion.v)) {
            (true, false) => Some(Rate::Displacement),
            (false, true) => Some(Rate::Velocity),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::super::Structure;
    use super::*;

    #[test]
    fn sensors_of_one_part_see_its_further_shapes_together() {
        let seen = |outputs: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nu = \"force_N\"\n[parameters]\nm = {{ value = 2.0, min = 0.1 }}\nk = {{ value = 50.0, min = 1.0 }}\n\
                 [states]\nx = {{ derivative = \"v\", initial = 0.0, unit = \"m\" }}\nv = {{ derivative = \"(u - k*x - 2*v)/m\", initial = 0.0, unit = \"m/s\" }}\n[outputs]\n{outputs}"
            );
            let simulation = Simulation::parse(&text, "tower.sim.toml").unwrap();
            let slot = Structure::of(&simulation).slots.into_iter().find(|s| s.place == Place::Sensors)?;
            let Target::Outputs(seen) = slot.target else { return None };
            Some(seen.into_iter().map(|s| (s.column, s.rate)).collect::<Vec<_>>())
        };
        let acc = "acc_m_s2 = \"(u - k*x - 2*v)/m\"\n";
        let one = |column: &str, rate| (column.to_owned(), rate);
        assert_eq!(seen(acc), Some(vec![one("acc_m_s2", Rate::Acceleration)]));
        assert_eq!(
            seen(&format!("{acc}top_mm = \"1000*x\"\nv_m_s = \"v\"\nforce = \"k*x + 2*v\"\n")),
            Some(vec![
                one("acc_m_s2", Rate::Acceleration),
                one("top_mm", Rate::Displacement),
                one("v_m_s", Rate::Velocity)
            ])
        );
        assert_eq!(seen("top_mm = \"1000*x\"\n"), None);
    }
}
