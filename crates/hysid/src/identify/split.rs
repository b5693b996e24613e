//! Which samples teach, which are held out, and which of the teaching ones the search looks at.
//!
//! Everything happens inside the estimation recordings; a validation recording never comes here. With many short recordings
//! whole recordings are held out, else two blocks of every gap-free stretch. A long recording is thinned for the search by
//! taking evenly spaced blocks of consecutive samples, never by dropping samples within a block.

use hysid_narx::Window;

/// The windows of an identification.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Split {
    /// What teaches.
    pub teach: Vec<Window>,
    /// Part of it, for the search.
    pub search: Vec<Window>,
    /// What is held out.
    pub hold: Vec<Window>,
    /// Whether whole recordings are held out.
    pub by_recording: bool,
}

/// Recordings from this number on are held out whole.
const MANY: usize = 6;
/// Held-out blocks as shares of a stretch.
const BLOCKS: [(f64, f64); 2] = [(0.40, 0.55), (0.85, 1.0)];

/// Splits these windows (one for each gap-free stretch); `given` samples start every run, `most` is the search's budget.
pub(crate) fn split(whole: &[Window], given: usize, most: usize) -> Split {
    let mut records: Vec<usize> = whole.iter().map(|w| w.record).collect();
    records.dedup();
    let by_recording = records.len() >= MANY;
    let (mut teach, mut hold) = (Vec::new(), Vec::new());
    if by_recording {
        for w in whole {
            let at = records.iter().position(|r| *r == w.record).unwrap_or(0);
            if at % 4 == 2 { hold.push(w.clone()) } else { teach.push(w.clone()) }
        }
    } else {
        for w in whole {
            cut(w, given, &mut teach, &mut hold);
        }
    }
    if hold.is_empty() {
        hold.clone_from(&teach);
    }
    let search = thin(&teach, given, most);
    Split { teach, search, hold, by_recording }
}

fn cut(w: &Window, given: usize, teach: &mut Vec<Window>, hold: &mut Vec<Window>) {
    let n = w.range.len();
    let push = |to: &mut Vec<Window>, a: f64, b: f64| {
        let at = |x: f64| w.range.start + (x * n as f64).round() as usize;
        let range = at(a)..at(b).min(w.range.end);
        // A window must at least be twice its start to say anything.
        if range.len() > 2 * given {
            to.push(Window { record: w.record, range });
        }
    };
    let mut from = 0.0;
    for (a, b) in BLOCKS {
        push(teach, from, a);
        push(hold, a, b);
        from = b;
    }
    if from < 1.0 {
        push(teach, from, 1.0);
    }
}

/// At most about `most` samples of these windows, in blocks; all of them where they are not more.
pub(crate) fn thin(windows: &[Window], given: usize, most: usize) -> Vec<Window> {
    let total: usize = windows.iter().map(|w| w.range.len()).sum();
    if total <= most + most / 4 {
        return windows.to_vec();
    }
    let share = most as f64 / total as f64;
    let block = (most / 4).max(10 * given).max(500);
    let mut out = Vec::new();
    for w in windows {
        let want = (w.range.len() as f64 * share) as usize;
        let blocks = want.div_ceil(block).max(1);
        let size = (want / blocks).max(3 * given).min(w.range.len());
        let room = w.range.len() - size;
        for b in 0..blocks {
            let at = if blocks == 1 { room / 2 } else { room * b / (blocks - 1) };
            let start = w.range.start + at;
            out.push(Window { record: w.record, range: start..start + size });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window(record: usize, n: usize) -> Window {
        Window { record, range: 0..n }
    }

    #[test]
    fn teaching_and_held_out_samples_do_not_meet() {
        for whole in
            [vec![window(0, 1000)], vec![window(0, 300), window(1, 4000)], (0..9).map(|r| window(r, 120)).collect()]
        {
            let s = split(&whole, 5, 500);
            for h in &s.hold {
                for t in s.teach.iter().filter(|t| t.record == h.record) {
                    assert!(t.range.end <= h.range.start || h.range.end <= t.range.start);
                }
            }
            let held: usize = s.hold.iter().map(|w| w.range.len()).sum();
            let all: usize = whole.iter().map(|w| w.range.len()).sum();
            assert!(held * 5 > all && held * 2 < all, "{held} of {all}");
        }
    }

    #[test]
    fn thinning_keeps_blocks_inside_and_to_the_budget() {
        let whole = [window(0, 60_000), window(1, 3_000)];
        let thinned = thin(&whole, 10, 8000);
        let total: usize = thinned.iter().map(|w| w.range.len()).sum();
        assert!((6000..10_000).contains(&total), "{total}");
        assert!(thinned.iter().all(|w| w.range.end <= whole[w.record].range.end));
        assert_eq!(thin(&whole[1..], 10, 8000), &whole[1..]);
    }
}
