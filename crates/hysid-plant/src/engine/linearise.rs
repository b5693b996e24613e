//! The linear model beside one operating point, by forward differentiation of the equations.

use super::Compiled;
use super::drive::Drive;
use super::machine::Machine;
use super::run::{Direction, Injection, Run, Slot, Start};
use crate::number::Lanes;

/// `dx/dt = A x + B u`, `y = C x + D u` beside an operating point; matrices by rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Linearisation {
    /// State by state.
    pub a: Vec<f64>,
    /// State by input.
    pub b: Vec<f64>,
    /// Output by state.
    pub c: Vec<f64>,
    /// Output by input.
    pub d: Vec<f64>,
    /// State derivatives at the point.
    pub flow: Vec<f64>,
    /// Outputs at the point.
    pub outputs: Vec<f64>,
}

impl Compiled {
    /// The linear model beside states `x` and inputs `u`; operators with memory count as they do at rest, signs as constants.
    pub fn linearise(&self, theta: &[f64], x: &[f64], u: &[f64]) -> Linearisation {
        const CHUNK: usize = 8;
        let (n_inputs, n, n_outputs) = self.sizes();
        let zero = |len: usize| vec![0.0; len];
        let mut out = Linearisation {
            a: zero(n * n),
            b: zero(n * n_inputs),
            c: zero(n_outputs * n),
            d: zero(n_outputs * n_inputs),
            flow: zero(n),
            outputs: zero(n_outputs),
        };
        let inputs = u.iter().map(|u| vec![*u]).collect();
        let Ok(drive) = Drive::new(0.0, 1.0, 1, inputs) else { return out };
        let one = [1.0];
        let mut directions: Vec<Direction<'_>> = (0..n).map(Direction::Initial).collect();
        let inject = |i| Direction::Injection(Injection { slot: Slot::Input(i), series: &one });
        directions.extend((0..n_inputs).map(inject));
        if directions.is_empty() {
            return out;
        }
        let run = Run::new(&drive, theta).from(Start::States(x));
        for (chunk, directions) in directions.chunks(CHUNK).enumerate() {
            let machine = Machine::<Lanes<1, CHUNK>>::new(self, std::slice::from_ref(&run), directions);
            let Some((flow, outputs)) = machine.map(Machine::beside) else { continue };
            for (k, column) in (chunk * CHUNK..).take(directions.len()).enumerate() {
                let (to_flow, to_outputs, width, column) = if column < n {
                    (&mut out.a, &mut out.c, n, column)
                } else {
                    (&mut out.b, &mut out.d, n_inputs, column - n)
                };
                for (i, (value, tangents)) in flow.iter().enumerate() {
                    to_flow[i * width + column] = tangents[k];
                    out.flow[i] = *value;
                }
                for (j, (value, tangents)) in outputs.iter().enumerate() {
                    to_outputs[j * width + column] = tangents[k];
                    out.outputs[j] = *value;
                }
            }
        }
        out
    }
}
