//! Operators with memory: plays of several half-widths on each input, and functions of each.
//!
//! A Preisach operator is a sum over half-widths of functions of plays, y = sum_r g_r(w_r) (linear ones for a
//! Prandtl-Ishlinskii operator), so that a static model in plays and their powers, without output lags, approximates any of
//! them; with output lags it is a hysteretic actuator before a dynamic machine. Half-widths are refined. What the plays
//! remembered before the recording began is not recorded: several pasts are tried. References: Krasnosel'skii and
//! Pokrovskii, *Systems with Hysteresis* (1989); Brokate and Sprekels, *Hysteresis and Phase Transitions* (1996), section 2.4.

use hysid_dictionary::{Factor, Signal, Term};
use hysid_narx::{Derived, Law, Past, Refine};
use rayon::prelude::*;

use super::IdentifyError;
use super::data::Spread;
use super::desk::Desk;
use super::family::{Family, linear};
use super::growth::{Stage, start_from};
use super::linear::{Linear, shortest_good};
use super::options::Factors;

/// Half-widths as shares of half the input's range, few and many; a wider play moves on the first way only.
const FEW: &[f64] = &[0.08, 0.25, 0.5, 0.85];
const MANY: &[f64] = &[0.03, 0.06, 0.1, 0.15, 0.21, 0.29, 0.38, 0.48, 0.6, 0.74, 0.9, 1.08];
/// More recorded inputs than this would make too many plays.
const MOST_INPUTS: usize = 3;
/// The largest power of a play or an input, where the user has not said. No output is in it: the run cannot diverge.
const POWER: usize = 5;
/// Output lags of a machine behind the plays, at most.
const MOST_LAGS: usize = 3;
/// How far beyond the recorded range an input may have turned before, as shares of the range.
const BEYOND: [f64; 7] = [0.0, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0];
/// Samples of a look at a past, and refinement steps.
const LOOK: (usize, usize) = (4000, 3);

/// The families of plays, a static one and one with the lags of the linear model where they are short.
pub(crate) fn best_plays(desk: &Desk<'_>, ladder: &[Linear]) -> Result<Vec<(Family, Stage)>, IdentifyError> {
    let options = desk.options;
    if options.factors == Factors::Polynomial || options.degree == Some(1) || desk.inputs() > MOST_INPUTS {
        return Ok(Vec::new());
    }
    let first = options.input_delay.unwrap_or(0);
    let mut lags = vec![(options.lags_output.unwrap_or(0), options.lags_input.unwrap_or(first))];
    if let Some(l) = shortest_good(ladder).filter(|l| l.family.ny <= MOST_LAGS) {
        lags.push((l.family.ny, l.family.nu));
    }
    lags.dedup();
    let kinds = lags.into_iter().flat_map(|l| [(l, FEW), (l, MANY)]);
    kinds.map(|((ny, nu), shares)| of_shares(desk, ny, nu, shares)).filter_map(Result::transpose).collect()
}

/// The family with plays of these half-widths and the past that explains the teaching blocks best: it is a number of theirs.
fn of_shares(desk: &Desk<'_>, ny: usize, nu: usize, shares: &[f64]) -> Result<Option<(Family, Stage)>, IdentifyError> {
    let done: Vec<Option<(Family, Stage)>> = pasts(desk)
        .into_par_iter()
        .map(|past| {
            desk.go_on()?;
            let family = family(desk, ny, nu, shares, &past);
            let mut trainer = desk.trainer(&family.derived, family.given())?;
            let s = desk.split(&trainer, LOOK.0)?;
            let stage = start_from(&mut trainer, &family, None, &s.search, &s.hold, LOOK.1, Refine::Coefficients)?;
            Ok::<_, IdentifyError>(stage.map(|s| (family, s)))
        })
        .collect::<Result<_, _>>()?;
    Ok(done.into_iter().flatten().min_by(|a, b| a.1.taught.rmse.total_cmp(&b.1.taught.rmse)))
}

/// What the plays of each input may have remembered when the recordings began.
fn pasts(desk: &Desk<'_>) -> Vec<Vec<Past>> {
    let ranges: Vec<_> = (0..desk.inputs()).map(|i| desk.input(i)).collect();
    let of_all = |past: &dyn Fn(Spread) -> Past| ranges.iter().map(|s| s.map_or(Past::FirstSample, past)).collect();
    let mut all: Vec<Vec<Past>> = vec![
        of_all(&|_| Past::FirstSample),
        of_all(&|_| Past::RestedAt(0.0)),
        of_all(&|s| Past::RestedAt(0.5 * (s.low + s.high))),
    ];
    for share in BEYOND {
        all.push(of_all(&|s| Past::TurnedAt(s.low - share * (s.high - s.low))));
        all.push(of_all(&|s| Past::TurnedAt(s.high + share * (s.high - s.low))));
    }
    all
}

fn family(desk: &Desk<'_>, ny: usize, nu: usize, shares: &[f64], past: &[Past]) -> Family {
    let inputs = desk.inputs();
    let first = desk.options.input_delay.unwrap_or(0);
    let power = desk.options.degree.unwrap_or(POWER);
    let mut derived = Vec::new();
    let mut start = linear(inputs, ny, first..=nu.max(first));
    let mut memories: Vec<Signal> = Vec::new();
    for (i, past) in past.iter().enumerate() {
        let half = desk.input(i).map_or(0.0, |s| 0.5 * (s.high - s.low));
        for share in shares.iter().step_by(inputs) {
            let signal = Signal::Input(inputs + derived.len());
            let law = Law::Play { half_width: share * half, past: *past };
            derived.push(Derived { symbol: format!("w{}", derived.len() + 1), source: i, law });
            start.push(Term::new([Factor::value(signal, first)]));
            memories.push(signal);
        }
    }
    memories.extend((0..inputs).map(Signal::Input));
    let now = |s: Signal| Factor::value(s, first);
    let mut candidates: Vec<Term> = Vec::new();
    for p in 2..=power {
        candidates.extend(memories.iter().map(|m| Term::new(std::iter::repeat_n(now(*m), p))));
    }
    for (a, m) in memories.iter().enumerate() {
        candidates.extend(memories.iter().skip(a + 1).map(|o| Term::new([now(*m), now(*o)])));
        if ny > 0 {
            candidates.extend((1..=ny).map(|l| Term::new([now(*m), Factor::value(Signal::Output, l)])));
        }
    }
    let name = format!("{} plays, lags {ny} and {nu}", derived.len());
    Family { name, ny, nu, derived, linear: start, candidates }
}
