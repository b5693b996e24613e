//! Block structures: a filter, a threshold, a filter. Where does the linear model's memory lie, before or after the threshold?
//!
//! A Wiener-Hammerstein system (also Wiener, also Hammerstein) has the poles of its best linear approximation shared between
//! the filter before its nonlinearity and the one after it. Every way of sharing them is a start: the poles before make a
//! derived input ([`Law::Filter`]), those after are output lags, and between stands a rounded threshold
//! ([`Law::SoftThreshold`]). Each start is refined a little, the best ones more. Reference: Sjoberg, Lauwers and Schoukens,
//! *Automatica* 48 (2012) 2688.

use hysid_dictionary::{Factor, Signal, Term};
use hysid_narx::{Derived, Law, Refine, multiply_factors, pole_factors};
use rayon::prelude::*;

use super::IdentifyError;
use super::data::spread;
use super::desk::Desk;
use super::family::{Atom, Family, lag_atoms, products};
use super::growth::{Stage, start_from};
use super::linear::Linear;
use super::options::Factors;

/// Samples of the first and the second look at the starts.
const LOOKS: [usize; 2] = [1500, 4000];
/// Refinement steps of the two looks.
const STEPS: [usize; 2] = [4, 25];
/// Starts that get the second look.
const KEPT: usize = 4;
/// Orders of linear models whose poles are shared.
const ORDERS: std::ops::RangeInclusive<usize> = 2..=6;
/// Where the corner lies at first, in standard deviations of the filtered input from its mean.
const CORNERS: [f64; 2] = [-0.6, 0.6];

/// The best block structure, refined, with the terms that may join; `None` where the kind does not apply or none is stable.
pub(crate) fn best_block(desk: &Desk<'_>, ladder: &[Linear]) -> Result<Option<(Family, Stage)>, IdentifyError> {
    if desk.inputs() != 1 || desk.options.factors != Factors::Auto || desk.options.degree == Some(1) {
        return Ok(None);
    }
    let starts: Vec<Family> = ladder
        .iter()
        .filter(|l| ORDERS.contains(&l.family.ny) && desk.options.lags_output.is_none_or(|o| o == l.family.ny))
        .flat_map(|l| starts(desk, l))
        .collect();
    let mut kept = look(desk, starts.into_iter().map(|f| (f, None)).collect(), 0)?;
    kept.truncate(KEPT);
    let kept = look(desk, kept.into_iter().map(|(f, s)| (f, Some(s))).collect(), 1)?;
    Ok(kept.into_iter().next())
}

/// All starts refined, best first.
fn look(
    desk: &Desk<'_>,
    starts: Vec<(Family, Option<Stage>)>,
    round: usize,
) -> Result<Vec<(Family, Stage)>, IdentifyError> {
    let done: Vec<Option<(Family, Stage)>> = starts
        .into_par_iter()
        .map(|(family, before)| {
            desk.go_on()?;
            let mut trainer = desk.trainer(&family.derived, family.given())?;
            let s = desk.split(&trainer, LOOKS[round])?;
            let from = before.map(|b| b.fit);
            let what = Refine::CoefficientsAndDerived;
            let stage = start_from(&mut trainer, &family, from, &s.search, &s.hold, STEPS[round], what)?;
            Ok::<_, IdentifyError>(stage.map(|s| (family, s)))
        })
        .collect::<Result<_, _>>()?;
    let mut found: Vec<(Family, Stage)> = done.into_iter().flatten().collect();
    found.sort_by(|a, b| a.1.held.rmse.total_cmp(&b.1.held.rmse));
    Ok(found)
}

/// Every way of sharing one linear model's poles, with each corner; none where its poles cannot be found.
fn starts(desk: &Desk<'_>, linear: &Linear) -> Vec<Family> {
    let mut a = vec![0.0; linear.family.ny];
    for (term, theta) in linear.stage.fit.terms.iter().zip(&linear.stage.fit.theta) {
        if let [Factor { quantity, lag }] = term.factors()
            && quantity.signal() == Signal::Output
        {
            a[lag - 1] = -theta;
        }
    }
    let Some(factors) = pole_factors(&a) else { return Vec::new() };
    let first = desk.options.input_delay.unwrap_or(0);
    let mut out = Vec::new();
    for choice in 0..1usize << factors.len() {
        let share =
            |side: usize| factors.iter().enumerate().filter(move |(i, _)| choice >> i & 1 == side).map(|(_, f)| f);
        let (before, after) = (multiply_factors(share(1)), multiply_factors(share(0)));
        let filter = Law::Filter { a: before.clone() };
        if filter.problem().is_some() {
            continue;
        }
        for corner in CORNERS {
            out.extend(family(desk, &filter, before.is_empty(), after.len(), corner, first));
        }
    }
    out
}

fn family(desk: &Desk<'_>, filter: &Law, plain: bool, ny: usize, corner: f64, first: usize) -> Option<Family> {
    let mut derived = Vec::new();
    let mut source = Signal::Input(0);
    let mut filtered: Vec<f64> = Vec::new();
    for s in &desk.samples {
        let mut out = vec![0.0; s.inputs[0].len()];
        filter.respond(&s.inputs[0], &mut out);
        filtered.extend(out);
    }
    if !plain {
        derived.push(Derived { symbol: "x".into(), source: 0, law: filter.clone() });
        source = Signal::Input(1);
    }
    let s = spread(filtered.iter())?;
    let at = usize::from(!plain);
    let law = Law::SoftThreshold { centre: s.mean + corner * s.std, width: 0.15 * s.std };
    law.problem().is_none().then_some(())?;
    derived.push(Derived { symbol: "w".into(), source: at, law });
    let clipped = Signal::Input(at + 1);
    let last = ny.max(1) + first;
    let lags: Vec<Atom> =
        [source, clipped].into_iter().flat_map(|s| (first..=last).map(move |l| vec![Factor::value(s, l)])).collect();
    let mut linear = vec![Term::constant()];
    linear.extend(lag_atoms(0, ny, 0..=0).iter().chain(&lags).map(|a| Term::new(a.iter().copied())));
    let near: Vec<Atom> = lags.iter().filter(|a| a[0].lag <= first + 3).cloned().collect();
    let candidates = products(&near, desk.options.degree.unwrap_or(3));
    Some(Family { name: "filter, threshold, filter".into(), ny, nu: last, derived, linear, candidates })
}
