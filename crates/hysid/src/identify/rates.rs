//! At which rates models are tried.

use super::data::{Samples, spread, step_size};
use super::options::{Decimate, Options};

/// A reduced rate must lower the score to this share of that at the recording's own rate.
pub(crate) const PREFER_OWN_RATE: f64 = 0.7;
/// Below this step from sample to sample, in standard deviations, a signal is densely sampled.
const DENSE: f64 = 0.06;
/// The steps that reduced rates aim at.
const AIMS: [f64; 3] = [0.012, 0.06, 0.2];
/// A reduced recording has at least so many samples.
const FEWEST: usize = 400;

/// The rates to try, the own one first, and why.
pub(crate) fn rates(samples: &[Samples], options: &Options) -> (Vec<usize>, Vec<String>) {
    match options.decimate {
        Decimate::None => return (vec![1], vec!["the recording's own rate, as asked".into()]),
        Decimate::By(l) => return (vec![l], vec![format!("every {l} samples, as asked")]),
        Decimate::Auto => {}
    }
    let total: usize = samples.iter().map(|s| s.y.len()).sum();
    let step = |l: usize| samples.iter().map(|s| step_size(&s.y, l)).fold(0.0, f64::max);
    let own = step(1);
    if own >= DENSE || samples.iter().all(|s| spread(s.y.iter()).is_none()) {
        return (
            vec![1],
            vec![format!(
                "the recording's own rate: from sample to sample the output moves by {own:.2} of its standard deviation"
            )],
        );
    }
    let mut found = vec![1];
    let allowed = [2, 3, 5, 8, 10, 15, 20, 30, 50, 80, 100, 150, 200].into_iter().filter(|&l| total / l >= FEWEST);
    for aim in AIMS.into_iter().filter(|aim| *aim > 2.0 * own) {
        // The lowest rate allowed where even that does not reach the aim.
        found.extend(allowed.clone().find(|&l| step(l) >= aim).or_else(|| allowed.clone().next_back()));
    }
    found.dedup();
    let why = format!(
        "densely sampled: from sample to sample the output moves by {own:.4} of its standard deviation; every {found:?} samples are tried"
    );
    (found, vec![why])
}
