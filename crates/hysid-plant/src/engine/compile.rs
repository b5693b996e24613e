//! From document to programs.

use super::graph::{Graph, Node, NodeId, SurfaceNodes};
use super::program::Program;
use crate::document::{Hold, Initial, Parameter, Simulation};
use crate::error::Error;

/// A simulation compiled for evaluation: immutable, to be shared between threads.
#[derive(Debug, Clone)]
pub struct Compiled {
    pub(super) simulation: Simulation,
    pub(super) nodes: Vec<Node>,
    pub(super) surfaces: Vec<SurfaceNodes>,
    /// Whether every surface's argument is a state.
    pub(super) plain_surfaces: bool,
    /// Whether there is a delay: its control flow rests on values, so runs in lanes cannot share it.
    pub(super) has_delay: bool,
    /// Which cells are delays of what rests on inputs only (these follow the hold exactly).
    pub(super) delay_of_input: Vec<bool>,
    /// Leaves by kind: (register, index).
    pub(super) input_leaves: Vec<(NodeId, usize)>,
    pub(super) rate_leaves: Vec<(NodeId, usize)>,
    pub(super) sigma_leaves: Vec<(NodeId, usize)>,
    pub(super) parameter_leaves: Vec<(NodeId, usize)>,
    pub(super) time_leaf: Option<NodeId>,
    pub(super) derivatives: Vec<NodeId>,
    pub(super) initials: Vec<Option<NodeId>>,
    pub(super) outputs: Vec<NodeId>,
    /// 0, 1, ... up to the number of states: loops over these are over one state at a time. (Over a range the compiler
    /// takes several states at once and gathers their lanes from memory, which is slower by far.)
    pub(super) state_numbers: Vec<usize>,
    /// What rests on parameters only: run once.
    pub(super) prologue: Program,
    /// What the state derivatives need of inputs, time and operators on them, once for each moment.
    pub(super) stimulus: Program,
    /// Whether what the stimulus is at the end of a step it is at the start of the next one, too, where no input jumps: no operator in it asks where in a
    /// step it stands, and no event changes the steps.
    pub(super) stimulus_lasts: bool,
    /// Whether it rests on the time itself, so that it changes while inputs are held.
    pub(super) stimulus_ticks: bool,
    /// State derivatives, after the stimulus.
    pub(super) flow: Program,
    /// Arguments of the switching surfaces.
    pub(super) switches: Program,
    /// Derivatives of the switching surfaces' arguments.
    pub(super) gradients: Program,
    /// The operators with memory that the stimulus has not, to be committed at the end of a step.
    pub(super) memories: Program,
    /// Outputs.
    pub(super) measure: Program,
}

impl Compiled {
    /// The simulation, compiled.
    ///
    /// # Errors
    /// What [`Simulation::validate`] finds.
    pub fn new(simulation: &Simulation) -> Result<Self, Error> {
        simulation.validate()?;
        let mut graph = Graph::new(simulation);
        let initials: Vec<Option<NodeId>> = simulation
            .states
            .iter()
            .map(|s| match &s.initial {
                Initial::Expr(e) => Some(graph.build(e)),
                Initial::Number(_) | Initial::Free => None,
            })
            .collect();
        let derivatives: Vec<NodeId> = simulation.states.iter().map(|s| graph.build(&s.derivative)).collect();
        let outputs: Vec<NodeId> = simulation.outputs.iter().map(|o| graph.build(&o.expression)).collect();
        let (nodes, surfaces, cells) = graph.surfaces();

        // What moves: 0 parameters only, 1 inputs and time, 2 states.
        let mut level = vec![0_u8; nodes.len()];
        for (id, node) in nodes.iter().enumerate() {
            let own = match node {
                Node::Time | Node::Input(_) | Node::InputRate(_) => 1,
                Node::Play(..) | Node::Relay(..) | Node::Lag(..) | Node::Delay(..) => 1,
                Node::State(_) | Node::Sigma(_) => 2,
                _ => 0,
            };
            let operands = node.operands().into_iter().flatten();
            let below = operands.filter_map(|o| level.get(o as usize).copied()).max().unwrap_or(0);
            if let Some(slot) = level.get_mut(id) {
                *slot = own.max(below);
            }
        }
        let level_of = |id: NodeId| level.get(id as usize).copied().unwrap_or(0);
        let constant = |id: NodeId| level_of(id) == 0;

        let mut delay_of_input = vec![false; cells as usize];
        let mut memory_nodes = Vec::new();
        let mut leaves: [Vec<(NodeId, usize)>; 4] = Default::default();
        let mut time_leaf = None;
        for (id, node) in nodes.iter().enumerate() {
            let id = id as NodeId;
            match *node {
                Node::Input(i) => leaves[0].push((id, i as usize)),
                Node::InputRate(i) => leaves[1].push((id, i as usize)),
                Node::Sigma(i) => leaves[2].push((id, i as usize)),
                Node::Parameter(i) => leaves[3].push((id, i as usize)),
                Node::Time => time_leaf = Some(id),
                Node::Delay(w, _, cell) => {
                    memory_nodes.push(id);
                    if let Some(flag) = delay_of_input.get_mut(cell as usize) {
                        *flag = level_of(w) < 2;
                    }
                }
                Node::Play(..) | Node::Relay(..) | Node::Lag(..) => memory_nodes.push(id),
                _ => {}
            }
        }
        let [input_leaves, rate_leaves, sigma_leaves, parameter_leaves] = leaves;
        let all_constant = (0..nodes.len() as NodeId).filter(|id| constant(*id));
        let gradient_roots = surfaces.iter().flat_map(|s| {
            let inputs = s.by_input.iter().map(|(_, id)| *id);
            s.by_state.iter().map(|(_, id)| *id).chain(inputs).chain(s.by_time)
        });
        // Where the state derivatives take up what rests on inputs and time.
        let mut stimuli = Vec::new();
        let mut seen = vec![false; nodes.len()];
        let mut open = derivatives.clone();
        while let Some(id) = open.pop() {
            let Some(flag) = seen.get_mut(id as usize).filter(|flag| !**flag) else { continue };
            *flag = true;
            match level_of(id) {
                0 => {}
                1 => stimuli.push(id),
                _ => open.extend(nodes.get(id as usize).into_iter().flat_map(|n| n.operands()).flatten()),
            }
        }
        // What of it a step has evaluated at its end by itself, so that it need not be evaluated to be committed.
        let mut held = vec![false; nodes.len()];
        let mut open = stimuli.clone();
        while let Some(id) = open.pop() {
            let Some(flag) = held.get_mut(id as usize).filter(|flag| !**flag) else { continue };
            *flag = true;
            open.extend(nodes.get(id as usize).into_iter().flat_map(|n| n.operands()).flatten());
        }
        let stimulated = |id: NodeId| held.get(id as usize).copied().unwrap_or(false);
        let stimulus_has = |test: fn(&Node) -> bool| nodes.iter().zip(&held).any(|(node, held)| *held && test(node));
        let asks = |node: &Node| matches!(node, Node::Lag(..) | Node::Delay(..));
        Ok(Self {
            prologue: Program::new(&nodes, all_constant, |_| false),
            stimulus_lasts: surfaces.is_empty() && !stimulus_has(asks),
            stimulus_ticks: stimulus_has(|node| matches!(node, Node::Time)),
            stimulus: Program::new(&nodes, stimuli, constant),
            flow: Program::new(&nodes, derivatives.iter().copied(), |id| level_of(id) < 2),
            switches: Program::new(&nodes, surfaces.iter().map(|s| s.argument), constant),
            gradients: Program::new(&nodes, gradient_roots, constant),
            memories: Program::new(&nodes, memory_nodes.into_iter().filter(|&id| !stimulated(id)), constant),
            measure: Program::new(&nodes, outputs.iter().copied(), constant),
            simulation: simulation.clone(),
            state_numbers: (0..simulation.states.len()).collect(),
            has_delay: nodes.iter().any(|n| matches!(n, Node::Delay(..))),
            plain_surfaces: surfaces.iter().all(|s| s.state.is_some()),
            surfaces,
            delay_of_input,
            input_leaves,
            rate_leaves,
            sigma_leaves,
            parameter_leaves,
            time_leaf,
            derivatives,
            initials,
            outputs,
            nodes,
        })
    }

    /// The document that was compiled.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// The parameters, in the document's order: the order of every `theta`.
    pub fn parameters(&self) -> &[Parameter] {
        &self.simulation.parameters
    }

    /// The user's parameter values.
    pub fn theta(&self) -> Vec<f64> {
        self.simulation.parameters.iter().map(|p| p.value).collect()
    }

    /// Numbers of the parameters that are estimated.
    pub fn estimated(&self) -> Vec<usize> {
        let all = self.simulation.parameters.iter().enumerate();
        all.filter(|(_, p)| !p.fixed).map(|(i, _)| i).collect()
    }

    /// Numbers of the states whose initial value is free.
    pub fn free_states(&self) -> Vec<usize> {
        let all = self.simulation.states.iter().enumerate();
        all.filter(|(_, s)| s.initial == Initial::Free).map(|(i, _)| i).collect()
    }

    /// The number of the parameter of that name.
    pub fn parameter_index(&self, name: &str) -> Option<usize> {
        self.simulation.parameters.iter().position(|p| p.name == name)
    }

    /// Number of inputs, states and outputs.
    pub fn sizes(&self) -> (usize, usize, usize) {
        (self.simulation.inputs.len(), self.simulation.states.len(), self.simulation.outputs.len())
    }

    /// What an input does between samples.
    pub fn hold(&self) -> Hold {
        self.simulation.time.hold
    }

    /// Whether an output jumps where a sign or step of a state switches, so that events are located in time.
    pub fn has_switching(&self) -> bool {
        !self.surfaces.is_empty()
    }
}
