//! `docs/performance.md`: one block for each case between two marks, renewed when the case is run; the text around is written by hand.

use std::fmt::Write;

use super::case::{Case, Contender, Goal};
use super::measure::{Outcome, Spread};

/// The page with the block `name` renewed; a block that is not there yet goes behind the last one.
pub fn renew(page: &str, name: &str, block: &str) -> String {
    let (begin, end) = (format!("<!-- measured: {name} -->"), format!("<!-- end of {name} -->"));
    let whole = format!("{begin}\n{block}{end}");
    if let Some((before, rest)) = page.split_once(&begin)
        && let Some((_, after)) = rest.split_once(&end)
    {
        return format!("{before}{whole}{after}");
    }
    let last = page.rfind("<!-- end of ").and_then(|at| Some(at + page[at..].find("-->")? + 3)).unwrap_or(page.len());
    format!("{}\n\n{whole}{}", page[..last].trim_end(), &page[last..])
}

/// The block of a case: its table and its goals.
pub fn block(case: &Case, outcomes: &[Outcome], command: &str) -> String {
    let mut out = String::new();
    let loads = Spread::of(&outcomes.iter().flat_map(|o| o.loads.iter().copied()).collect::<Vec<f64>>());
    let _ = write!(out, "\n### {}\n\n", case.work);
    out.push_str("| tool | rounds | CPU s | wall s | samples/s | peak MiB | agrees | CPU time over ours |\n");
    out.push_str("|---|---|---|---|---|---|---|---|\n");
    for o in outcomes {
        let cpu = Spread::of(&o.cpu);
        let ours = find(outcomes, o.contender.over);
        let ratio = match ours {
            Some(ours) if ours.contender.tool != o.contender.tool => spread(o.over(ours)),
            _ => String::new(),
        };
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {} | {} | {} | {ratio} |",
            o.contender.tool,
            o.cpu.len(),
            spread(cpu),
            number(Spread::of(&o.wall).middle),
            number(case.samples as f64 / cpu.middle),
            if o.peak_mib.is_finite() { format!("{:.0}", o.peak_mib) } else { String::new() },
            o.agreement,
        );
    }
    out.push('\n');
    for goal in &case.goals {
        if let Some((text, reached)) = judge(goal, case, outcomes) {
            let _ = writeln!(out, "- {text}: {}", if reached { "reached" } else { "**missed**" });
        }
    }
    let remark = if case.remark.is_empty() { String::new() } else { format!("{} ", case.remark) };
    let _ = writeln!(out, "\n{remark}`{command}`, machine load {:.1} to {:.1}.", loads.least, loads.most);
    out
}

fn find<'a>(outcomes: &'a [Outcome], tool: &str) -> Option<&'a Outcome> {
    outcomes.iter().find(|o| o.contender.tool == tool)
}

/// The goal in words with the figure, and whether it is reached; `None` where one of those that it names was not run.
pub fn judge(goal: &Goal, case: &Case, outcomes: &[Outcome]) -> Option<(String, bool)> {
    let of = |tool: &str| find(outcomes, tool);
    Some(match *goal {
        Goal::Ahead { ours, times } => {
            let ours = of(ours)?;
            let rival = |c: &Contender| c.side == super::case::Side::Peer && c.threads == ours.contender.threads;
            // Threads that wait in a loop cost CPU time but not the user's: with more than one the clock on the wall counts.
            let (over, clock): (fn(&Outcome, &Outcome) -> Spread, _) =
                if ours.contender.threads == 1 { (Outcome::over, "CPU") } else { (Outcome::wall_over, "wall") };
            let best = outcomes
                .iter()
                .filter(|o| rival(&o.contender))
                .min_by(|a, b| over(a, ours).middle.total_cmp(&over(b, ours).middle))?;
            let ratio = over(best, ours);
            let text = format!(
                "{times} times ahead of the best other tool on {} ({clock} time): {} times ({})",
                if ours.contender.threads == 1 {
                    "one thread".into()
                } else {
                    format!("{} threads", ours.contender.threads)
                },
                spread(ratio),
                best.contender.tool
            );
            (text, ratio.middle >= times)
        }
        Goal::Faster { quick, slow, times } => {
            let ratio = of(slow)?.over(of(quick)?);
            (
                format!("\"{quick}\" {times} times faster than \"{slow}\": {} times", spread(ratio)),
                ratio.middle >= times,
            )
        }
        Goal::Within { tool, other, times } => {
            let (tool, other) = (of(tool)?, of(other)?);
            let (ratio, clock) = match (tool.contender.threads, other.contender.threads) {
                (a, b) if a == b => (tool.over(other), "CPU"),
                _ => (tool.wall_over(other), "wall"),
            };
            let (tool, other) = (&tool.contender.tool, &other.contender.tool);
            (
                format!("\"{tool}\" at most {times} times \"{other}\" ({clock} time): {}", spread(ratio)),
                ratio.middle <= times,
            )
        }
        Goal::Rate { tool, least } => {
            let rate = case.samples as f64 / Spread::of(&of(tool)?.cpu).middle;
            (format!("\"{tool}\" at {} samples/s: {}", number(least), number(rate)), rate >= least)
        }
        Goal::Wall { tool, most } => {
            let wall = Spread::of(&of(tool)?.wall);
            (format!("\"{tool}\" in {most} s (wall time): {} s", spread(wall)), wall.middle <= most)
        }
        Goal::Memory { tool, most_mib } => {
            let peak = of(tool)?.peak_mib;
            (format!("\"{tool}\" below {most_mib} MiB: {peak:.0} MiB"), peak <= most_mib)
        }
        Goal::Speedup { one, two, least } => {
            let ratio = of(one)?.wall_over(of(two)?);
            (format!("two threads {least} times as fast as one (wall time): {}", spread(ratio)), ratio.middle >= least)
        }
    })
}

/// Median (smallest to largest).
pub fn spread(s: Spread) -> String {
    if s.least == s.most {
        return number(s.middle);
    }
    format!("{} ({} to {})", number(s.middle), number(s.least), number(s.most))
}

/// Three digits, as a power of ten where it would be long.
pub fn number(x: f64) -> String {
    let size = x.abs();
    match size {
        _ if !x.is_finite() => "-".into(),
        0.0 => "0".into(),
        0.01..0.09995 => format!("{x:.4}"),
        0.09995..0.9995 => format!("{x:.3}"),
        0.9995..9.995 => format!("{x:.2}"),
        9.995..99.95 => format!("{x:.1}"),
        99.95..99_999.5 => format!("{x:.0}"),
        _ => format!("{x:.2e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::case::{Input, Measure, Program, Side};
    use super::*;

    #[test]
    fn a_block_is_renewed_in_its_place_and_a_new_one_goes_behind_the_last() {
        let page = "# P\n<!-- measured: a -->\nold\n<!-- end of a -->\n\ntext\n";
        let renewed = renew(page, "a", "new\n");
        assert_eq!(renewed, "# P\n<!-- measured: a -->\nnew\n<!-- end of a -->\n\ntext\n");
        assert_eq!(renew(&renewed, "a", "new\n"), renewed);
        let more = renew(&renewed, "b", "two\n");
        assert_eq!(
            more,
            "# P\n<!-- measured: a -->\nnew\n<!-- end of a -->\n\n<!-- measured: b -->\ntwo\n<!-- end of b -->\n\ntext\n"
        );
        assert!(renew("# P", "a", "x\n").starts_with("# P\n\n<!-- measured: a -->"));
    }

    #[test]
    fn numbers_have_three_digits() {
        for (x, expected) in [
            (0.0, "0"),
            (1.0, "1.00"),
            (0.5, "0.500"),
            (0.0123, "0.0123"),
            (12.34, "12.3"),
            (1234.5, "1234"),
            (1.5e6, "1.50e6"),
            (1e-5, "1.00e-5"),
            (f64::NAN, "-"),
        ] {
            assert_eq!(number(x), expected);
        }
    }

    fn outcome(tool: &str, side: Side, threads: usize, cpu: &[f64], wall: &[f64]) -> Outcome {
        let contender = Contender {
            tool: tool.into(),
            side,
            threads,
            program: Program::Timed,
            words: Vec::new(),
            rounds: 9,
            over: "a",
        };
        let (cpu, wall) = (cpu.to_vec(), wall.to_vec());
        Outcome { contender, cpu, wall, peak_mib: 50.0, loads: vec![1.0], agreement: String::new() }
    }

    #[test]
    fn goals_are_judged_by_the_median_of_the_rounds() {
        let outcomes = [
            outcome("a", Side::Ours, 1, &[1.0, 1.0, 1.0], &[1.0, 1.0, 1.0]),
            outcome("a2", Side::Ours, 2, &[1.0, 1.0, 1.0], &[0.5, 0.6, 0.4]),
            outcome("p", Side::Peer, 1, &[9.0, 20.0, 11.0], &[9.0, 20.0, 11.0]),
            outcome("q", Side::Peer, 1, &[30.0], &[30.0]),
            outcome("p2", Side::Peer, 2, &[40.0, 40.0, 40.0], &[3.0, 3.0, 3.0]),
        ];
        let case = Case {
            name: "n",
            work: "w",
            samples: 100,
            input: Input::None,
            measure: Measure::Work,
            contenders: Vec::new(),
            goals: vec![Goal::Ahead { ours: "a", times: 10.0 }],
            remark: "",
        };
        let check = |goal: Goal, expected: bool| {
            let (text, reached) = judge(&goal, &case, &outcomes).unwrap();
            assert_eq!(reached, expected, "{text}");
        };
        check(Goal::Ahead { ours: "a", times: 11.0 }, true);
        check(Goal::Ahead { ours: "a", times: 12.0 }, false);
        // At two threads by the wall: 3 over 0.5 is 6.
        check(Goal::Ahead { ours: "a2", times: 6.0 }, true);
        check(Goal::Ahead { ours: "a2", times: 6.1 }, false);
        check(Goal::Speedup { one: "a", two: "a2", least: 2.0 }, true);
        check(Goal::Speedup { one: "a", two: "a2", least: 2.1 }, false);
        check(Goal::Within { tool: "a", other: "p", times: 1.0 }, true);
        check(Goal::Within { tool: "p", other: "a", times: 10.9 }, false);
        check(Goal::Faster { quick: "a", slow: "p", times: 11.0 }, true);
        check(Goal::Rate { tool: "a", least: 100.0 }, true);
        check(Goal::Rate { tool: "a", least: 101.0 }, false);
        check(Goal::Wall { tool: "a", most: 0.9 }, false);
        check(Goal::Memory { tool: "a", most_mib: 49.0 }, false);
        assert!(judge(&Goal::Wall { tool: "none", most: 1.0 }, &case, &outcomes).is_none());
        let text = block(&case, &outcomes, "cargo xtask bench");
        assert!(text.contains("| p | 3 | 11.0 (9.00 to 20.0) |"), "{text}");
        assert!(text.contains("- 10 times ahead of the best other tool on one thread (CPU time): 11.0 (9.00 to 20.0) times (p): reached"), "{text}");
    }
}
