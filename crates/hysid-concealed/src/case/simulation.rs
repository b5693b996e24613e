//! The simulation file that a case comes with: what the user knows of the plant.

use crate::body::Kind;
use crate::design::Design;
use crate::input::Hold;

/// The simulation file: what the user knows. Parameters stand at `declared`, dry friction is `sign` or (with a speed) `tanh`, the initial
/// state is known to be zero or `"free"`.
pub fn simulation(design: &Design, declared: &[f64], regularised: Option<f64>, initial: &str) -> String {
    let kind = design.kind;
    let mut text = String::from("title = \"Simulation to be judged\"\n\n[time]\ncolumn = \"t_s\"\n");
    if design.hold == Hold::Zero && !kind.prescribed() {
        text.push_str("hold = \"zero\"\n");
    }
    text.push_str("\n[inputs]\n");
    for (symbol, column) in kind.inputs() {
        text.push_str(&format!("{symbol} = \"{column}\"\n"));
    }
    text.push_str("\n[parameters]\n");
    for ((name, unit), value) in kind.parameters().iter().zip(kind.units()).zip(declared) {
        let (low, high) = match (kind, *name) {
            (Kind::Wing, "a_0") => (-6.0, 4.0),
            (Kind::Specimen, "F0") => {
                let size = design.theta[1] * design.level;
                (-2.0 * size, 2.0 * size)
            }
            _ => (value * 0.1, value * 10.0),
        };
        text.push_str(&format!(
            "{name} = {{ value = {value:.6e}, min = {low:.4e}, max = {high:.4e}, unit = \"{unit}\" }}\n"
        ));
    }
    let speed = if matches!(kind, Kind::Drive | Kind::ClosedDrive | Kind::Pendulum) { "w" } else { "v" };
    let friction = regularised.map_or_else(|| format!("sign({speed})"), |v| format!("tanh({speed}/{v:.6e})"));
    let states = kind.states(&friction);
    if !states.is_empty() {
        text.push_str("\n[states]\n");
        for (symbol, derivative) in states {
            text.push_str(&format!("{symbol} = {{ derivative = \"{derivative}\", initial = {initial} }}\n"));
        }
    }
    text.push_str("\n[outputs]\n");
    for (column, expression) in kind.outputs().iter().zip(kind.output_expressions()).take(design.channels) {
        text.push_str(&format!("{column} = \"{expression}\"\n"));
    }
    text
}
