//! Which families compete: products of lags, reversals, presliding friction on the inputs.

use hysid_dictionary::{Factor, Signal};
use hysid_narx::{Derived, Law};

use super::desk::Desk;
use super::family::{Atom, Family, count, lag_atoms, linear, products, reversal_atoms};
use super::linear::{Linear, best, shortest_good};
use super::options::Factors;

/// Lags of which products are formed, at most.
const PRODUCT_LAGS: usize = 5;
/// Lags up to which reversals are tried.
const REVERSAL_LAGS: usize = 3;
/// Candidates of one family, at most.
const MOST_CANDIDATES: usize = 560;
/// Beside more linear terms than this only products of lags are tried.
const MOST_LINEAR: usize = 60;
/// Presliding lengths that are tried, as shares of the input's standard deviation.
const PRESLIDING: [f64; 3] = [0.05, 0.2, 0.8];
/// The degree where the user has not said.
const DEGREE: usize = 3;

/// The families for these linear models.
pub(crate) fn families(desk: &Desk<'_>, ladder: &[Linear]) -> Vec<Family> {
    let options = desk.options;
    let mut lags: Vec<(usize, usize)> = Vec::new();
    if options.lags_output.is_none() && options.lags_input.is_none() {
        lags.extend([(1, 1), (2, 2), (3, 3), (5, 5)]);
    }
    for l in [shortest_good(ladder), best(ladder)].into_iter().flatten() {
        lags.push((l.family.ny, l.family.nu));
    }
    let mut seen = std::collections::HashSet::new();
    lags.retain(|l| seen.insert(*l));
    lags.into_iter().flat_map(|(ny, nu)| of_lags(desk, ny, nu)).collect()
}

fn of_lags(desk: &Desk<'_>, ny: usize, nu: usize) -> Vec<Family> {
    let options = desk.options;
    let inputs = desk.inputs();
    let degree = options.degree.unwrap_or(DEGREE);
    let first = options.input_delay.unwrap_or(0);
    let start = linear(inputs, ny, first..=nu);
    let atoms = lag_atoms(inputs, ny.min(PRODUCT_LAGS), first..=nu.min(PRODUCT_LAGS));
    let make = |name: &str, derived: Vec<Derived>, mut atoms: Vec<Atom>| {
        // The atoms at the end are the longest lags of the last input.
        while count(atoms.len(), degree) > MOST_CANDIDATES && atoms.len() > 3 {
            atoms.pop();
        }
        let candidates = products(&atoms, degree);
        Family { name: format!("{name}, lags {ny} and {nu}"), ny, nu, derived, linear: start.clone(), candidates }
    };
    let mut out = Vec::new();
    if options.factors != Factors::Hysteresis {
        out.push(make("products of lags", vec![], interleaved(ny, nu, first, &atoms)));
    }
    if options.factors == Factors::Polynomial {
        return out;
    }
    // Beside a long linear part only the presliding operators are tried.
    let long = ny > REVERSAL_LAGS && options.factors == Factors::Auto;
    let of_inputs: Vec<Atom> = (0..inputs).flat_map(|i| reversal_atoms(Signal::Input(i), first)).collect();
    if !long {
        out.push(make("input reversals", vec![], [of_inputs.clone(), interleaved(ny, nu, first, &atoms)].concat()));
    }
    if ny > 0 && !long {
        let of_output: Vec<Atom> = (1..=2).flat_map(|l| reversal_atoms(Signal::Output, l)).collect();
        out.push(make("output reversals", vec![], [of_output, interleaved(ny, nu, first, &atoms)].concat()));
    }
    if ny > 1 && !long {
        // Friction depends on the velocity and not on where the machine stands: no level of the output in the products.
        let mut of_velocity: Vec<Atom> = (1..=2).map(|l| vec![Factor::difference(Signal::Output, l)]).collect();
        of_velocity.extend(reversal_atoms(Signal::Output, 1));
        of_velocity.extend(lag_atoms(inputs, 0, first..=nu.min(2)));
        out.push(make("velocity of the output", vec![], of_velocity));
    }
    if start.len() > MOST_LINEAR && options.factors == Factors::Auto {
        return out;
    }
    let mut derived = Vec::new();
    let mut with: Vec<Atom> = Vec::new();
    for i in 0..inputs {
        let std = desk.input(i).map_or(0.0, |s| s.std);
        for length in PRESLIDING.iter().map(|p| p * std).filter(|l| *l > 0.0) {
            with.push(vec![Factor::value(Signal::Input(inputs + derived.len()), first)]);
            derived.push(Derived { symbol: format!("w{}", derived.len() + 1), source: i, law: Law::Dahl { length } });
        }
    }
    if !derived.is_empty() {
        out.push(make(
            "presliding",
            derived,
            [with, of_inputs, interleaved(ny.min(2), nu.min(2), first, &atoms)].concat(),
        ));
    }
    out
}

/// The atoms of all signals, short lags first, so that what is cut off at the end is long lags of every signal.
fn interleaved(ny: usize, nu: usize, first: usize, atoms: &[Atom]) -> Vec<Atom> {
    let mut sorted: Vec<Atom> = atoms
        .iter()
        .filter(|a| a[0].lag <= if a[0].quantity.signal() == Signal::Output { ny } else { nu.max(first) })
        .cloned()
        .collect();
    sorted.sort_by_key(|a| match a[0].quantity.signal() {
        Signal::Output => (a[0].lag, 0),
        Signal::Input(i) => (a[0].lag, i + 1),
    });
    sorted
}
