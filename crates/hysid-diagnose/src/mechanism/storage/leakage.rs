//! A store that loses what it holds.

use crate::mechanism::{Amplitudes, Block, Family, Form, Grid, Law, Mechanism, Need, Purpose};
use crate::slot::Place;

/// A store that loses what it holds.
pub static LEAKAGE: Mechanism = Mechanism {
    id: "leakage",
    family: Family::Storage,
    block: Block::Damping,
    places: &[Place::Store],
    applies: |slot| !(slot.has("k") && slot.shows_root("s")) || slot.feeds_another(),
    already: &[],
    law: |slot, purpose| {
        // A loss in proportion would be a change of a parameter where the baseline has one, and one through an opening where what leaves through one is lost.
        let opening = (slot.has("k") || slot.feeds_another()) && !slot.is_electrical();
        let both = !slot.has("k") && !slot.is_electrical();
        // Torricelli's law; the reference level keeps the unit of the amplitude that of a flow.
        let part = |opening: bool, name: &str| {
            let level = if opening { "sqrt(max(s, 0)/s_r)" } else { "s/s_r" };
            format!("{name}*{level}")
        };
        let parts = match purpose {
            // A free area may take up all that an opening loses, and nothing that is lost in proportion.
            Purpose::Screening if both => vec![(opening, "q_l"), (!opening, "q_o")],
            Purpose::Form(Form::Other) if both => vec![(!opening, "q_o")],
            _ => vec![(opening, "q_l")],
        };
        let sum: Vec<String> = parts.iter().map(|(opening, name)| part(*opening, name)).collect();
        let law = Law::outflow(sum.join(" + ")).with_amplitudes(Amplitudes::Apart);
        let law = parts.iter().fold(law, |law, (_, name)| law.amplitude(*name, "F", 0.0, 2.0));
        law.constant("s_r", "s", Grid::Reach("s", vec![1.0]))
    },
    contains: &[],
    confusable: &["overflow", "input_offset"],
    needs: &[Need::Levels("s", 1.2)],
    sentence: "The store {place} leaks[ {q_l} at {s_r}][ {q_o} at {s_r}]; the simulation keeps what it has.",
    signature: "It drains faster than the simulation, more so when full.",
    reference: "M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noël, Cascaded tanks benchmark combining soft and hard nonlinearities, Workshop on Nonlinear System Identification Benchmarks (2016)",
};

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::slot::Structure;

    #[test]
    fn a_tank_that_feeds_another_leaks_through_an_opening_and_the_last_one_in_proportion() {
        let text = "[time]\ncolumn = \"t_s\"\n[inputs]\nu = \"pump_V\"\n[parameters]\na = { value = 0.1, min = 0.01, max = 1.0 }\n\
                    [states]\nh1 = { derivative = \"u - a*sqrt(max(h1, 0))\", initial = \"free\", unit = \"cm\" }\n\
                    h2 = { derivative = \"a*sqrt(max(h1, 0)) - a*sqrt(max(h2, 0))\", initial = \"free\", unit = \"cm\" }\n\
                    [outputs]\nh2_cm = \"h2\"\n";
        let structure = Structure::of(&Simulation::parse(text, "tanks").unwrap());
        let slots = LEAKAGE.slots(&structure);
        let law = |label: &str, purpose| {
            let slot = slots.iter().find(|s| s.label == label).unwrap();
            format!("{:?}", LEAKAGE.law_at(slot, purpose).change)
        };
        for (label, first) in [("state:h1", true), ("state:h2", false)] {
            assert_eq!(law(label, Purpose::Refit).contains("sqrt"), first, "{label}");
            assert_eq!(law(label, Purpose::Form(Form::Other)).contains("sqrt"), !first, "{label}");
            // Both are looked for, and that which explains more is fitted first.
            assert!(
                law(label, Purpose::Screening).contains("sqrt") && law(label, Purpose::Screening).contains("s/s_r")
            );
            let slot = slots.iter().find(|s| s.label == label).unwrap();
            let fitted = |name: &str| LEAKAGE.fitted_first(slot, &[(name.to_owned(), 1.0)], &[]);
            assert_eq!(["q_l", "q_o"].map(fitted), [Purpose::Refit, Purpose::Form(Form::Other)]);
        }
    }

    #[test]
    fn a_charge_leaks_in_proportion() {
        let text = "[time]\ncolumn = \"t_s\"\n[inputs]\nu = \"src_V\"\n[parameters]\nR = { value = 10.0, fixed = true, unit = \"kOhm\" }\n\
                    C = { value = 8.0, min = 1.0, unit = \"uF\" }\n[states]\nv = { derivative = \"1000*(u - v)/(R*C)\", initial = 0.0, unit = \"V\" }\n\
                    [outputs]\nend_mV = \"1000*v\"\n";
        let structure = Structure::of(&Simulation::parse(text, "ladder").unwrap());
        let slots = LEAKAGE.slots(&structure);
        assert_eq!(slots.len(), 1);
        for purpose in [Purpose::Screening, Purpose::Refit, Purpose::Form(Form::Other)] {
            assert!(!format!("{:?}", LEAKAGE.law_at(&slots[0], purpose).change).contains("sqrt"), "{purpose:?}");
        }
    }
}
