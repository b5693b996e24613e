//! `cargo xtask reliability`: how often statements of a given support are right, and the map from support to probability that follows.
//!
//! `cargo xtask prove --development --seed S --reliability` prints the table of one bank and writes its statements (`statements.csv`).
//! `cargo xtask reliability FILE...` fits the map to the statements of several banks, each left out in turn, and prints the figures that
//! stand in `hysid_diagnose::verdict::reliability`. Only development banks: a map that was fitted to the reporting stream would report itself.
//!
//! The fit is a logistic regression by Newton's method with a weak normal prior (slope 0.5, everything else 0), since a bank has few statements
//! that are not firm.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::{Context, ensure};
use hysid_diagnose::verdict::FIRM;
use hysid_diagnose::verdict::reliability::{FAMILY, IMITATION, MECHANISM, Map, logit};

use super::score::{Row, Statement, statements};
use super::stats::calibration;

/// How often statements are right, and the map from support to probability
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Statements of development banks, as `prove --reliability` writes them [default: xtask/reliability/*.csv]
    files: Vec<PathBuf>,
}

/// Columns of a file of statements.
const HEADER: &str = "case,mechanism,imitation,members,support,family_support,right,family_right";

/// One statement of an effect.
#[derive(Debug, Clone, PartialEq)]
struct Observation {
    /// Whether the set is called an imitation of something outside the catalogue.
    imitation: bool,
    members: usize,
    /// Of the mechanism, and of the family.
    support: [f64; 2],
    right: [bool; 2],
}

/// The two levels of a statement.
const LEVELS: [(&str, Map); 2] = [("mechanism", MECHANISM), ("family", FAMILY)];

impl Observation {
    /// What the engine makes of it now.
    fn stated(&self, level: usize, map: &Map, imitation: f64) -> f64 {
        let support = self.support[level];
        if self.imitation && support < FIRM {
            return imitation.min(support);
        }
        map.probability(support, self.members)
    }

    /// What the map is fitted to.
    fn counts(&self, level: usize) -> bool {
        !self.imitation && self.support[level] < FIRM
    }
}

/// Runs the task.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let files = if args.files.is_empty() { stored()? } else { args.files.clone() };
    let banks: Vec<Vec<Observation>> = files.iter().map(read).collect::<anyhow::Result<_>>()?;
    ensure!(banks.len() > 1, "at least two files of statements are needed, so that one can be left out");
    print!("{}", report(&banks));
    Ok(())
}

/// The files beside the task.
fn stored() -> anyhow::Result<Vec<PathBuf>> {
    let folder = crate::root().join("xtask/reliability");
    let mut list: Vec<PathBuf> = std::fs::read_dir(&folder)
        .with_context(|| format!("{}", folder.display()))?
        .filter_map(|e| Some(e.ok()?.path()))
        .filter(|p| p.extension().is_some_and(|e| e == "csv"))
        .collect();
    list.sort();
    Ok(list)
}

fn read(path: &PathBuf) -> anyhow::Result<Vec<Observation>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("{}", path.display()))?;
    parse(&text).with_context(|| format!("{}", path.display()))
}

fn parse(text: &str) -> anyhow::Result<Vec<Observation>> {
    let mut lines = text.lines();
    ensure!(lines.next() == Some(HEADER), "the first line is not `{HEADER}`");
    lines
        .enumerate()
        .map(|(i, line)| {
            let f: Vec<&str> = line.split(',').collect();
            let [_, _, imitation, members, support, family_support, right, family_right] = f.as_slice() else {
                anyhow::bail!("line {}: {} fields, 8 wanted", i + 2, f.len());
            };
            Ok(Observation {
                imitation: imitation.parse()?,
                members: members.parse()?,
                support: [support.parse()?, family_support.parse()?],
                right: [right.parse()?, family_right.parse()?],
            })
        })
        .collect()
}

/// The statements of a bank as a file.
pub fn file(rows: &[Row]) -> String {
    let mut text = format!("{HEADER}\n");
    for s in statements(rows) {
        let Statement { case, mechanism, imitation, members, support, family_support, right, family_right, .. } = s;
        let _ = writeln!(
            text,
            "{case},{mechanism},{imitation},{members},{support:.4},{family_support:.4},{right},{family_right}"
        );
    }
    text
}

/// The table of one bank.
pub fn table(rows: &[Row]) -> anyhow::Result<String> {
    let list = parse(&file(rows))?;
    let mut text = String::new();
    for (level, (name, map)) in LEVELS.iter().enumerate() {
        text.push_str(&bins(&list, level, name, &|o| o.support[level], "support"));
        text.push_str(&bins(&list, level, name, &|o| o.stated(level, map, IMITATION), "probability"));
    }
    Ok(text)
}

/// A reliability table: ten bins, mean stated, share right.
fn bins(list: &[Observation], level: usize, name: &str, of: &dyn Fn(&Observation) -> f64, what: &str) -> String {
    let pairs: Vec<(f64, bool)> = list.iter().map(|o| (of(o), o.right[level])).collect();
    let (ece, bins) = calibration(&pairs);
    let mut text = format!("{name}, {what}: expected calibration error {ece:.3}, n {}\n", pairs.len());
    for (mean, right, n) in bins {
        let _ = writeln!(text, "  stated {mean:.2}  right {right:.2}  n {n}");
    }
    text
}

/// Mean squared error of what is not firm.
fn brier(pairs: &[(f64, bool)]) -> f64 {
    pairs.iter().map(|(p, y)| (p - f64::from(u8::from(*y))).powi(2)).sum::<f64>() / pairs.len().max(1) as f64
}

/// Tables before and after, each bank judged by the map of the others, and the map of all.
fn report(banks: &[Vec<Observation>]) -> String {
    let all: Vec<Observation> = banks.iter().flatten().cloned().collect();
    let mut text = String::new();
    for (level, (name, engine)) in LEVELS.iter().enumerate() {
        let below = |o: &&Observation| o.support[level] < FIRM;
        let mut held = Vec::new();
        for i in 0..banks.len() {
            let others: Vec<Observation> =
                banks.iter().enumerate().filter(|(j, _)| *j != i).flat_map(|(_, b)| b.clone()).collect();
            let (map, imitation) = (fit(&others, level), imitations(&others, level));
            held.extend(banks[i].iter().map(|o| (o.stated(level, &map, imitation), o.right[level], o.support[level])));
        }
        let stated: Vec<(f64, bool)> = all.iter().map(|o| (o.support[level], o.right[level])).collect();
        let mapped: Vec<(f64, bool)> = held.iter().map(|h| (h.0, h.1)).collect();
        let unsure: Vec<(f64, bool)> = held.iter().filter(|h| h.2 < FIRM).map(|h| (h.0, h.1)).collect();
        let before: Vec<(f64, bool)> = all.iter().filter(below).map(|o| (o.support[level], o.right[level])).collect();
        text.push_str(&bins(&all, level, name, &|o| o.support[level], "support"));
        text.push_str(&bins(
            &all,
            level,
            name,
            &|o| o.stated(level, engine, IMITATION),
            "probability (as the engine has it)",
        ));
        let map = fit(&all, level);
        let _ = writeln!(
            text,
            "{name}, each bank by the map of the others: expected calibration error {:.3} (support {:.3}); of {} below {FIRM}: {:.3} ({:.3}), Brier score {:.3} ({:.3})",
            calibration(&mapped).0,
            calibration(&stated).0,
            unsure.len(),
            calibration(&unsure).0,
            calibration(&before).0,
            brier(&unsure),
            brier(&before)
        );
        let _ = writeln!(
            text,
            "{name}, map of all: constant {:.2}, slope {:.2}, several {:.2}; imitations {:.2}\n",
            map.constant,
            map.slope,
            map.several,
            imitations(&all, level)
        );
    }
    text
}

/// Share of right ones among the members of imitations, half a case granted.
fn imitations(list: &[Observation], level: usize) -> f64 {
    let of: Vec<bool> =
        list.iter().filter(|o| o.imitation && o.support[level] < FIRM).map(|o| o.right[level]).collect();
    (of.iter().filter(|r| **r).count() as f64 + 0.5) / (of.len() as f64 + 1.0)
}

/// Precision of the prior and its mean.
const PRIOR: [(f64, f64); 3] = [(0.01, 0.0), (0.3, 0.5), (0.3, 0.0)];

/// The map of these statements.
fn fit(list: &[Observation], level: usize) -> Map {
    let rows: Vec<([f64; 3], f64)> = list
        .iter()
        .filter(|o| o.counts(level))
        .map(|o| {
            ([1.0, logit(o.support[level]), f64::from(u8::from(o.members > 1))], f64::from(u8::from(o.right[level])))
        })
        .collect();
    let mut w = PRIOR.map(|p| p.1);
    for _ in 0..50 {
        let mut normal = [0.0; 9];
        let mut slope = [0.0; 3];
        for (i, (precision, mean)) in PRIOR.iter().enumerate() {
            normal[4 * i] = *precision;
            slope[i] = -precision * (w[i] - mean);
        }
        for (x, y) in &rows {
            let q = 1.0 / (1.0 + (-(0..3).map(|i| w[i] * x[i]).sum::<f64>()).exp());
            for i in 0..3 {
                slope[i] += x[i] * (y - q);
                for j in 0..3 {
                    normal[3 * i + j] += q * (1.0 - q) * x[i] * x[j];
                }
            }
        }
        let Some(step) = hysid_concealed::refit::solve(&normal, &slope, 3, 0.0) else { break };
        (0..3).for_each(|i| w[i] += step[i]);
        if step.iter().all(|s| s.abs() < 1e-10) {
            break;
        }
    }
    // A map that turned the order round would be a fault of the bank, not of the order.
    Map { constant: w[0], slope: w[1].max(0.0), several: w[2] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysid_concealed::seed::{Random, Stream};
    use hysid_diagnose::verdict::NOT_FIRM;

    #[test]
    fn the_engine_has_what_the_stored_statements_give() {
        let all: Vec<Observation> = stored().unwrap().iter().flat_map(|f| read(f).unwrap()).collect();
        assert!(all.len() > 100);
        for (level, (name, engine)) in LEVELS.iter().enumerate() {
            let map = fit(&all, level);
            for (a, b) in [(map.constant, engine.constant), (map.slope, engine.slope), (map.several, engine.several)] {
                assert!((a - b).abs() < 0.006, "{name}: fitted {map:?}, in the engine {engine:?}");
            }
        }
        assert!((imitations(&all, 0) - IMITATION).abs() < 0.006);
    }

    #[test]
    fn a_known_map_is_found_again() {
        let truth = Map { constant: 0.3, slope: 0.7, several: -0.8 };
        let mut random = Random::for_case(Stream::Development, 1, 1);
        let list: Vec<Observation> = (0..20_000)
            .map(|i| {
                let (support, members) = (random.uniform(0.05, 0.84), 1 + i % 2);
                let p = truth.probability(support, members);
                assert!(p < NOT_FIRM);
                Observation {
                    imitation: false,
                    members,
                    support: [support; 2],
                    right: [random.uniform(0.0, 1.0) < p; 2],
                }
            })
            .collect();
        let map = fit(&list, 0);
        assert!(
            (map.constant - 0.3).abs() < 0.1 && (map.slope - 0.7).abs() < 0.1 && (map.several + 0.8).abs() < 0.1,
            "{map:?}"
        );
    }

    #[test]
    fn files_that_are_not_statements_are_refused() {
        assert!(parse("a,b\n").is_err());
        assert!(parse(&format!("{HEADER}\ncase_1,delay,false,1,0.5\n")).is_err());
        let list = parse(&format!("{HEADER}\ncase_1,delay,false,1,0.5,0.6,true,true\n")).unwrap();
        assert_eq!(list[0].support, [0.5, 0.6]);
    }
}
