//! `docs/performance.md`: the measured part between two marks; the text around it is written by hand.

use std::fmt::Write;
use std::path::Path;

use super::cases::{Case, Outcome};

const BEGIN: &str = "<!-- measured: written by `cargo xtask bench` -->";
const END: &str = "<!-- end of measured -->";

/// The page with its measured part renewed.
pub fn write(path: &Path, cases: &[Case], results: &[Outcome], peers: bool) -> anyhow::Result<String> {
    let old = std::fs::read_to_string(path).unwrap_or_else(|_| format!("# Performance\n\n{BEGIN}\n{END}\n"));
    let (before, rest) = old.split_once(BEGIN).unwrap_or((&old, ""));
    let after = rest.split_once(END).map_or("\n", |(_, after)| after);
    Ok(format!("{before}{BEGIN}\n{}{END}{after}", measured(cases, results, peers)?))
}

fn measured(cases: &[Case], results: &[Outcome], peers: bool) -> anyhow::Result<String> {
    let mut out = String::new();
    let command = if peers { "cargo xtask bench --peers" } else { "cargo xtask bench" };
    writeln!(
        out,
        "\nWritten by `{command}`. CPU seconds: median (smallest to largest). Ratio: the other tool's median CPU time at one"
    )?;
    writeln!(
        out,
        "thread over ours. Load is the machine's load average when the command ended: two cores, shared with other work.\n"
    )?;
    writeln!(out, "| case | tool, threads | CPU s | wall s | peak MiB | true terms | load | ratio |")?;
    writeln!(out, "|---|---|---|---|---|---|---|---|")?;
    for case in cases {
        let of_case: Vec<&Outcome> = results.iter().filter(|r| r.case == case.name).collect();
        let ours = of_case.iter().find(|r| r.tool == "hysid" && r.threads == 1);
        for r in &of_case {
            let found = r.found.map_or("-".to_string(), |(a, b)| format!("{a} of {b}"));
            let ratio = match (ours, r.free_run) {
                (Some(o), Some(rate)) if case.freerun > 0 => {
                    let ratio = o.free_run.unwrap_or(f64::NAN) / rate;
                    format!("{rate:.2e} samples/s, ratio {ratio:.3}")
                }
                (Some(o), _) if r.tool != "hysid" => format!("**{:.1}**", r.cpu.middle / o.cpu.middle),
                _ => "1".to_string(),
            };
            writeln!(
                out,
                "| {} | {}, {} | {:.3e} ({:.3e} to {:.3e}) | {:.3e} | {:.0} | {found} | {:.1} | {ratio} |",
                case.work, r.tool, r.threads, r.cpu.middle, r.cpu.least, r.cpu.most, r.wall.middle, r.peak_mib, r.load
            )?;
        }
        let best = of_case.iter().filter(|r| r.tool != "hysid").map(|r| r.cpu.middle).fold(f64::INFINITY, f64::min);
        if let (Some(o), true, true) = (ours, best.is_finite(), case.goal.is_finite()) {
            let ratio = best / o.cpu.middle;
            let verdict = if ratio >= case.goal { "reached" } else { "missed" };
            writeln!(out, "| | goal {}: {verdict} | | | | | | best {ratio:.1} |", case.goal)?;
        }
    }
    out.push('\n');
    Ok(out)
}
