//! Whether two recordings hold the same stretch of samples, as a part that was cut out of a recording does.

use crate::{Recording, mixed};

/// Rows, each unlike the one before it, that two recordings must have in common without a break for these to be the same samples. A machine
/// at rest gives the same few rows again and again; with noise on it, not two in a row.
const WINDOW: usize = 20;

/// The number of rows of `recording` that lie in a stretch which `other` holds too: the same channels with the same samples to the bit,
/// missing ones included, in at least 20 consecutive rows that each differ from the one before. The time does not matter.
pub fn rows_in_both(recording: &Recording, other: &Recording) -> usize {
    let (Some(here), Some(there)) = (levels(recording, recording), levels(recording, other)) else { return 0 };
    let mut known: Vec<u64> = there.windows(WINDOW).map(stretch).collect();
    known.sort_unstable();
    let mut rows = 0;
    let mut counted = 0;
    for (at, window) in here.windows(WINDOW).enumerate() {
        if known.binary_search(&stretch(window)).is_ok() {
            rows += here[counted.max(at)..at + WINDOW].iter().map(|level| level.rows).sum::<usize>();
            counted = at + WINDOW;
        }
    }
    rows
}

/// Share of a hold-out's rows from which it is not what the estimation never sees.
const MOST_IN_COMMON: f64 = 0.5;

/// The number of rows of a hold-out that stand in a recording which is learnt from, too, where these are at least half of it: all of them where
/// it is a copy. `None` where it is data that the estimation never sees.
pub fn rows_seen(holdout: &Recording, learnt: &Recording) -> Option<usize> {
    if holdout.same_samples(learnt) {
        return Some(holdout.len());
    }
    let rows = rows_in_both(holdout, learnt);
    (rows > 0 && rows as f64 >= MOST_IN_COMMON * holdout.len() as f64).then_some(rows)
}

/// Equal rows that follow each other.
struct Level {
    /// Of the samples of a row.
    hash: u64,
    rows: usize,
}

/// The rows of `of`, with the channels in the order of `order`; `None` where the channels are others.
fn levels(order: &Recording, of: &Recording) -> Option<Vec<Level>> {
    let named = order.channels().iter().map(|c| of.channel(&c.name).map(|c| c.samples.as_slice()));
    let channels = named.collect::<Option<Vec<_>>>()?;
    if channels.len() != of.channels().len() {
        return None;
    }
    let mut levels: Vec<Level> = Vec::new();
    for n in 0..of.len() {
        let hash = channels.iter().fold(0, |hash, samples| taking(hash, samples[n].to_bits()));
        match levels.last_mut() {
            Some(last) if last.hash == hash => last.rows += 1,
            _ => levels.push(Level { hash, rows: 1 }),
        }
    }
    Some(levels)
}

fn stretch(window: &[Level]) -> u64 {
    window.iter().fold(0, |hash, level| taking(taking(hash, level.hash), level.rows as u64))
}

/// A hash that takes one more number in.
fn taking(hash: u64, value: u64) -> u64 {
    mixed(hash.rotate_left(23).wrapping_add(value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Channel, Clock};

    fn recording(rows: impl Iterator<Item = (f64, f64)>) -> Recording {
        let (u, y) = rows.unzip();
        let channels = vec![Channel { name: "u".into(), samples: u }, Channel { name: "y".into(), samples: y }];
        Recording::new("r", Clock { start_s: 0.0, period_s: 0.1 }, channels).unwrap()
    }

    fn noisy(n: usize) -> (f64, f64) {
        let x = n as f64;
        (if n % 50 < 25 { 1.0 } else { -1.0 }, if n % 37 == 5 { f64::NAN } else { (x * x).sin() })
    }

    #[test]
    fn a_part_is_known_again_wherever_it_stands() {
        let whole = recording((0..500).map(noisy));
        assert_eq!(rows_in_both(&recording((100..300).map(noisy)), &whole), 200);
        assert_eq!(rows_in_both(&whole, &recording((100..300).map(noisy))), 200);
        assert_eq!(rows_in_both(&recording((400..600).map(noisy)), &whole), 100);
        let two = (0..60).map(noisy).chain((1000..1100).map(noisy)).chain((300..340).map(noisy));
        assert_eq!(rows_in_both(&recording(two), &whole), 100);
        assert_eq!(rows_in_both(&recording((500..900).map(noisy)), &whole), 0);
        let mut channels = whole.channels().to_vec();
        channels.swap(0, 1);
        assert_eq!(rows_in_both(&Recording::new("s", whole.clock(), channels.clone()).unwrap(), &whole), 500);
        channels.pop();
        assert_eq!(rows_in_both(&Recording::new("s", whole.clock(), channels).unwrap(), &whole), 0);
    }

    #[test]
    fn a_copy_and_a_half_are_seen_and_less_is_not() {
        let whole = recording((0..500).map(noisy));
        assert_eq!(rows_seen(&recording((300..700).map(noisy)), &whole), Some(200));
        assert_eq!(rows_seen(&recording((301..701).map(noisy)), &whole), None);
        // A machine at rest, copied.
        let rest = recording((0..400).map(|_| (0.0, 0.0)));
        assert_eq!(rows_seen(&rest, &rest), Some(400));
    }

    #[test]
    fn a_machine_at_rest_proves_nothing() {
        // Long levels, the same in both: fewer than twenty changes.
        let steps = |first: usize, n: usize| (0..n).map(move |k| ((first + k / 100) as f64, 0.0));
        assert_eq!(rows_in_both(&recording(steps(0, 1500)), &recording(steps(0, 1900))), 0);
        let rest = recording((0..400).map(|_| (0.0, 0.0)));
        assert_eq!(rows_in_both(&rest, &rest), 0);
        let begins = |first: usize| recording((0..400).map(move |n| if n < 19 { noisy(n) } else { noisy(first + n) }));
        assert_eq!(rows_in_both(&begins(1000), &begins(5000)), 0);
    }
}
