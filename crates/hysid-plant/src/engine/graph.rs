//! The graph of all equations: one node for each distinct subexpression (equal subexpressions are shared).
//!
//! A node's operands have smaller numbers than the node, so the order of numbers is an order of evaluation. The first nodes
//! are the states, in their order.

use std::collections::HashMap;

use super::differentiate::derivative;
use crate::document::Simulation;
use crate::expr::{BinaryOp, Expr, Function, Memory};

pub(super) type NodeId = u32;

/// One operation or leaf.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Node {
    Constant(f64),
    Time,
    Input(u32),
    /// The central difference of an input.
    InputRate(u32),
    Parameter(u32),
    State(u32),
    /// The value of the sign on a switching surface: -1, 1, or in between where it is stuck.
    Sigma(u32),
    Add(NodeId, NodeId),
    Sub(NodeId, NodeId),
    Mul(NodeId, NodeId),
    Div(NodeId, NodeId),
    Neg(NodeId),
    PowI(NodeId, i32),
    Pow(NodeId, NodeId),
    Call(Function, NodeId),
    Atan2(NodeId, NodeId),
    Min(NodeId, NodeId),
    Max(NodeId, NodeId),
    /// Operators with memory: argument, parameter, number of the memory cell.
    Play(NodeId, NodeId, u32),
    Relay(NodeId, NodeId, NodeId, u32),
    Lag(NodeId, NodeId, u32),
    Delay(NodeId, NodeId, u32),
}

impl Node {
    pub(super) fn operands(self) -> [Option<NodeId>; 3] {
        match self {
            Self::Constant(_)
            | Self::Time
            | Self::Input(_)
            | Self::InputRate(_)
            | Self::Parameter(_)
            | Self::State(_)
            | Self::Sigma(_) => [None; 3],
            Self::Neg(a) | Self::PowI(a, _) | Self::Call(_, a) => [Some(a), None, None],
            Self::Add(a, b)
            | Self::Sub(a, b)
            | Self::Mul(a, b)
            | Self::Div(a, b)
            | Self::Pow(a, b)
            | Self::Atan2(a, b)
            | Self::Min(a, b)
            | Self::Max(a, b)
            | Self::Play(a, b, _)
            | Self::Lag(a, b, _)
            | Self::Delay(a, b, _) => [Some(a), Some(b), None],
            Self::Relay(a, b, c, _) => [Some(a), Some(b), Some(c)],
        }
    }
}

/// A node as a key: literals by their bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Key(u8, u64, u32, u32, u8);

fn key(node: Node) -> Key {
    let two = |tag, a: u32, b: u32| Key(tag, 0, a, b, 0);
    match node {
        Node::Constant(x) => Key(0, x.to_bits(), 0, 0, 0),
        Node::Time => two(1, 0, 0),
        Node::Input(i) => two(2, i, 0),
        Node::InputRate(i) => two(3, i, 0),
        Node::Parameter(i) => two(4, i, 0),
        Node::State(i) => two(5, i, 0),
        Node::Sigma(i) => two(6, i, 0),
        Node::Add(a, b) => two(7, a, b),
        Node::Sub(a, b) => two(8, a, b),
        Node::Mul(a, b) => two(9, a, b),
        Node::Div(a, b) => two(10, a, b),
        Node::Neg(a) => two(11, a, 0),
        Node::PowI(a, n) => two(12, a, n as u32),
        Node::Pow(a, b) => two(13, a, b),
        Node::Call(f, a) => Key(14, 0, a, 0, f as u8),
        Node::Atan2(a, b) => two(15, a, b),
        Node::Min(a, b) => two(16, a, b),
        Node::Max(a, b) => two(17, a, b),
        // One operator on one argument has one memory: the cell's number does not make a difference.
        Node::Play(a, b, _) => two(18, a, b),
        Node::Relay(a, b, c, _) => Key(19, u64::from(c), a, b, 0),
        Node::Lag(a, b, _) => two(20, a, b),
        Node::Delay(a, b, _) => two(21, a, b),
    }
}

/// Where the value of a `sign` switches: the zero of `argument`, with the argument's derivatives.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SurfaceNodes {
    pub argument: NodeId,
    /// The state that the argument is, if it is one.
    pub state: Option<u32>,
    pub by_state: Vec<(u32, NodeId)>,
    pub by_input: Vec<(u32, NodeId)>,
    pub by_time: Option<NodeId>,
}

/// The graph under construction.
pub(super) struct Graph<'a> {
    simulation: &'a Simulation,
    pub nodes: Vec<Node>,
    known: HashMap<Key, NodeId>,
    /// Which nodes rest on parameters and numbers only.
    constant: Vec<bool>,
    /// Divisions are kept as they are written (within a `floor`, which may turn a rounding into a jump).
    exact: bool,
    /// The node that a text was built into, to keep the arguments of surfaces apart.
    surfaces: Vec<(Expr, SurfaceNodes)>,
    pub cells: u32,
}

impl<'a> Graph<'a> {
    pub fn new(simulation: &'a Simulation) -> Self {
        let mut graph = Self {
            simulation,
            nodes: Vec::new(),
            known: HashMap::new(),
            constant: Vec::new(),
            exact: false,
            surfaces: Vec::new(),
            cells: 0,
        };
        for i in 0..simulation.states.len() {
            graph.push(Node::State(i as u32));
        }
        graph
    }

    pub fn surfaces(self) -> (Vec<Node>, Vec<SurfaceNodes>, u32) {
        (self.nodes, self.surfaces.into_iter().map(|(_, s)| s).collect(), self.cells)
    }

    fn push(&mut self, node: Node) -> NodeId {
        let next = self.nodes.len() as NodeId;
        let id = *self.known.entry(key(node)).or_insert(next);
        if id == next {
            let moves = matches!(
                node,
                Node::Time
                    | Node::Input(_)
                    | Node::InputRate(_)
                    | Node::State(_)
                    | Node::Sigma(_)
                    | Node::Play(..)
                    | Node::Relay(..)
                    | Node::Lag(..)
                    | Node::Delay(..)
            );
            let constant = !moves && node.operands().into_iter().flatten().all(|o| self.is_constant(o));
            self.constant.push(constant);
            self.nodes.push(node);
        }
        id
    }

    fn is_constant(&self, id: NodeId) -> bool {
        self.constant.get(id as usize).copied().unwrap_or(false)
    }

    /// A quotient; by what rests on parameters only it is a product with the inverse, which is taken once in a run.
    fn quotient(&mut self, left: NodeId, right: NodeId) -> NodeId {
        if self.exact || !self.is_constant(right) || self.is_constant(left) {
            return self.push(Node::Div(left, right));
        }
        let one = self.push(Node::Constant(1.0));
        let inverse = self.push(Node::Div(one, right));
        self.push(Node::Mul(left, inverse))
    }

    fn cell(&mut self, make: impl Fn(u32) -> Node) -> NodeId {
        let before = self.nodes.len();
        let id = self.push(make(self.cells));
        if id as usize == before {
            self.cells += 1;
        }
        id
    }

    fn symbol(&mut self, name: &str) -> NodeId {
        let index = |position: Option<usize>| position.map(|i| i as u32);
        let s = self.simulation;
        let node = if name == "t" {
            Node::Time
        } else if name == "pi" {
            Node::Constant(std::f64::consts::PI)
        } else if let Some(i) = index(s.parameters.iter().position(|p| p.name == name)) {
            Node::Parameter(i)
        } else if let Some(i) = index(s.states.iter().position(|x| x.name == name)) {
            Node::State(i)
        } else if let Some(i) = index(s.inputs.iter().position(|u| u.symbol == name)) {
            Node::Input(i)
        } else {
            // Not reached for a validated simulation.
            Node::Constant(f64::NAN)
        };
        self.push(node)
    }

    /// The node of an expression.
    pub fn build(&mut self, expr: &Expr) -> NodeId {
        match expr {
            Expr::Number(x) => self.push(Node::Constant(*x)),
            Expr::Symbol(name) => self.symbol(name),
            Expr::Neg(a) => {
                let a = self.build(a);
                self.push(Node::Neg(a))
            }
            Expr::Binary(op, a, b) => {
                let left = self.build(a);
                if let (BinaryOp::Pow, Expr::Number(n)) = (op, &**b) {
                    if n.fract() == 0.0 && n.abs() <= 64.0 {
                        return self.push(Node::PowI(left, *n as i32));
                    }
                    if *n == 0.5 {
                        return self.push(Node::Call(Function::Sqrt, left));
                    }
                }
                let right = self.build(b);
                if *op == BinaryOp::Div {
                    return self.quotient(left, right);
                }
                self.push(match op {
                    BinaryOp::Add => Node::Add(left, right),
                    BinaryOp::Sub => Node::Sub(left, right),
                    BinaryOp::Mul => Node::Mul(left, right),
                    BinaryOp::Div => Node::Div(left, right),
                    BinaryOp::Pow => Node::Pow(left, right),
                })
            }
            Expr::Call(f @ (Function::Sign | Function::Step), arguments) => self.switch(*f, arguments),
            Expr::Call(f, arguments) => {
                let outside = self.exact;
                self.exact |= *f == Function::Floor;
                let ids: Vec<NodeId> = arguments.iter().map(|a| self.build(a)).collect();
                self.exact = outside;
                let node = match (f, ids.as_slice()) {
                    (Function::Atan2, &[a, b]) => Node::Atan2(a, b),
                    (Function::Min, &[a, b]) => Node::Min(a, b),
                    (Function::Max, &[a, b]) => Node::Max(a, b),
                    (f, &[a]) => Node::Call(*f, a),
                    _ => Node::Constant(f64::NAN), // the parser and `validate` keep arities
                };
                self.push(node)
            }
            Expr::Memory(Memory::Derivative, arguments) => self.input_rate(arguments),
            Expr::Memory(memory, arguments) => {
                let ids: Vec<NodeId> = arguments.iter().map(|a| self.build(a)).collect();
                match (memory, ids.as_slice()) {
                    (Memory::Play, &[w, r]) => self.cell(|cell| Node::Play(w, r, cell)),
                    (Memory::Lag, &[w, tau]) => self.cell(|cell| Node::Lag(w, tau, cell)),
                    (Memory::Delay, &[w, s]) => self.cell(|cell| Node::Delay(w, s, cell)),
                    (Memory::Relay, &[w, lower, upper]) => self.cell(|cell| Node::Relay(w, lower, upper, cell)),
                    _ => self.push(Node::Constant(f64::NAN)),
                }
            }
        }
    }

    /// `d(w)` by the chain rule: the sum over inputs of the derivative of w times the input's central difference.
    fn input_rate(&mut self, arguments: &[Expr]) -> NodeId {
        let mut total = None;
        let simulation = self.simulation;
        for argument in arguments {
            for (i, input) in simulation.inputs.iter().enumerate() {
                if !argument.uses(&input.symbol) {
                    continue;
                }
                let slope = derivative(argument, &input.symbol).simplified();
                let slope = self.build(&slope);
                let rate = self.push(Node::InputRate(i as u32));
                let term = if self.nodes.get(slope as usize) == Some(&Node::Constant(1.0)) {
                    rate
                } else {
                    self.push(Node::Mul(slope, rate))
                };
                total = Some(match total {
                    None => term,
                    Some(sum) => self.push(Node::Add(sum, term)),
                });
            }
        }
        total.unwrap_or_else(|| self.push(Node::Constant(0.0)))
    }

    /// `sign(s)` or `step(s)`. Where `s` rests on a state it is a switching surface; elsewhere a plain function.
    fn switch(&mut self, function: Function, arguments: &[Expr]) -> NodeId {
        let Some(argument) = arguments.first() else { return self.push(Node::Constant(f64::NAN)) };
        let rests_on_state = self.simulation.states.iter().any(|s| argument.uses(&s.name));
        if !rests_on_state || argument.has_memory() {
            let a = self.build(argument);
            return self.push(Node::Call(function, a));
        }
        // `sign(-s)`, `sign(p*s)` and `sign(b - a)` switch where `sign(s)` and `sign(a - b)` do, maybe the other way. Of two surfaces in one place both would stick,
        // and which of them holds the motion is not settled.
        let (mut argument, factors, mut flipped) = self.unscaled(argument.simplified());
        if let Expr::Binary(BinaryOp::Sub, a, b) = &argument {
            let other = Expr::Binary(BinaryOp::Sub, b.clone(), a.clone());
            if self.surfaces.iter().any(|(known, _)| *known == other) {
                argument = other;
                flipped = !flipped;
            }
        }
        let number = match self.surfaces.iter().position(|(known, _)| *known == argument) {
            Some(number) => number,
            None => {
                let surface = self.surface(&argument);
                self.surfaces.push((argument, surface));
                self.surfaces.len() - 1
            }
        };
        let mut sigma = self.push(Node::Sigma(number as u32));
        if flipped {
            sigma = self.push(Node::Neg(sigma));
        }
        for factor in &factors {
            let factor = self.build(factor);
            let side = self.push(Node::Call(Function::Sign, factor));
            sigma = self.push(Node::Mul(side, sigma));
        }
        if function == Function::Step {
            let half = self.push(Node::Constant(0.5));
            let halved = self.push(Node::Mul(half, sigma));
            sigma = self.push(Node::Add(half, halved));
        }
        sigma
    }

    /// What moves in a product or quotient with parameters and numbers, these, and whether its sign is the other one. Positive numbers are left out.
    fn unscaled(&self, mut argument: Expr) -> (Expr, Vec<Expr>, bool) {
        let parameter = |name: &String| name == "pi" || self.simulation.parameter(name).is_some();
        let still = |e: &Expr| !e.has_memory() && e.symbols().iter().all(parameter);
        let (mut factors, mut flipped) = (Vec::new(), false);
        loop {
            let (factor, rest) = match argument {
                Expr::Neg(rest) => (Expr::Number(-1.0), *rest),
                Expr::Binary(BinaryOp::Mul, factor, rest) if still(&factor) => (*factor, *rest),
                Expr::Binary(BinaryOp::Mul | BinaryOp::Div, rest, factor) if still(&factor) => (*factor, *rest),
                other => return (other, factors, flipped),
            };
            match factor {
                Expr::Number(x) if x > 0.0 => {}
                Expr::Number(x) if x < 0.0 => flipped = !flipped,
                factor => factors.push(factor),
            }
            argument = rest;
        }
    }

    fn surface(&mut self, argument: &Expr) -> SurfaceNodes {
        let simulation = self.simulation;
        let slope = |name: &str, graph: &mut Self| {
            argument.uses(name).then(|| derivative(argument, name).simplified()).map(|e| graph.build(&e))
        };
        let states = simulation.states.iter().enumerate();
        let by_state: Vec<_> = states.filter_map(|(i, s)| Some((i as u32, slope(&s.name, self)?))).collect();
        let inputs = simulation.inputs.iter().enumerate();
        let by_input: Vec<_> = inputs.filter_map(|(i, u)| Some((i as u32, slope(&u.symbol, self)?))).collect();
        let by_time = slope("t", self);
        let argument = self.build(argument);
        let state = match self.nodes.get(argument as usize) {
            Some(Node::State(i)) => Some(*i),
            _ => None,
        };
        SurfaceNodes { argument, state, by_state, by_input, by_time }
    }
}
