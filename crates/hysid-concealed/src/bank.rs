//! The bank: which cases, in which shares, and how they are written.

use std::fmt::Write as _;
use std::io;
use std::path::Path;

use rayon::prelude::*;

use crate::case::{Case, Group, Record, Wanted};
use crate::input::Input;
use crate::law::Law;
use crate::noise::Noise;
use crate::seed::{Random, Stream};

/// Cases in a block whose shares are exact.
const BLOCK: usize = 100;

/// The plan of case `index`: shares hold in every block of 100, and every mechanism comes up before one comes up again.
pub fn plan(stream: Stream, seed: u64, index: usize) -> Wanted {
    let block = index / BLOCK;
    let mut random = Random::for_case(stream, seed, u64::MAX - block as u64);
    let mut catalogue: Vec<Law> = Law::ALL.iter().copied().filter(|l| !l.outside()).collect();
    let mut strange: Vec<Law> = Law::ALL.iter().copied().filter(|l| l.outside()).collect();
    random.shuffle(&mut catalogue);
    random.shuffle(&mut strange);
    let mut kinds = Noise::ALL;
    random.shuffle(&mut kinds);
    let mut list = Vec::with_capacity(BLOCK);
    for i in 0..BLOCK {
        let (group, law, noise) = match i {
            0..15 => (Group::Control, None, Some(kinds[(i + 3 * block) % 6])),
            15..62 => (Group::Single, Some(catalogue[i - 15]), None),
            62..83 => (Group::Pair, Some(pairable(&catalogue, i - 15)), None),
            83..87 => (Group::Triple, Some(pairable(&catalogue, i - 15)), None),
            _ => (Group::Outside, Some(strange[(i - 87) % strange.len()]), None),
        };
        list.push((group, law, noise));
    }
    random.shuffle(&mut list);
    let (group, law, noise) = list[index % BLOCK];
    Wanted { id: format!("case_{index:04}"), group, law, noise }
}

/// The next law from `at` on that may stand beside another.
fn pairable(catalogue: &[Law], at: usize) -> Law {
    (at..at + 3).map(|i| catalogue[i % catalogue.len()]).find(|l| l.sociable()).unwrap_or(Law::Coulomb)
}

/// Case `index` of a bank; another law is drawn where the planned one cannot make the difficulty.
pub fn case(stream: Stream, seed: u64, index: usize) -> Case {
    case_within(stream, seed, index, usize::MAX)
}

/// Case `index` of a bank whose recordings have no more than `longest` samples; another one than the bank's own where
/// that would be longer.
pub fn case_within(stream: Stream, seed: u64, index: usize, longest: usize) -> Case {
    let mut wanted = plan(stream, seed, index);
    let mut random = Random::for_case(stream, seed, index as u64);
    loop {
        if let Some(case) = Case::draw(&wanted, longest, &mut random) {
            return case;
        }
        let outside = wanted.group == Group::Outside;
        let list: Vec<Law> = Law::ALL.iter().copied().filter(|l| l.outside() == outside).collect();
        wanted.law = Some(random.pick(&list));
    }
}

/// Cases `range` of a bank, as [`case_within`] gives each, in order, made on all threads.
pub fn cases(stream: Stream, seed: u64, range: std::ops::Range<usize>, longest: usize) -> Vec<Case> {
    range.into_par_iter().map(|i| case_within(stream, seed, i, longest)).collect()
}

impl Case {
    /// Writes what the program under test may see into `folder`.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        std::fs::create_dir_all(folder)?;
        std::fs::write(folder.join("baseline.sim.toml"), &self.simulation)?;
        std::fs::write(folder.join("est.csv"), self.csv(&self.est, &self.est.y))?;
        std::fs::write(folder.join("val.csv"), self.csv(&self.val, &self.val.y))
    }

    /// A recording as CSV with outputs `y`.
    pub fn csv(&self, record: &Record, y: &[Vec<f64>]) -> String {
        let kind = self.design.kind;
        let mut text = String::from("t_s");
        for (_, column) in kind.inputs() {
            text.push(',');
            text.push_str(column);
        }
        for column in kind.outputs().iter().take(y.len()) {
            text.push(',');
            text.push_str(column);
        }
        text.push('\n');
        let period = record.input.period();
        for k in 0..record.input.len() {
            let t = k as f64 * period;
            let _ = write!(text, "{:.12e}", self.clock + t);
            match &record.input {
                Input::Held { values, .. } => {
                    let _ = write!(text, ",{:.9e}", values[k]);
                }
                Input::Motion { motion, .. } => {
                    let (q, v) = motion.at(t);
                    let _ = write!(text, ",{q:.9e}");
                    if kind.inputs().len() > 1 {
                        let _ = write!(text, ",{v:.9e}");
                    }
                }
            }
            for column in y {
                let _ = write!(text, ",{:.9e}", column[k]);
            }
            text.push('\n');
        }
        text
    }
}

/// Writes the cases below `root/cases` and their labels to `root/labels.json`.
pub fn write(root: &Path, cases: &[Case]) -> io::Result<()> {
    for case in cases {
        case.write(&root.join("cases").join(&case.label.id))?;
    }
    let labels: Vec<_> = cases.iter().map(|c| &c.label).collect();
    std::fs::write(root.join("labels.json"), serde_json::to_string_pretty(&labels)?)
}
