//! Programs: the part of the graph that some roots need, in order of evaluation, over one file of registers.
//!
//! A node's register has the node's number. Leaves are set before a program runs. A sum whose parts nobody else uses
//! (`u - c*v - k*x`) is one operation that keeps its partial sums out of the registers; the order of rounding stays.

use super::graph::{Node, NodeId};
use super::memory::{Cell, Moment};
use crate::expr::Function;
use crate::number::{Number, Span};

#[derive(Debug, Clone, Copy)]
enum Op {
    Add(u32, u32),
    Sub(u32, u32),
    Mul(u32, u32),
    Div(u32, u32),
    Neg(u32),
    Square(u32),
    Cube(u32),
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
    /// The terms from a number on, so many of them.
    Sum(u32, u32),
}

/// A term of a sum: a register or a product of two, added or subtracted.
#[derive(Debug, Clone, Copy)]
enum Term {
    Plus(u32),
    Minus(u32),
    PlusProduct(u32, u32),
    MinusProduct(u32, u32),
}

/// Operations in order, each with the register that it writes.
#[derive(Debug, Clone, Default)]
pub(super) struct Program {
    ops: Vec<(u32, Op)>,
    terms: Vec<Term>,
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
        Node::PowI(a, 3) => Op::Cube(a),
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
        let roots: Vec<NodeId> = roots.into_iter().collect();
        let mut needed = vec![false; nodes.len()];
        let mut uses = vec![0_u32; nodes.len()];
        let mut open = roots.clone();
        while let Some(id) = open.pop() {
            let Some(flag) = needed.get_mut(id as usize) else { continue };
            if *flag || done(id) {
                continue;
            }
            *flag = true;
            for operand in nodes.get(id as usize).into_iter().flat_map(|n| n.operands()).flatten() {
                if let Some(count) = uses.get_mut(operand as usize) {
                    *count += 1;
                }
                open.push(operand);
            }
        }
        for root in roots {
            if let Some(count) = uses.get_mut(root as usize) {
                *count += 2;
            }
        }
        let mut program = Self::default();
        let mut absorbed = vec![false; nodes.len()];
        // From the last node back, so that a sum is seen before its parts.
        for (id, node) in nodes.iter().enumerate().rev() {
            if !needed[id] || absorbed[id] {
                continue;
            }
            let lone = |id: NodeId| needed[id as usize] && uses[id as usize] == 1;
            let sum = program.sum(nodes, *node, lone, &mut absorbed);
            program.ops.extend(sum.or_else(|| op(*node)).map(|op| (id as u32, op)));
        }
        program.ops.reverse();
        program
    }

    /// A sum with the parts that are used only here drawn in; none where there is nothing to draw in.
    fn sum(&mut self, nodes: &[Node], node: Node, lone: impl Fn(NodeId) -> bool, absorbed: &mut [bool]) -> Option<Op> {
        let mut reversed = Vec::new();
        let mut drawn = 0;
        let mut term = |id: NodeId, plus: bool, absorbed: &mut [bool]| match nodes.get(id as usize) {
            Some(Node::Mul(a, b)) if lone(id) => {
                absorbed[id as usize] = true;
                drawn += 1;
                if plus { Term::PlusProduct(*a, *b) } else { Term::MinusProduct(*a, *b) }
            }
            _ if plus => Term::Plus(id),
            _ => Term::Minus(id),
        };
        let (mut left, right, plus) = match node {
            Node::Add(a, b) => (a, b, true),
            Node::Sub(a, b) => (a, b, false),
            _ => return None,
        };
        reversed.push(term(right, plus, absorbed));
        let mut chained = 0;
        while lone(left) {
            let (next, right, plus) = match nodes.get(left as usize) {
                Some(Node::Add(a, b)) => (*a, *b, true),
                Some(Node::Sub(a, b)) => (*a, *b, false),
                _ => break,
            };
            absorbed[left as usize] = true;
            chained += 1;
            reversed.push(term(right, plus, absorbed));
            left = next;
        }
        reversed.push(term(left, true, absorbed));
        if drawn + chained == 0 {
            return None;
        }
        let from = self.terms.len() as u32;
        self.terms.extend(reversed.into_iter().rev());
        Some(Op::Sum(from, self.terms.len() as u32 - from))
    }

    /// Whether there is nothing to do.
    pub fn is_empty(&self) -> bool {
        self.ops.is_empty()
    }

    /// Runs over the registers; `cells` are the operators' memories as of `moment`.
    #[inline(never)]
    pub fn run<N: Number, S: Span<N>>(&self, registers: &mut [N], cells: &mut [Cell<N>], moment: &Moment<S>) {
        self.run_here(registers, cells, moment);
    }

    /// As [`Program::run`], compiled into the caller for its instruction set.
    #[inline(always)]
    pub fn run_here<N: Number, S: Span<N>>(&self, registers: &mut [N], cells: &mut [Cell<N>], moment: &Moment<S>) {
        // The result is stored in each arm: behind the `match` it would go through memory twice.
        macro_rules! r {
            ($i:expr) => {
                registers[$i as usize]
            };
        }
        for &(to, op) in &self.ops {
            match op {
                Op::Add(a, b) => r!(to) = r!(a).add(r!(b)),
                Op::Sub(a, b) => r!(to) = r!(a).sub(r!(b)),
                Op::Mul(a, b) => r!(to) = r!(a).mul(r!(b)),
                Op::Div(a, b) => r!(to) = r!(a).div(r!(b)),
                Op::Neg(a) => r!(to) = r!(a).neg(),
                Op::Square(a) => r!(to) = r!(a).mul(r!(a)),
                Op::Cube(a) => r!(to) = r!(a).mul(r!(a).mul(r!(a))),
                Op::PowI(a, n) => r!(to) = r!(a).powi(n),
                Op::Pow(a, b) => r!(to) = r!(a).pow(r!(b)),
                Op::Call(f, a) => r!(to) = r!(a).call(f),
                Op::Abs(a) => r!(to) = r!(a).abs(),
                Op::Atan2(a, b) => r!(to) = r!(a).atan2(r!(b)),
                Op::Min(a, b) => r!(to) = r!(a).min(r!(b)),
                Op::Max(a, b) => r!(to) = r!(a).max(r!(b)),
                Op::Sum(from, count) => {
                    let (from, count) = (from as usize, count as usize);
                    let mut terms = self.terms[from..from + count].iter();
                    // The first is taken as it is: adding it to 0 would lose the sign of a zero.
                    let mut sum = match terms.next() {
                        Some(&(Term::PlusProduct(a, b) | Term::MinusProduct(a, b))) => r!(a).mul(r!(b)),
                        Some(&(Term::Plus(a) | Term::Minus(a))) => r!(a),
                        None => N::lift(0.0),
                    };
                    for term in terms {
                        match *term {
                            Term::Plus(a) => sum = sum.add(r!(a)),
                            Term::Minus(a) => sum = sum.sub(r!(a)),
                            Term::PlusProduct(a, b) => sum = sum.add(r!(a).mul(r!(b))),
                            Term::MinusProduct(a, b) => sum = sum.sub(r!(a).mul(r!(b))),
                        }
                    }
                    r!(to) = sum;
                }
                Op::Play(w, half_width, cell) => r!(to) = cells[cell as usize].play(r!(w), r!(half_width)),
                Op::Relay(w, lower, upper, cell) => {
                    r!(to) = cells[cell as usize].relay(r!(w), r!(lower), r!(upper));
                }
                Op::Lag(w, tau, cell) => r!(to) = cells[cell as usize].lag(r!(w), r!(tau), moment),
                Op::Delay(w, seconds, cell) => r!(to) = cells[cell as usize].delay(r!(w), r!(seconds), moment),
            }
        }
    }
}
