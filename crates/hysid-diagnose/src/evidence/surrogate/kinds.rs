//! The kinds of surrogates of a whitened residual.

use hysid_signal::{fourier, inverse_fourier, median};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use crate::evidence::layout::{Layout, Series};
use crate::random::generator;

/// How a series is rolled and where its sign changes.
struct Moves {
    shift: usize,
    offset: usize,
    length: usize,
    signs: Vec<f64>,
}

impl Moves {
    /// Of a series of so many samples with this correlation time.
    fn drawn(n: usize, tau: usize, rng: &mut impl RngExt) -> Self {
        let guard = (10 * tau).min(n / 4);
        let shift = if n > 2 * guard + 1 { rng.random_range(guard..n - guard) } else { 0 };
        // Blocks of at least 10 correlation times; between 8 and 40 of them where the series is long enough.
        let blocks = (n / (10 * tau).max(1)).clamp(8, 40).min(n.max(1));
        let length = (n / blocks).max(1);
        let offset = rng.random_range(0..length);
        let signs = (0..=n / length + 1).map(|_| sign(rng)).collect();
        Self { shift, offset, length, signs }
    }

    /// The series, moved.
    fn of(&self, x: &[f64]) -> impl Iterator<Item = f64> {
        let at = x.len() - self.shift;
        let rolled = x[at..].iter().chain(&x[..at]);
        rolled.enumerate().map(|(i, v)| v * self.signs[(i + self.offset) / self.length])
    }
}

fn sign(rng: &mut impl RngExt) -> f64 {
    if rng.random::<bool>() { 1.0 } else { -1.0 }
}

/// `r` with each series moved by what is drawn for it. Outputs of one run are moved together: noise that acts inside the machine is in all of them, and an effect
/// that acts there finds it in all of them.
fn moved<M>(
    layout: &Layout,
    r: &[f64],
    mut draw: impl FnMut(&Series) -> M,
    of: impl Fn(&M, &[f64], &mut [f64]),
) -> Vec<f64> {
    let mut out = vec![0.0; r.len()];
    let mut drawn: Vec<(&Series, M)> = Vec::new();
    for s in &layout.series {
        let known = drawn.iter().position(|(of, _)| of.is_beside(s));
        let place = known.unwrap_or_else(|| {
            drawn.push((s, draw(s)));
            drawn.len() - 1
        });
        of(&drawn[place].1, &r[s.rows.clone()], &mut out[s.rows.clone()]);
    }
    out
}

/// `r`, rolled with the signs of its blocks drawn.
pub fn rolled(layout: &Layout, r: &[f64], tau: usize, seed: u64, index: u64) -> Vec<f64> {
    let mut rng = generator(seed, 0x5u64 << 56 | index);
    let draw = |s: &Series| Moves::drawn(s.rows.len(), tau, &mut rng);
    moved(layout, r, draw, |moves, x, out| out.iter_mut().zip(moves.of(x)).for_each(|(o, v)| *o = v))
}

/// `r` with the sign of each sample drawn: what is large stays where it is.
pub fn flipped(layout: &Layout, r: &[f64], seed: u64, index: u64) -> Vec<f64> {
    let mut rng = generator(seed, 0x7u64 << 56 | index);
    let draw = |s: &Series| -> Vec<f64> { s.rows.clone().map(|_| sign(&mut rng)).collect() };
    moved(layout, r, draw, |signs, x, out| {
        out.iter_mut().zip(x.iter().zip(signs)).for_each(|(o, (x, sign))| *o = x * sign);
    })
}

/// The level of each line of a series' spectrum: the median of its neighbours, as wide as a third of the frequency, at least nine lines.
pub fn levels(x: &[f64]) -> Vec<f64> {
    let power: Vec<f64> = fourier(x).iter().map(|(re, im)| re * re + im * im).collect();
    let last = power.len().saturating_sub(1);
    (0..power.len())
        .map(|k| {
            let half = (k / 3).max(4);
            // The mean is a line of its own kind.
            let window = k.saturating_sub(half).max(1)..=(k + half).min(last);
            let near = power.get(window).filter(|near| !near.is_empty());
            // The median of an exponential law is ln 2 of its mean.
            near.map_or(0.0, |near| median(near.to_vec())) / std::f64::consts::LN_2
        })
        .collect()
}

/// Gaussian noise with these levels, for each series of the layout.
pub fn gaussian(layout: &Layout, levels: &[Vec<f64>], rows: usize, seed: u64, index: u64) -> Vec<f64> {
    let mut rng = generator(seed, 0x6u64 << 56 | index);
    let mut out = vec![0.0; rows];
    for (s, levels) in layout.series.iter().zip(levels) {
        let lines: Vec<(f64, f64)> = levels
            .iter()
            .enumerate()
            .map(|(k, l)| {
                // The mean and the line at half the sampling rate are real: all of their power is in one part.
                let share = if k == 0 || 2 * k == s.rows.len() { 1.0 } else { 0.5 };
                let mut part = || (share * l).sqrt() * Distribution::<f64>::sample(&StandardNormal, &mut rng);
                (part(), part())
            })
            .collect();
        out[s.rows.clone()].copy_from_slice(&inverse_fourier(&lines, s.rows.len()));
    }
    out
}
