//! Periods over the position to which the residual points: where a force that returns with the position is looked for.
//!
//! Of many turns no grid of periods is fine enough: two periods are apart where they part by half a turn over the whole travel. By the adjoint of the
//! simulation the score of a force at each instant costs one run; summed up by the position at that instant, it is a signal over the position whose
//! periodogram has a line at every period that the residual holds, against those that noise makes there (order tracking).
//!
//! The positions are those of the simulation: where it strays by a good part of a period, as a drive without a loop does, the line is smeared, and shows
//! along the recorded motion only ([`super::tracked`]).
//!
//! Reference: K. R. Fyfe, E. D. S. Munck, Analysis of computed order tracking, Mech. Syst. Signal Process. 11 (1997) 187-205.

use hysid_plant::{Expr, Input};
use hysid_signal::range;
use rand_distr::{Distribution, StandardNormal};

use crate::evidence::{lines, quantile};
use crate::model::base::Base;
use crate::model::{Model, along};
use crate::random::generator;
use crate::slot::{Place, Slot, Structure, Target};

/// Most slots that are looked at, and periods at each.
const MOST: (usize, usize) = (3, 4);
/// Scores of noise against which that of the residual is held, and the stream that it is drawn from.
const NOISES: usize = 5;
const STREAM: u64 = 0x9 << 56;
/// Power over that of noise from which a line is one.
const HEIGHT: f64 = 8.0;
/// Height of the middle one of the lines that noise has.
const OF_NOISE: f64 = 2.0;
/// Turns over the travel from which the grid of the law is too coarse, and beyond which nothing is looked for.
const TURNS: (f64, f64) = (4.0, 2000.0);
/// Way of a sample, in periods, at which a period can no longer be told from a longer one.
const WAY: f64 = 0.4;
/// Places in each of the shortest periods.
const PLACES: f64 = 3.0;

/// For each slot of a structure the periods over its displacement at which the whitened residual `r`, off the tangent space of the unknowns, has lines;
/// none where nothing moves far enough.
pub fn residual_periods(base: &Base<'_>, structure: &Structure, r: &[f64]) -> Vec<Vec<f64>> {
    let mut out = vec![Vec::new(); structure.slots.len()];
    let position = |s: &Slot| Some(s.quantity(s.coordinate()?)?.expression.clone());
    let moves = |s: &Slot| matches!(s.place, Place::Force | Place::ForceLaw) && position(s).is_some();
    let places: Vec<usize> = (0..structure.slots.len()).filter(|&i| moves(&structure.slots[i])).take(MOST.0).collect();
    let positions: Vec<Expr> = places.iter().filter_map(|&i| position(&structure.slots[i])).collect();
    let Some(along) = along(base, &positions).filter(|_| !places.is_empty()) else { return out };
    let rulers: Vec<Option<Ruler>> = along.iter().map(|x| Ruler::of(x)).collect();
    if rulers.iter().all(Option::is_none) {
        return out;
    }
    let Some(scores) = scores(base, places.iter().map(|&i| &structure.slots[i]), r) else { return out };
    for (k, (&i, ruler)) in places.iter().zip(&rulers).enumerate() {
        let Some(ruler) = ruler else { continue };
        let mut over = scores.iter().map(|of| ruler.sums(&along[k], &of[k]));
        let Some(residual) = over.next() else { continue };
        let noises: Vec<Vec<f64>> = over.collect();
        let all = lines(&residual, &noises, usize::MAX);
        // Where the simulation strays or drifts every line is high: one must stand out of the others too.
        let others = all.get(all.len() / 2).map_or(0.0, |l| l.height / OF_NOISE);
        let found = all.iter().take(MOST.1).filter(|l| l.height > HEIGHT * others.max(1.0));
        let periods = found.map(|l| ruler.place / l.cycles).filter(|p| ruler.travel > TURNS.0 * p);
        out[i] = periods.collect();
        out[i].sort_by(f64::total_cmp);
    }
    out
}

/// The score of a force at each of these slots at each instant, of the residual and of noise: `[residual][slot][stretch][sample]`.
fn scores<'s>(base: &Base<'_>, slots: impl Iterator<Item = &'s Slot>, r: &[f64]) -> Option<Vec<Vec<Vec<Vec<f64>>>>> {
    let mut document = base.document();
    let own = document.inputs.len();
    for slot in slots {
        let name = document.fresh_symbol("push");
        document.inputs.push(Input { symbol: name.clone(), column: name.clone() });
        let push = Expr::symbol(&name);
        match &slot.target {
            Target::Derivatives(states) => {
                let state = document.state_mut(&states.first()?.state)?;
                state.derivative = state.derivative.clone() + push;
            }
            Target::Output(column) => {
                let output = document.output_mut(column)?;
                output.expression = output.expression.clone() + push;
            }
            Target::Symbol(_)
            | Target::SymbolIn(..)
            | Target::PartIn(..)
            | Target::HalfWidths(_)
            | Target::Outputs(_) => return None,
        }
    }
    let data = base.model.data().with_still_inputs(document.inputs.len() - own);
    let model = Model::new(&document, &data, base.model.substeps()).ok()?;
    let mut rng = generator(0, STREAM);
    let white = (0..NOISES).map(|_| (0..r.len()).map(|_| StandardNormal.sample(&mut rng)).collect::<Vec<f64>>());
    let all: Vec<Vec<f64>> = std::iter::once(r.to_vec()).chain(white).collect();
    let mut scores = model.scores(&model.theta(&base.values()), &base.whitener, &all)?;
    scores.iter_mut().for_each(|by_input| drop(by_input.drain(..own)));
    Some(scores)
}

/// The travel, divided into places.
struct Ruler {
    from: f64,
    travel: f64,
    place: f64,
}

impl Ruler {
    fn of(x: &[Vec<f64>]) -> Option<Self> {
        let all = || x.iter().flatten().copied();
        let (from, to) = range(all());
        let travel = to - from;
        if !(travel > 0.0 && travel.is_finite()) {
            return None;
        }
        let mut ways: Vec<f64> = x.iter().flat_map(|x| x.windows(2).map(|w| (w[1] - w[0]).abs())).collect();
        ways.sort_by(f64::total_cmp);
        let shortest = (quantile(&ways, 0.5)? / WAY).max(travel / TURNS.1);
        (travel > TURNS.0 * shortest).then_some(Self { from, travel, place: shortest / PLACES })
    }

    /// The sums of a score over the places, shared between the two nearest.
    fn sums(&self, x: &[Vec<f64>], score: &[Vec<f64>]) -> Vec<f64> {
        let mut out = vec![0.0; (self.travel / self.place) as usize + 2];
        for (x, s) in x.iter().flatten().zip(score.iter().flatten()) {
            let at = (x - self.from) / self.place;
            let (i, share) = (at as usize, at.fract());
            if let Some([a, b]) = out.get_mut(i..i + 2) {
                *a += (1.0 - share) * s;
                *b += share * s;
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::normal;

    /// A drive that a loop makes turn many times, integrated by hand, with a ripple of that period.
    fn periods(amplitude: f64, period: f64) -> Vec<f64> {
        let text = "[time]\nperiod_s = 0.01\n[inputs]\nr = \"ref_rad_s\"\n[parameters]\nJ = { value = 0.05, min = 0.01 }\nb = { value = 0.1, min = 0.0 }\n\
                    [states]\nq = { derivative = \"w\", initial = 0.0, unit = \"rad\" }\nw = { derivative = \"(2*(r - w) - b*w)/J\", initial = 0.0, unit = \"rad/s\" }\n[outputs]\nw_rad_s = \"w\"\n";
        let simulation = Simulation::parse(text, "drive.sim.toml").unwrap();
        let n = 3000;
        let mut random = normal(11);
        let u: Vec<f64> = (0..n).map(|i| 8.0 * (0.011 * i as f64).sin() + 3.0 * (0.037 * i as f64).cos()).collect();
        let (mut q, mut w, steps) = (0.0_f64, 0.0_f64, 40);
        let mut y = Vec::new();
        for u in &u {
            y.push(w + 0.05 * random());
            for _ in 0..steps {
                let dt = 0.01 / steps as f64;
                w += dt * (2.0 * (u - w) - 0.1 * w - amplitude * (std::f64::consts::TAU * q / period).sin()) / 0.05;
                q += dt * w;
            }
        }
        let data = recorded(&simulation, 0.01, [("ref_rad_s", u), ("w_rad_s", y)]);
        let budget = Budget::new(&|_| false);
        let (_, none) = calibrated(simulation, &data, NoiseKind::White(1.0), &budget);
        let structure = Structure::of(none.base.model.simulation());
        residual_periods(&none.base, &structure, &none.base.evidence().1).concat()
    }

    #[test]
    fn a_ripple_of_many_turns_is_found_between_the_points_of_any_grid() {
        let period = 0.52;
        let found = periods(0.03, period);
        assert!(found.iter().any(|p| (p / period - 1.0).abs() < 2e-3), "{found:?}");
        let nothing = periods(0.0, period);
        assert!(nothing.len() < 2, "{nothing:?}");
    }
}
