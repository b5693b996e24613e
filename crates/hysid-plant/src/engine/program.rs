//! Programs: the part of the graph that some roots need, in order of evaluation, over one file of registers.
//!
//! A node's register has the node's number. Leaves are set before a program runs.

use super::graph::{Node, NodeId};
use super::memory::{Cell, Moment};
use crate::expr::Function;
use crate::number::Number;

#[derive(Debug, Clone, Copy)]
enum Op {
    Add(u32, u32),
    Sub(u32, u32),
    Mul(u32, u32),
    Div(u32, u32),
    Neg(u32),
    Square(u32),
    PowI(u32, i32),
    Pow(u32, u32),
    Call(Function, u32),
    Abs(u32),
    Atan2(u32, u32),
    Min(u32, u32),
    Max(u32, u32),
    Play(u32, u32, u32),
    Relay(u32, u32, u32, u32),
    Lag(u32, u32, u32),
    Delay(u32, u32, u32),
}

/// Operations in order, each with the register that it writes.
#[derive(Debug, Clone, Default)]
pub(super) struct Program {
    ops: Vec<(u32, Op)>,
}

fn op(node: Node) -> Option<Op> {
    Some(match node {
        Node::Constant(_)
        | Node::Time
        | Node::Input(_)
        | Node::InputRate(_)
        | Node::Parameter(_)
        | Node::State(_)
        | Node::Sigma(_) => return None,
        Node::Add(a, b) => Op::Add(a, b),
        Node::Sub(a, b) => Op::Sub(a, b),
        Node::Mul(a, b) => Op::Mul(a, b),
        Node::Div(a, b) => Op::Div(a, b),
        Node::Neg(a) => Op::Neg(a),
        Node::PowI(a, 2) => Op::Square(a),
        Node::PowI(a, n) => Op::PowI(a, n),
        Node::Pow(a, b) => Op::Pow(a, b),
        Node::Call(Function::Abs, a) => Op::Abs(a),
        Node::Call(f, a) => Op::Call(f, a),
        Node::Atan2(a, b) => Op::Atan2(a, b),
        Node::Min(a, b) => Op::Min(a, b),
        Node::Max(a, b) => Op::Max(a, b),
        Node::Play(a, b, cell) => Op::Play(a, b, cell),
        Node::Relay(a, b, c, cell) => Op::Relay(a, b, c, cell),
        Node::Lag(a, b, cell) => Op::Lag(a, b, cell),
        Node::Delay(a, b, cell) => Op::Delay(a, b, cell),
    })
}

impl Program {
    /// What the roots need, except the nodes that `done` says are there already.
    pub fn new(nodes: &[Node], roots: impl IntoIterator<Item = NodeId>, done: impl Fn(NodeId) -> bool) -> Self {
        let mut needed = vec![false; nodes.len()];
        let mut open: Vec<NodeId> = roots.into_iter().collect();
        while let Some(id) = open.pop() {
            let Some(flag) = needed.get_mut(id as usize) else { continue };
            if *flag || done(id) {
                continue;
            }
            *flag = true;
            if let Some(node) = nodes.get(id as usize) {
                open.extend(node.operands().into_iter().flatten());
            }
        }
        let chosen = nodes.iter().zip(needed).enumerate().filter(|(_, (_, needed))| *needed);
        Self { ops: chosen.filter_map(|(id, (node, _))| Some((id as u32, op(*node)?))).collect() }
    }

    /// Runs over the registers; `cells` are the operators' memories as of `moment`.
    #[inline(always)]
    pub fn run<N: Number>(&self, registers: &mut [N], cells: &mut [Cell<N>], moment: &Moment<N>) {
        for &(to, op) in &self.ops {
            let r = |i: u32| registers[i as usize];
            let y = match op {
                Op::Add(a, b) => r(a).add(r(b)),
                Op::Sub(a, b) => r(a).sub(r(b)),
                Op::Mul(a, b) => r(a).mul(r(b)),
                Op::Div(a, b) => r(a).div(r(b)),
                Op::Neg(a) => r(a).neg(),
                Op::Square(a) => r(a).mul(r(a)),
                Op::PowI(a, n) => r(a).powi(n),
                Op::Pow(a, b) => r(a).pow(r(b)),
                Op::Call(f, a) => r(a).call(f),
                Op::Abs(a) => r(a).call(Function::Abs),
                Op::Atan2(a, b) => r(a).atan2(r(b)),
                Op::Min(a, b) => r(a).min(r(b)),
                Op::Max(a, b) => r(a).max(r(b)),
                Op::Play(w, half_width, cell) => cells[cell as usize].play(r(w), r(half_width)),
                Op::Relay(w, lower, upper, cell) => cells[cell as usize].relay(r(w), r(lower), r(upper)),
                Op::Lag(w, tau, cell) => cells[cell as usize].lag(r(w), r(tau), moment),
                Op::Delay(w, seconds, cell) => cells[cell as usize].delay(r(w), r(seconds), moment),
            };
            registers[to as usize] = y;
        }
    }
}
