//! Expressions along a fitted trajectory.

use hysid_plant::{Compiled, Expr, Output, Simulation};

use super::base::Base;

/// The expression with nothing of an input added: a document refuses outputs that nothing moves.
fn moving(e: &Expr, input: Option<&str>) -> Expr {
    match input {
        Some(u) => e.clone() + Expr::Number(0.0) * Expr::symbol(u),
        None => e.clone(),
    }
}

/// Values of expressions along a simulated trajectory: `[expression][stretch][sample]`.
pub fn along(base: &Base<'_>, expressions: &[Expr]) -> Option<Vec<Vec<Vec<f64>>>> {
    let mut probe: Simulation = base.model.simulation().clone();
    probe.outputs = expressions
        .iter()
        .enumerate()
        .map(|(i, e)| Output {
            column: format!("probe_{i}"),
            expression: moving(e, probe.inputs.first().map(|u| u.symbol.as_str())),
        })
        .collect();
    let values = base.values();
    let theta: Vec<f64> =
        probe.parameters.iter().map(|p| values.parameters.get(&p.name).copied().unwrap_or(p.value)).collect();
    let compiled = Compiled::new(&probe).ok()?;
    let mut out = vec![Vec::new(); expressions.len()];
    for s in 0..base.model.data().stretches.len() {
        let start = base.model.start_of(s, &base.fit.theta);
        let response = compiled.simulate(&base.model.run_of(s, &theta, &start));
        for (series, o) in response.outputs.into_iter().zip(&mut out) {
            o.push(series);
        }
    }
    Some(out)
}
