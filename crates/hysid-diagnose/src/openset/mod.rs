//! What no mechanism explains: generic families of signals injected at the slots, a sparse correction, and its signature.
//!
//! The families have no physics in their names: hinges and monomials of displacement and velocity, plays, lags, functions of time, hinges of
//! the input and of the output. Each signal is added at its slot and pushed through the tangent of the fitted simulation, so that a
//! correction lives where it acts and not at the output. Terms are chosen by orthogonal forward regression with PRESS. Whether the correction
//! is worth anything is judged on blocks that its coefficients were not fitted to.
//!
//! Reference: P. Martins and L. A. Aguirre, Sufficient conditions for rate-independent hysteresis in autoregressive identified models,
//! MSSP 75 (2016): memory without rate needs an operator with memory, which no static term imitates.

use hysid_linalg::Matrix;
use hysid_plant::{Direction, Expr, Injection, Slot as Place};
use hysid_select::{Criterion, Options as Selecting, PressForm, select};
use rayon::prelude::*;

use crate::base::Base;
use crate::data::held_out_blocks;
use crate::evidence::{FeatureGroup, dot, norm2, score};
use crate::file::{CorrectionRecord, SignatureRecord, TermRecord};
use crate::screen::along;
use crate::slot::Structure;

/// What a generic term is a function of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Odd,
    Even,
    Play,
    Lag,
    Time,
}

/// One generic signal at one place.
struct Term {
    text: String,
    kind: Kind,
    side: &'static str,
    slot: String,
    column: Vec<f64>,
}

/// A correction with what decides whether it is believed.
#[derive(Debug, Clone)]
pub struct OpenSet {
    /// As it is reported.
    pub record: CorrectionRecord,
    /// Rms error on blocks that its coefficients were not fitted to, over that without it.
    pub block_ratio: f64,
}

/// Signals that are pushed through the simulation's tangent together.
const TOGETHER: usize = 8;

/// Most terms of a correction.
const MOST_TERMS: usize = 8;

/// The signals of one coordinate that are tried: text, kind, series by stretch.
fn shapes(name: &str, x: &[Vec<f64>], velocity: bool) -> Vec<(String, Kind, Vec<Vec<f64>>)> {
    let all: Vec<f64> = x.concat();
    let mut size: Vec<f64> = all.iter().map(|v| v.abs()).collect();
    size.sort_by(f64::total_cmp);
    let quantile = |q: f64| size.get(((size.len() as f64 - 1.0) * q) as usize).copied().unwrap_or(0.0);
    let map =
        |f: &dyn Fn(f64) -> f64| -> Vec<Vec<f64>> { x.iter().map(|s| s.iter().map(|v| f(*v)).collect()).collect() };
    let number = crate::text::number;
    let mut out: Vec<(String, Kind, Vec<Vec<f64>>)> = vec![
        (format!("{name}^2"), Kind::Even, map(&|v| v * v)),
        (format!("{name}^3"), Kind::Odd, map(&|v| v * v * v)),
        (format!("abs({name})"), Kind::Even, map(&f64::abs)),
        (format!("abs({name})*{name}"), Kind::Odd, map(&|v| v * v.abs())),
        (format!("sign({name})*sqrt(abs({name}))"), Kind::Odd, map(&|v| v.signum() * v.abs().sqrt())),
    ];
    if velocity {
        let small = 0.05 * quantile(0.8);
        if small > 0.0 {
            out.push((format!("tanh({name}/{})", number(small)), Kind::Odd, map(&|v| (v / small).tanh())));
        }
    }
    for q in [0.5, 0.8] {
        let g = quantile(q);
        out.push((format!("max({name} - {}, 0)", number(g)), Kind::Even, map(&|v| (v - g).max(0.0))));
        out.push((format!("max(-{} - {name}, 0)", number(g)), Kind::Even, map(&|v| (-g - v).max(0.0))));
    }
    for q in [0.2, 0.5, 0.8] {
        let r = 0.7 * quantile(q);
        if r > 0.0 && !velocity {
            let play = x
                .iter()
                .map(|s| {
                    let mut w = s.first().copied().unwrap_or(0.0);
                    s.iter()
                        .map(|v| {
                            w = w.max(v - r).min(v + r);
                            w
                        })
                        .collect()
                })
                .collect();
            out.push((format!("play({name}, {})", number(r)), Kind::Play, play));
        }
    }
    out
}

/// The generic terms of a fitted simulation, as responses in the unit of the outputs.
fn terms(base: &Base<'_>) -> Vec<Term> {
    let model = &base.model;
    let data = model.data();
    let simulation = model.simulation();
    let structure = Structure::of(simulation);
    // (place in the engine, slot's name, side, coordinates)
    let mut places: Vec<(Place, String, &'static str, Vec<(String, Expr, bool)>)> = Vec::new();
    let own: Vec<&str> = structure.slots.iter().map(|s| s.label.as_str()).collect();
    for (i, state) in simulation.states.iter().enumerate() {
        let label = format!("state:{}", state.name);
        let Some(slot) = structure.slots.iter().find(|s| s.label == label) else { continue };
        let coordinates = ["x", "v"]
            .iter()
            .filter_map(|n| slot.quantity(n).map(|q| ((*n).to_owned(), q.expression.clone(), *n == "v")))
            .map(|(n, e, v)| (if let Expr::Symbol(s) = &e { s.clone() } else { n }, e, v))
            .collect::<Vec<_>>();
        let coordinates = if coordinates.is_empty() {
            vec![(state.name.clone(), Expr::symbol(&state.name), false)]
        } else {
            coordinates
        };
        places.push((Place::State(i), label, "plant", coordinates));
    }
    for (i, input) in simulation.inputs.iter().enumerate() {
        let label = format!("input:{}", input.symbol);
        if !simulation.is_static() && own.contains(&label.as_str()) {
            places.push((
                Place::Input(i),
                label,
                "input",
                vec![(input.symbol.clone(), Expr::symbol(&input.symbol), false)],
            ));
        }
    }
    for (i, output) in simulation.outputs.iter().enumerate() {
        let label = format!("output:{}", output.column);
        let coordinates = if simulation.is_static() {
            simulation
                .inputs
                .iter()
                .map(|u| (u.symbol.clone(), Expr::symbol(&u.symbol), u.symbol.starts_with('v')))
                .collect()
        } else {
            vec![("y".to_owned(), output.expression.clone(), false)]
        };
        places.push((Place::Output(i), label, if simulation.is_static() { "plant" } else { "output" }, coordinates));
    }
    let mut work: Vec<(Place, String, &'static str, String, Kind, Vec<Vec<f64>>)> = Vec::new();
    for (place, label, side, coordinates) in places {
        let expressions: Vec<Expr> = coordinates.iter().map(|c| c.1.clone()).collect();
        let Some(series) = along(base, &expressions) else { continue };
        for ((name, _, velocity), x) in coordinates.iter().zip(&series) {
            for (text, kind, s) in shapes(name, x, *velocity) {
                work.push((place, label.clone(), side, text, kind, s));
            }
            if side == "plant" {
                let span: Vec<f64> = data.stretches.iter().map(|s| s.len() as f64 * data.period_s).collect();
                let longest = span.iter().copied().fold(0.0, f64::max);
                for tau in [longest / 300.0, longest / 60.0, longest / 12.0] {
                    let lag = x
                        .iter()
                        .map(|s| {
                            let a = (-data.period_s / tau).exp();
                            let mut w = s.first().copied().unwrap_or(0.0);
                            s.iter()
                                .map(|v| {
                                    w = a * w + (1.0 - a) * v;
                                    v - w
                                })
                                .collect()
                        })
                        .collect();
                    work.push((
                        place,
                        label.clone(),
                        side,
                        format!("{name} - lag({name}, {})", crate::text::number(tau)),
                        Kind::Lag,
                        lag,
                    ));
                }
                let drift = x
                    .iter()
                    .zip(&data.stretches)
                    .map(|(s, st)| {
                        s.iter().enumerate().map(|(n, v)| v * (st.start_s + n as f64 * data.period_s)).collect()
                    })
                    .collect();
                work.push((place, label.clone(), side, format!("t*{name}"), Kind::Time, drift));
            }
        }
        if let ([(a, _, _), (b, _, _)], [x, v]) = (coordinates.as_slice(), series.as_slice())
            && side == "plant"
        {
            let pair = |f: &dyn Fn(f64, f64) -> f64| -> Vec<Vec<f64>> {
                x.iter().zip(v).map(|(x, v)| x.iter().zip(v).map(|(x, v)| f(*x, *v)).collect()).collect()
            };
            for (text, kind, s) in [
                (format!("{a}^2*{b}"), Kind::Odd, pair(&|x, v| x * x * v)),
                (format!("{a}*{b}^2"), Kind::Odd, pair(&|x, v| x * v * v)),
                (format!("abs({a})*{b}"), Kind::Odd, pair(&|x, v| x.abs() * v)),
                (format!("{a}*abs({b})"), Kind::Odd, pair(&|x, v| x * v.abs())),
                (format!("abs({a})*sign({b})"), Kind::Odd, pair(&|x, v| x.abs() * v.signum())),
                (format!("{a}*{b}"), Kind::Even, pair(&|x, v| x * v)),
                (format!("{b}*sin({a})"), Kind::Even, pair(&|x, v| v * x.sin())),
            ] {
                work.push((place, label.clone(), side, text, kind, s));
            }
        }
    }
    let columns: Vec<Option<Vec<f64>>> = work
        .par_chunks(TOGETHER)
        .flat_map_iter(|work| {
            let signals: Vec<_> = work.iter().map(|(place, .., series)| (*place, series.as_slice())).collect();
            model.responses_to(&base.fit.theta, &signals)
        })
        .collect();
    work.into_iter()
        .zip(columns)
        .filter_map(|((_, slot, side, text, kind, _), column)| Some(Term { text, kind, side, slot, column: column? }))
        .collect()
}

/// The sparse correction of what is left of a fitted simulation's residual; `None` where no term is chosen.
pub fn correction(base: &Base<'_>) -> Option<OpenSet> {
    let data = base.model.data();
    let (own, r) = base.evidence();
    let terms = terms(base);
    let whitened: Vec<Vec<f64>> = terms
        .iter()
        .map(|t| {
            let mut w = base.whitener.apply(&data.layout, &t.column);
            own.remove(&mut w);
            w
        })
        .collect();
    let usable: Vec<usize> = (0..terms.len())
        .filter(|&i| {
            let whole = norm2(&base.whitener.apply(&data.layout, &terms[i].column));
            whole.is_finite() && norm2(&whitened[i]) > 1e-8 * whole
        })
        .collect();
    if usable.is_empty() {
        return None;
    }
    let columns: Vec<Vec<f64>> = usable.iter().map(|&i| whitened[i].clone()).collect();
    let phi = Matrix::from_columns(&columns)?;
    let criterion = Criterion::Press(PressForm::Exact);
    let selection = select(&phi, &r, &Selecting { criterion, max_terms: MOST_TERMS, ..Selecting::default() }).ok()?;
    if selection.terms.is_empty() {
        return None;
    }
    let chosen: Vec<usize> = selection.terms.iter().map(|&j| usable[j]).collect();

    // Judged on blocks: coefficients from the others.
    let weights = held_out_blocks(&data.layout, &data.y);
    let picked: Vec<&Vec<f64>> = chosen.iter().map(|&i| &whitened[i]).collect();
    let coefficients = solve(&picked, &r, &weights);
    let (mut before, mut after) = (0.0, 0.0);
    for row in (0..r.len()).filter(|&i| weights[i] == 0.0) {
        let fitted: f64 = picked.iter().zip(&coefficients).map(|(c, b)| c[row] * b).sum();
        before += r[row] * r[row];
        after += (r[row] - fitted).powi(2);
    }
    let block_ratio = if before > 0.0 { (after / before).sqrt() } else { 1.0 };

    let everywhere = vec![1.0; r.len()];
    let coefficients = solve(&picked, &r, &everywhere);
    let records = chosen
        .iter()
        .zip(&coefficients)
        .zip(&selection.steps)
        .map(|((&i, c), step)| TermRecord { term: terms[i].text.clone(), coefficient: *c, err: step.err })
        .collect();
    let strongest = &terms[chosen[0]];
    let signature = signature(base, &terms, &own, &r, &chosen, &coefficients);
    Some(OpenSet {
        record: CorrectionRecord { slot: strongest.slot.clone(), terms: records, signature, ratio: None },
        block_ratio,
    })
}

/// Weighted least squares with a little ridge.
fn solve(columns: &[&Vec<f64>], r: &[f64], weights: &[f64]) -> Vec<f64> {
    let k = columns.len();
    let weighted: Vec<Vec<f64>> = columns.iter().map(|c| c.iter().zip(weights).map(|(c, w)| c * w).collect()).collect();
    let gram = nalgebra::DMatrix::from_fn(k, k, |a, b| {
        dot(&weighted[a], &weighted[b]) * if a == b { 1.0 + 1e-9 } else { 1.0 }
    });
    let rhs = nalgebra::DVector::from_fn(k, |a, _| dot(&weighted[a], r));
    gram.cholesky().map_or_else(|| vec![0.0; k], |c| c.solve(&rhs).iter().copied().collect())
}

/// The signature: which families of terms see the residual.
fn signature(
    base: &Base<'_>,
    terms: &[Term],
    own: &crate::evidence::Projector,
    r: &[f64],
    chosen: &[usize],
    coefficients: &[f64],
) -> SignatureRecord {
    let data = base.model.data();
    let total = norm2(r);
    let family = |wanted: &dyn Fn(&Term) -> bool| -> f64 {
        let columns: Vec<Vec<f64>> = terms.iter().filter(|t| wanted(t)).map(|t| t.column.clone()).collect();
        if columns.is_empty() {
            return f64::NEG_INFINITY;
        }
        FeatureGroup::new(&columns, &data.layout, &base.whitener, own)
            .map_or(f64::NEG_INFINITY, |g| score(total, g.explained(r), r.len(), g.columns.len()))
    };
    let plant = |t: &Term| t.side == "plant";
    let fixed = family(&|t| plant(t) && matches!(t.kind, Kind::Odd | Kind::Even));
    let play = family(&|t| t.kind == Kind::Play);
    let lag = family(&|t| plant(t) && t.kind == Kind::Lag);
    let memory = if play.max(lag) <= fixed + 6.0 {
        "none"
    } else if play >= lag {
        "rate_independent"
    } else {
        "rate_dependent"
    };
    let side = ["plant", "input", "output"]
        .into_iter()
        .map(|s| (s, family(&|t| t.side == s && t.kind != Kind::Time)))
        .chain([("time", family(&|t| t.kind == Kind::Time))])
        .fold(("plant", f64::NEG_INFINITY), |best, x| if x.1 > best.1 { x } else { best })
        .0;
    let energy = |wanted: &dyn Fn(Kind) -> bool| -> f64 {
        chosen
            .iter()
            .zip(coefficients)
            .filter(|(i, _)| wanted(terms[**i].kind))
            .map(|(i, c)| c * c * norm2(&terms[*i].column))
            .sum()
    };
    let (odd, even) = (energy(&|k| k != Kind::Even), energy(&|k| k == Kind::Even));
    let symmetry = if odd > 9.0 * even {
        "odd"
    } else if even > 9.0 * odd {
        "even"
    } else {
        "mixed"
    };
    SignatureRecord {
        memory: memory.into(),
        rate_dependent: memory == "rate_dependent",
        symmetry: symmetry.into(),
        side: side.into(),
    }
}

/// The direction of a generic signal.
pub fn direction(place: Place, series: &[f64]) -> Direction<'_> {
    Direction::Injection(Injection { slot: place, series })
}
