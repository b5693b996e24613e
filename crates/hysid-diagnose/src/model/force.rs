//! The ways by which an unknown force or flow reaches the outputs of a simulation: its equations linearised along its trajectory.
//!
//! A force enters where the catalogue's disturbances do: the derivative of a velocity, or of what is stored. The equations are linearised at
//! instants that are spread over the recordings, and each coefficient's mean is taken over the middle half of the instants: where dry
//! friction holds for some of them, or its smoothed sign is steep, the moving ones decide. The error of a simulation that follows the recorded input
//! has the response of the simulation as it is: a loop that the simulation contains is closed in it, one behind the recorded input is not.

use std::cell::{LazyCell, RefCell};
use std::collections::BTreeMap;
use std::sync::Arc;

use hysid_plant::{Linearisation, Simulation};
use nalgebra::{DMatrix, DVector, Schur};

use super::Model;
use super::base::MAX_AR;
use super::course::{Along, changes};
use crate::evidence::{CommonPath, Course, ForcePath, ForcePaths, Whitener};
use crate::slot::{Place, Structure, Target};

/// Iterations for each state in which eigenvalues are found.
const MOST_ITERATIONS: usize = 100;
/// Instants at which the equations are linearised.
const INSTANTS: usize = 24;
/// Most states at which a force may enter.
const MOST: usize = 3;

/// Names of the states whose derivative an unknown force or flow may enter.
pub fn pushed(simulation: &Simulation) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for slot in Structure::of(simulation).slots.iter().filter(|s| s.place == Place::Disturbance) {
        if let Target::Derivatives(states) = &slot.target {
            names.extend(states.iter().map(|pull| pull.state.clone()));
        }
    }
    names.truncate(MOST);
    names
}

/// The noise of what a simulation leaves, with the ways of a force to its outputs: row by row along its trajectory where the noise is that of such a force, which
/// the equations answer differently along it.
pub fn noise_of(model: &Model<'_>, theta: &[f64], residual: &[f64], pushed: &[String]) -> (Whitener, ForcePaths) {
    let layout = &model.data().layout;
    let Some(ways) = Ways::of(model, theta, pushed) else {
        let none = ForcePaths::default();
        return (layout.fit_noise(residual, MAX_AR, &none), none);
    };
    let paths = ways.paths(model);
    let along = LazyCell::new(|| changes(&ways.points).then(|| Along::of(model, theta)).flatten());
    let asked: RefCell<BTreeMap<(usize, usize), Option<Arc<Course>>>> = RefCell::default();
    let course = |output: usize, way: usize| {
        let mut asked = asked.borrow_mut();
        let made = || along.as_ref()?.course(model, paths[output][way].entry(), output).map(Arc::new);
        asked.entry((output, way)).or_insert_with(made).clone()
    };
    let together: RefCell<Vec<Arc<CommonPath>>> = RefCell::default();
    let several = |entry: usize| {
        if layout.outputs < 2 {
            return None;
        }
        let made = match along.as_ref() {
            Some(along) => along.common(model, entry),
            None => ways.common(model, entry),
        };
        let path = Arc::new(made?);
        together.borrow_mut().push(Arc::clone(&path));
        Some(path)
    };
    let noise = layout.fit_noise_along(residual, MAX_AR, &paths, course, several);
    let mut common = together.into_inner();
    common.retain(|path| noise.common_from() == Some(path.entry()));
    let asked = asked.into_inner();
    // A course takes as much memory as a few tangents: that of the noise itself is kept.
    let kept = |output: usize, (way, path): (usize, ForcePath)| {
        let own = noise.models[output].moving_from() == Some(path.entry());
        let course = asked.get(&(output, way)).filter(|_| own).cloned().flatten();
        path.along(course)
    };
    let of_output =
        |(output, ways): (usize, Vec<ForcePath>)| ways.into_iter().enumerate().map(|path| kept(output, path)).collect();
    let each = paths.into_iter().enumerate().map(of_output).collect();
    (noise, ForcePaths { each, common })
}

/// The equations at instants of a simulation, and the states at which a force may enter.
struct Ways {
    entries: Vec<usize>,
    points: Vec<Linearisation>,
}

impl Ways {
    /// `None` where no force enters, or the simulation diverges.
    fn of(model: &Model<'_>, theta: &[f64], pushed: &[String]) -> Option<Self> {
        let states = &model.simulation().states;
        let entries: Vec<usize> =
            pushed.iter().filter_map(|name| states.iter().position(|s| s.name == *name)).collect();
        if entries.is_empty() {
            return None;
        }
        let points = model.linearised(theta, INSTANTS);
        (!points.is_empty()).then_some(Self { entries, points })
    }

    /// What the states and the outputs are made of, as they are for most of the time: by rows.
    fn middle(&self, model: &Model<'_>) -> (Vec<f64>, Vec<f64>) {
        let n = model.simulation().states.len();
        let c = (0..n * model.simulation().outputs.len()).map(|i| middle(self.points.iter().map(|p| p.c[i])));
        (middle_flow(&self.points, n), c.collect())
    }

    /// The mean way from each entry to each output.
    fn paths(&self, model: &Model<'_>) -> Vec<Vec<ForcePath>> {
        let (a, c) = self.middle(model);
        let period_s = model.data().row_period_s();
        c.chunks_exact(model.simulation().states.len())
            .map(|c| self.entries.iter().filter_map(|&entry| ForcePath::held(&a, entry, c, period_s)).collect())
            .collect()
    }

    /// The mean way from an entry to all outputs that it reaches; `None` where these are fewer than two.
    fn common(&self, model: &Model<'_>, entry: usize) -> Option<CommonPath> {
        let (a, c) = self.middle(model);
        let data = model.data();
        CommonPath::held((&a, &c), entry, data.row_period_s(), |outputs| {
            data.layout.together(outputs.iter().copied()).iter().map(|run| run[0].rows.len()).collect()
        })
    }
}

/// The matrix of the state derivatives by the states, by rows, as it is for most of the time.
fn middle_flow(points: &[Linearisation], states: usize) -> Vec<f64> {
    (0..states * states).map(|i| middle(points.iter().map(|p| p.a[i]))).collect()
}

/// The eigenvalues of a simulation that swing, as it moves for most of the time: real and imaginary part, in 1/s, of one of each pair.
pub fn resonances(model: &Model<'_>, theta: &[f64]) -> Vec<[f64; 2]> {
    let (n, points) = (model.simulation().states.len(), model.linearised(theta, INSTANTS));
    let a = middle_flow(&points, n);
    if n == 0 || points.is_empty() || !a.iter().all(|x| x.is_finite()) {
        return Vec::new();
    }
    let form = Schur::try_new(DMatrix::from_row_slice(n, n, &a), f64::EPSILON, MOST_ITERATIONS * n);
    let all = form.map_or_else(|| DVector::zeros(0), |form| form.complex_eigenvalues());
    all.iter().filter(|l| l.im > 0.0).map(|l| [l.re, l.im]).collect()
}

/// Whether the simulation forgets by itself where it was, all along the recording: there are units for its states in which each falls back, at any
/// moment, by more than all others can push it. Two runs that begin apart come together then, whatever drives them, as levels and temperatures do, also
/// where stores exchange what they hold; a force that nobody recorded never parts such a simulation from its machine.
///
/// References: G. Russo, M. di Bernardo, E. D. Sontag, PLoS Comput. Biol. 6 (2010) e1000739 (contraction in a weighted maximum norm); A. Berman,
/// R. J. Plemmons, Nonnegative Matrices in the Mathematical Sciences, SIAM (1994), ch. 6 (such units are there where the matrix of the least that falls
/// back and the most that pushes is an M-matrix).
pub fn forgets(model: &Model<'_>, theta: &[f64]) -> bool {
    let n = model.simulation().states.len();
    let points = model.linearised(theta, INSTANTS);
    let most = |at: usize| {
        let own = at / n == at % n;
        let all = points.iter().map(|p| if own { p.a[at] } else { p.a[at].abs() });
        all.fold(f64::NEG_INFINITY, |a, b| if b.is_nan() { b } else { a.max(b) })
    };
    !points.is_empty() && is_m_matrix((0..n * n).map(|at| -most(at)).collect(), n)
}

/// Whether a square matrix without positive elements beside its diagonal is a regular M-matrix: elimination leaves nothing but positive pivots.
fn is_m_matrix(mut m: Vec<f64>, n: usize) -> bool {
    for k in 0..n {
        let pivot = m[k * n + k];
        if pivot.is_nan() || pivot <= 0.0 {
            return false;
        }
        for i in k + 1..n {
            let share = m[i * n + k] / pivot;
            for j in k..n {
                m[i * n + j] -= share * m[k * n + j];
            }
        }
    }
    true
}

/// The mean of the middle half.
fn middle(values: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = values.filter(|x| x.is_finite()).collect();
    all.sort_by(f64::total_cmp);
    let quarter = all.len() / 4;
    let half = &all[quarter..all.len() - quarter];
    half.iter().sum::<f64>() / half.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::DataSet;
    use crate::model::Values;
    use hysid_plant::Drive;

    /// What is asked of states with these derivatives and initial values, the first of them (the input where there is none) recorded, under an input that goes to and fro around a mean.
    fn asked<T>(states: &[(&str, &str, f64)], mean: f64, ask: impl Fn(&Model<'_>, &[f64]) -> T) -> T {
        let list: String = (states.iter())
            .map(|(name, derivative, initial)| {
                format!("{name} = {{ derivative = \"{derivative}\", initial = {initial:?} }}\n")
            })
            .collect();
        let seen = states.first().map_or("b*u", |s| s.0);
        let text = format!(
            "[time]\nperiod_s = 0.05\n[inputs]\nu = \"u_Nm\"\n[parameters]\nb = {{ value = 0.5, min = 0.0 }}\n[states]\n{list}[outputs]\nq_rad = \"{seen}\"\n"
        );
        let simulation = Simulation::parse(&text, "drive.sim.toml").unwrap();
        let u: Vec<f64> = (0..600).map(|n| mean + 3.0 * (n as f64 * 0.07).sin()).collect();
        let drive = Drive::new(0.0, 0.05, u.len(), vec![u.clone()]).unwrap();
        let data = DataSet::of_drive(drive, vec![vec![0.0; u.len()]], 0.05);
        let model = Model::new(&simulation, &data, 2).unwrap();
        ask(&model, &model.theta(&Values::default()))
    }

    /// Of a drive with dry friction that is pushed to and fro, sticking for part of the time; the state of a loop where there is one.
    fn paths(force: &str) -> Vec<Vec<ForcePath>> {
        let states = [("q", "w", 0.0), ("w", &*format!("({force})/2"), 0.0)];
        asked(&states, 0.0, |model, theta| {
            let names = pushed(model.simulation());
            assert_eq!(names, ["w"]);
            Ways::of(model, theta, &names).unwrap().paths(model)
        })
    }

    fn by_hand(stiffness: f64) -> Vec<Vec<ForcePath>> {
        vec![vec![ForcePath::held(&[0.0, 1.0, -stiffness, -0.25], 1, &[1.0, 0.0], 0.05).unwrap()]]
    }

    #[test]
    fn a_drive_with_friction_answers_as_it_does_while_it_moves() {
        assert_eq!(paths("u - b*w - sign(w)"), by_hand(0.0));
    }

    #[test]
    fn a_loop_in_the_simulation_is_closed() {
        assert_eq!(paths("8*(u - q) - b*w"), by_hand(4.0));
    }

    #[test]
    fn resonances_are_those_of_the_characteristic_polynomial() {
        // 2 q'' + 0.5 q' + 8 q beside a lag, and a drive that nothing holds.
        let swings = [("q", "w", 0.0), ("w", "(8*(u - q) - b*w)/2", 0.0), ("s", "q - 3*s", 0.0)];
        let [[re, im]] = asked(&swings, 0.0, resonances)[..] else { panic!("one pair") };
        assert!((re + 0.125).abs() < 1e-9 && (im - (4.0_f64 - 0.125 * 0.125).sqrt()).abs() < 1e-9, "{re} {im}");
        assert!(asked(&swings[..2], 0.0, |m, _| resonances(m, &[f64::NAN])).is_empty());
        assert!(asked(&[("q", "w", 0.0), ("w", "(u - b*w)/2", 0.0)], 0.0, resonances).is_empty());
        assert!(asked(&[], 0.0, resonances).is_empty(), "a static relation");
    }

    #[test]
    fn what_is_stored_forgets_and_what_swings_sticks_or_adds_up_does_not() {
        let forgets = |states: &[(&str, &str, f64)]| asked(states, 4.0, forgets);
        assert!(forgets(&[("h", "u - 2*sqrt(h)", 2.0)]));
        // One tank into the next, in whatever order they are written.
        assert!(forgets(&[("g", "2*sqrt(h) - b*g*g", 2.0), ("h", "u - 2*sqrt(h)", 2.0)]));
        // Two that exchange what they hold, of which one leaks through a valve that the input moves.
        assert!(forgets(&[("g", "u - 3*(g - h)", 2.0), ("h", "3*(g - h) - 0.1*u*h", 2.0)]));
        assert!(!forgets(&[("g", "u - 3*(g - h)", 2.0), ("h", "3*(g - h) - u", 2.0)]), "what both hold adds up");
        assert!(!forgets(&[("g", "2*sqrt(h) - b*g*g", 2.0), ("h", "u - 2*sqrt(h) - 5*g", 2.0)]), "a loop");
        assert!(!forgets(&[("q", "w", 0.0), ("w", "u - b*w - sign(w)", 0.0)]), "a position adds up");
        assert!(!forgets(&[("q", "w", 0.0), ("w", "u - b*w - 4*q^3", 0.0)]), "a spring");
        assert!(!forgets(&[("h", "u - 4 - 0.3*h^3 + 0.9*h", 0.1)]), "two places of rest");
    }

    #[test]
    fn m_matrices_are_known_by_their_pivots() {
        // By the inverse: it has no negative element.
        assert!(is_m_matrix(vec![2.0, -1.0, -1.0, 2.0], 2) && !is_m_matrix(vec![1.0, -1.0, -1.0, 1.0], 2));
        assert!(!is_m_matrix(vec![2.0, -3.0, -1.0, 1.0], 2) && !is_m_matrix(vec![f64::NAN], 1));
        assert!(is_m_matrix(vec![2.0, -1.0, 0.0, -1.0, 2.0, -1.0, 0.0, -1.0, 2.0], 3));
        assert!(!is_m_matrix(vec![2.0, -1.0, -1.0, -1.0, 2.0, -1.0, -1.0, -1.0, 2.0], 3));
    }

    #[test]
    fn moments_of_sticking_do_not_count() {
        let values = [1.0, 1.0, 1e6, 1.0, f64::NAN, 1.0, -1e6, 1.0, 1.0];
        assert_eq!(middle(values.into_iter()), 1.0);
        assert_eq!(middle(std::iter::empty()), 0.0);
    }
}
