//! A correction as a simulation: its terms stand in the equations; their coefficients, knees, widths and wave numbers are parameters.
//!
//! Regression on the tangent chose the terms out of a coarse grid. A wave number that is a tenth wrong is out of phase at the end of the range,
//! and what was better on the recording is then worse on another: all of it is refitted.

use hysid_plant::{BinaryOp, Expr, Function, Memory, Parameter, Simulation, Slot as Place};

use super::terms::{Coordinate, Term, measured};
use crate::text::number;

/// How far a coefficient may move from where the regression on the tangent found it, over its own size.
pub const REACH: f64 = 10.0;
/// How far a shape may move, as multiples of where it began.
const SHAPES: (f64, f64) = (0.5, 2.0);
/// Numbers that are part of a term's form.
pub const FORM: [f64; 4] = [0.0, 1.0, 2.0, 3.0];

/// Terms with their coefficients, each of which a simulation can go without.
#[derive(Debug, Clone)]
pub struct Sparse {
    simulation: Simulation,
    members: Vec<Member>,
}

/// A term with its coefficient on the tangent, and where its own parameters were fitted to: the coefficient, then its shapes.
#[derive(Debug, Clone)]
struct Member {
    term: Term,
    coefficient: f64,
    fitted: Vec<f64>,
}

impl Sparse {
    /// In this simulation.
    pub fn new(simulation: Simulation, terms: impl Iterator<Item = (Term, f64)>) -> Self {
        let members = terms.map(|(term, coefficient)| Member { term, coefficient, fitted: Vec::new() }).collect();
        Self { simulation, members }
    }

    /// The same terms in another simulation, from where the regression had them.
    pub fn within(&self, simulation: Simulation) -> Self {
        let bare = |m: &Member| Member { fitted: Vec::new(), ..m.clone() };
        Self { simulation, members: self.members.iter().map(bare).collect() }
    }

    /// As they were fitted, with those of another one beside them that are not among them.
    pub fn with(&self, fitted: &[Vec<f64>], others: &Self) -> Self {
        let mut members = self.at(fitted);
        let same = |a: &Member, b: &Member| a.term.place == b.term.place && a.term.text == b.term.text;
        members.extend(others.members.iter().filter(|o| !self.members.iter().any(|m| same(m, o))).cloned());
        Self { simulation: self.simulation.clone(), members }
    }

    /// Its terms as they were fitted.
    fn at(&self, fitted: &[Vec<f64>]) -> Vec<Member> {
        self.members.iter().zip(fitted).map(|(m, f)| Member { fitted: f.clone(), ..m.clone() }).collect()
    }

    /// The slot of each term.
    pub fn slots(&self) -> impl Iterator<Item = &str> {
        self.members.iter().map(|m| m.term.slot.as_str())
    }

    /// The terms as they are written, with shapes that were fitted.
    pub fn texts(&self, fitted: &[Vec<f64>]) -> impl Iterator<Item = String> {
        self.members.iter().zip(fitted).map(|(m, f)| {
            let mut shapes = f.iter().skip(1);
            let mut rounded = |n: f64| {
                let shape = shapes.next().copied().unwrap_or(n);
                Expr::Number(number(shape).parse().unwrap_or(shape))
            };
            let text = Expr::parse(&m.term.text).map(|e| with_shapes(e, &mut rounded).to_string());
            text.unwrap_or_else(|_| m.term.text.clone())
        })
    }

    /// The simulation with them, and the names of each one's parameters: its coefficient, then its shapes.
    pub fn written(&self) -> Option<(Simulation, Vec<Vec<String>>)> {
        let (mut simulation, names) =
            with_terms(&self.simulation, self.members.iter().map(|m| (&m.term, m.coefficient)))?;
        for (name, value) in names.iter().zip(&self.members).flat_map(|(names, m)| names.iter().zip(&m.fitted)) {
            simulation.parameter_mut(name)?.value = *value;
        }
        Some((simulation, names))
    }

    /// Without one of them, the others as they were fitted; `None` where it is the only one.
    pub fn without(&self, place: usize, fitted: &[Vec<f64>]) -> Option<Self> {
        let mut members = self.at(fitted);
        members.remove(place);
        (!members.is_empty()).then(|| Self { simulation: self.simulation.clone(), members })
    }
}

/// A simulation with these terms where they act, and the names of each one's parameters, its coefficient first; `None` where a term cannot be written over its symbols.
pub fn with_terms<'t>(
    simulation: &Simulation,
    terms: impl IntoIterator<Item = (&'t Term, f64)>,
) -> Option<(Simulation, Vec<Vec<String>>)> {
    let terms: Vec<(&Term, f64)> = terms.into_iter().collect();
    let curves = held(&terms)?;
    let mut names = Vec::new();
    let mut written = simulation.clone();
    let measured = measured(simulation);
    // What is added to an input stands for the input as it was: all of its terms enter at once.
    let mut inputs: Vec<Option<Expr>> = vec![None; simulation.inputs.len()];
    for (term, coefficient) in &terms {
        let name = written.fresh_symbol("g");
        let reach = REACH * coefficient.abs();
        written.parameters.push(Parameter::new(&name, *coefficient).within(coefficient - reach, coefficient + reach));
        let before = written.parameters.len();
        let part = Expr::symbol(&name) * with_free_shapes(&mut written, term, &curves)?;
        let shapes = written.parameters[before..].iter().map(|p| p.name.clone());
        names.push(std::iter::once(name).chain(shapes).collect());
        match term.place {
            Place::State(i) => {
                for (_, output, times) in measured.iter().filter(|(state, ..)| *state == i) {
                    let output = written.outputs.get_mut(*output)?;
                    output.expression = output.expression.clone() + Expr::Number(*times) * part.clone();
                }
                let state = written.states.get_mut(i)?;
                state.derivative = state.derivative.clone() + part;
            }
            Place::Output(i) => {
                let output = written.outputs.get_mut(i)?;
                output.expression = output.expression.clone() + part;
            }
            Place::Input(i) => {
                let sum = inputs.get_mut(i)?;
                *sum = Some(sum.take().unwrap_or_else(|| Expr::symbol(&simulation.inputs[i].symbol)) + part);
            }
        }
    }
    for (input, sum) in simulation.inputs.iter().zip(inputs) {
        if let Some(sum) = sum {
            written.map_equations(|e| e.substitute(&input.symbol, &sum));
        }
    }
    Some((written, names))
}

/// What is held some way beyond the ends of the range that was seen of it. Beyond that a curve says nothing: there it stays as it is, and with it what it balances within,
/// and what a product multiplies it with. Proportions and waves go on, and what was some time ago, which balances nothing within.
fn held<'t>(terms: &[(&'t Term, f64)]) -> Option<Vec<&'t Expr>> {
    // The coordinates that grow in each term, with the degree at which they do.
    let mut growing: Vec<Vec<(&Expr, usize)>> = Vec::new();
    for (term, _) in terms {
        let text = Expr::parse(&term.text).ok()?;
        if is_past(&text) {
            continue;
        }
        let of = |c: &'t Coordinate| (&c.meaning, degree(&text, &c.name));
        growing.push(term.coordinates.iter().map(of).filter(|(_, degree)| *degree > 0).collect());
    }
    let mut held: Vec<&Expr> = growing.iter().flatten().filter(|(_, degree)| *degree > 1).map(|(c, _)| *c).collect();
    loop {
        let beside = |term: &&Vec<(&'t Expr, usize)>| term.iter().any(|(c, _)| held.contains(c));
        let more: Vec<&Expr> =
            growing.iter().filter(beside).flatten().map(|(c, _)| *c).filter(|c| !held.contains(c)).collect();
        if more.is_empty() {
            return Some(held);
        }
        held.extend(more);
    }
}

/// Whether a term is a coordinate as it was some time ago.
fn is_past(text: &Expr) -> bool {
    matches!(text, Expr::Memory(Memory::Delay, _))
}

/// A term over the simulation's symbols, the numbers in it parameters; exponents, zero and one are part of its form.
/// `curves`: coordinates that are held beyond what was seen of them.
fn with_free_shapes(simulation: &mut Simulation, term: &Term, curves: &[&Expr]) -> Option<Expr> {
    let parsed = Expr::parse(&term.text).ok()?;
    let curves = if is_past(&parsed) { &[] } else { curves };
    let free = with_shapes(parsed, &mut |n| {
        let name = simulation.fresh_symbol("s");
        let (low, high) = (n * SHAPES.0, n * SHAPES.1);
        simulation.parameters.push(Parameter::new(&name, n).within(low.min(high), low.max(high)));
        Expr::symbol(&name)
    });
    let meaning = |c: &Coordinate| if curves.contains(&&c.meaning) { c.held.clone() } else { c.meaning.clone() };
    Some(term.coordinates.iter().fold(free, |e, c| e.substitute(&c.name, &meaning(c))))
}

/// An expression with something in the place of each number that is a shape and no part of its form, in their order.
fn with_shapes(e: Expr, shape: &mut dyn FnMut(f64) -> Expr) -> Expr {
    e.map(&mut |e| match e {
        Expr::Number(n) if !FORM.contains(&n) => shape(n),
        other => other,
    })
}

/// Degree at which an expression grows with a symbol: 0 where it stays bounded or repeats itself, 1 in proportion, 2 where it curves.
fn degree(e: &Expr, symbol: &str) -> usize {
    let of = |e: &Expr| degree(e, symbol);
    let most = |all: &[Expr]| all.iter().map(of).max().unwrap_or(0);
    match e {
        Expr::Number(_) => 0,
        Expr::Symbol(name) => usize::from(name == symbol),
        Expr::Neg(a) => of(a),
        Expr::Binary(BinaryOp::Add | BinaryOp::Sub, a, b) => of(a).max(of(b)),
        Expr::Binary(BinaryOp::Mul, a, b) => of(a) + of(b),
        Expr::Binary(BinaryOp::Div, a, b) if of(b) == 0 => of(a),
        Expr::Call(Function::Sign | Function::Sin | Function::Cos, _) => 0,
        Expr::Call(Function::Abs | Function::Min | Function::Max, all) | Expr::Memory(_, all) => most(all),
        Expr::Binary(_, a, b) => 2 * of(a).max(of(b)),
        Expr::Call(_, all) => 2 * most(all),
    }
}

#[cfg(test)]
mod tests {
    use hysid_linalg::dot;
    use hysid_signal::{Channel, Clock, Recording};

    use super::*;
    use crate::data::DataSet;
    use crate::evidence::norm2;
    use crate::model::base::{NoiseKind, Start, fit_simulation};
    use crate::model::{Model, Values};
    use crate::openset::terms::terms;
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};
    use crate::refit::LmOptions;

    #[test]
    fn a_term_grows_in_proportion_to_a_coordinate_or_curves() {
        let x = |text: &str| degree(&Expr::parse(text).unwrap(), "x");
        for proportion in ["abs(u)*x", "x*abs(v)", "abs(x)*sign(v)", "max(-0.2 - x, 0)", "play(x, 0.3)", "t*x", "v^2*x"]
        {
            assert_eq!(x(proportion), 1, "{proportion}");
        }
        for curve in ["x^2", "abs(x)*x", "x^2*v", "tanh(x/0.1)", "sign(x)*sqrt(abs(x))"] {
            assert!(x(curve) > 1, "{curve}");
        }
        assert_eq!((x("u*v"), x("sign(x)*v"), x("v*cos(3*x)")), (0, 0, 0));
    }

    #[test]
    fn a_product_with_what_is_held_is_held_as_a_whole() {
        let held_in = |texts: &[&str]| {
            let terms: Vec<Term> = texts.iter().map(|text| term(text, &["u", "x", "y"])).collect();
            let listed: Vec<(&Term, f64)> = terms.iter().map(|t| (t, 1.0)).collect();
            let mut names: Vec<String> = held(&listed).unwrap().into_iter().map(ToString::to_string).collect();
            names.sort();
            names.dedup();
            names.join(" ")
        };
        assert_eq!(held_in(&["u*x", "y"]), "");
        assert_eq!(held_in(&["x^2", "y"]), "x");
        assert_eq!(held_in(&["u*x", "x^2", "y"]), "u x");
        assert_eq!(held_in(&["u*y", "x^2", "u*x"]), "u x y");
    }

    /// A curve is held beyond the range, and not what came late beside it.
    #[test]
    fn what_was_some_time_ago_is_not_held() {
        let plain = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let mut both = [term("delay(x, 0.31)", &["x", "v"]), term("x^2*v", &["x", "v"])];
        for term in &mut both {
            let held = |c: &Coordinate| Coordinate { held: Expr::symbol(format!("held_{}", c.name)), ..c.clone() };
            term.coordinates = term.coordinates.iter().map(held).collect();
        }
        let (written, _) = with_terms(&plain, both.iter().map(|t| (t, 1.0))).unwrap();
        let text = written.states[1].derivative.to_string();
        assert!(text.contains("delay(x, s)") && text.contains("held_x^2*held_v"), "{text}");
    }

    fn term(text: &str, coordinates: &[&str]) -> Term {
        let coordinate = |n: &&str| Coordinate { name: (*n).into(), meaning: Expr::symbol(*n), held: Expr::symbol(*n) };
        Term {
            text: text.into(),
            coordinates: coordinates.iter().map(coordinate).collect(),
            place: Place::State(1),
            kind: crate::openset::shapes::Kind::Odd,
            side: "plant",
            slot: "state:v".into(),
            column: Vec::new(),
        }
    }

    /// Terms that were seen beside an effect stand in the simulation without it, and start anew there.
    #[test]
    fn terms_that_an_effect_left_stand_in_its_place() {
        let plain = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let mut with_effect = plain.clone();
        with_effect.parameters.push(Parameter::new("h", 2.0).within(0.0, 9.0));
        with_effect.states[1].derivative = Expr::parse("(u - c*v - k*x - h*x^5)/m").unwrap();
        let term = term("x*abs(v)", &["x", "v"]);
        let beside = Sparse::new(with_effect, [(term, -3.0)].into_iter());
        let (written, names) = beside.within(plain.clone()).written().unwrap();
        assert!(written.parameter("h").is_none() && written.parameters.len() == plain.parameters.len() + 1);
        assert_eq!(written.parameter(&names[0][0]).map(|p| p.value), Some(-3.0));
        let expected = plain.states[1].derivative.clone() + Expr::parse("g*(x*abs(v))").unwrap();
        assert_eq!(written.states[1].derivative.to_string(), expected.to_string());
        assert_eq!(beside.texts(&[vec![-3.0]]).collect::<Vec<_>>(), ["x*abs(v)"]);
    }

    /// What regression on the tangent saw and what is written and refitted must be the same term: its response is the derivative of the
    /// written simulation by its coefficient, for each of the terms at every slot.
    #[test]
    fn the_response_of_a_term_is_the_derivative_by_its_coefficient() {
        let u = drive(600, &mut normal(3));
        let y = respond(&u, REAL, |_, _| 0.0);
        let a = respond(&drive(600, &mut normal(4)), REAL, |_, _| 0.0);
        let channels =
            [("u_N", u), ("x_m", y), ("a_mps2", a)].map(|(name, samples)| Channel { name: name.into(), samples });
        let recording = Recording::new("est.csv", Clock { start_s: 0.0, period_s: PERIOD }, channels.into()).unwrap();
        // One output is the position, the other the acceleration, which holds the forces.
        let simulation = BASELINE.to_owned() + "a_mps2 = \"(u - c*v - k*x)/m\"\n";
        let simulation = Simulation::parse(&simulation, "test.sim.toml").unwrap();
        let data = DataSet::new(&simulation, &[recording], 3).unwrap();
        let model = |s: &Simulation| Model::new(s, &data, 2).unwrap();
        let start = Values::default();
        let base = fit_simulation(
            model(&simulation),
            Start::Values(&start),
            &[],
            None,
            1,
            LmOptions::default(),
            NoiseKind::White(1.0),
        )
        .unwrap();
        let all = terms(&base);
        assert!(all.len() > 50, "{}", all.len());
        for term in &all {
            let response = |g: f64| {
                let (mut written, _) = with_terms(&base.document(), [(term, 1.0)]).unwrap();
                written.parameter_mut("g").unwrap().value = g;
                let m = model(&written);
                let theta = m.theta(&start);
                m.simulate(&theta).0.concat().concat()
            };
            // As far as the oscillator moves by a hundredth of what it does.
            let g = 0.01 * rms(&data.y) / rms(&term.column).max(f64::MIN_POSITIVE);
            let slope: Vec<f64> = response(g).iter().zip(response(-g)).map(|(a, b)| (a - b) / (2.0 * g)).collect();
            let cosine = dot(&slope, &term.column) / (norm2(&slope) * norm2(&term.column)).sqrt();
            let size = rms(&slope) / rms(&term.column);
            // A relay switches between samples; a resistance that is negative somewhere pushes at standstill; gates bend within a hundredth of the motion.
            let pushes = ["x*sign(v)", "sin(", "cos("].iter().any(|s| term.text.starts_with(s))
                && term.text.ends_with("*sign(v)");
            let (near, far) = if term.text.contains("relay") || pushes {
                (0.9, 0.1)
            } else if term.text.contains("tanh((") {
                (0.98, 0.08)
            } else {
                (0.98, 0.06)
            };
            assert!(cosine > near && (size - 1.0).abs() < far, "{} at {}: {cosine} {size}", term.text, term.slot);
        }
    }
}
