//! Random streams: one generator for each case, and bank streams that cannot meet.
//!
//! The seed of a case is a hash of (stream constant, bank seed, case number). Development and reporting banks carry
//! different stream constants, so that no choice of `--seed` makes one reproduce a case of the other.

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// Which of the two disjoint families of cases a bank belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stream {
    /// Open for tuning: failures may be looked at.
    Development,
    /// For reported figures only; nothing is chosen on it.
    Reporting,
}

impl Stream {
    const fn constant(self) -> u64 {
        match self {
            Stream::Development => 0x6465_765f_6261_6e6b,
            Stream::Reporting => 0x7265_706f_7274_5f31,
        }
    }
}

/// The portable random generator of one case.
#[derive(Debug, Clone)]
pub struct Random(Pcg64);

/// The finaliser of SplitMix64 (Steele, Lea, Flood 2014): every input bit reaches every output bit.
const fn mix(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Random {
    /// The generator of case `index` in the bank with this stream and seed.
    pub fn for_case(stream: Stream, seed: u64, index: u64) -> Self {
        Self(Pcg64::seed_from_u64(mix(mix(mix(stream.constant()) ^ seed) ^ index)))
    }

    /// An independent generator, so that drawing more of one thing does not change another.
    pub fn fork(&mut self) -> Self {
        Self(Pcg64::seed_from_u64(self.0.random()))
    }

    /// Uniform in `[low, high)`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// Log-uniform in `[low, high)`, both positive.
    pub fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        self.uniform(low.ln(), high.ln()).exp()
    }

    /// Standard normal.
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// True with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        self.0.random::<f64>() < p
    }

    /// -1 or 1.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// A whole number below `n` (0 when `n` is 0).
    pub fn below(&mut self, n: usize) -> usize {
        if n == 0 { 0 } else { self.0.random_range(0..n) }
    }

    /// An index drawn with these weights.
    pub fn weighted(&mut self, weights: &[f64]) -> usize {
        let mut at = self.0.random::<f64>() * weights.iter().sum::<f64>();
        for (i, w) in weights.iter().enumerate() {
            at -= w;
            if at < 0.0 {
                return i;
            }
        }
        weights.len().saturating_sub(1)
    }

    /// One of the items.
    pub fn pick<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.below(items.len())]
    }

    /// The items in random order (Fisher-Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i + 1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_never_share_a_case() {
        let mut seen = std::collections::HashSet::new();
        for stream in [Stream::Development, Stream::Reporting] {
            for seed in 0..20 {
                for index in 0..500 {
                    let mut r = Random::for_case(stream, seed, index);
                    assert!(seen.insert(r.0.random::<u64>()), "{stream:?} {seed} {index}");
                }
            }
        }
    }

    #[test]
    fn same_case_same_numbers() {
        let draw = || (0..9).map(|_| Random::for_case(Stream::Reporting, 3, 7).uniform(0.0, 1.0)).collect::<Vec<_>>();
        assert_eq!(draw(), draw());
    }
}
