//! Cost of a selection against samples N, candidates M and chosen terms n: figures, and the slopes of fitted lines.

use std::path::Path;

use anyhow::Context;
use hysid_report::figure::{LogAxes, Mark, Plot, Tone};
use serde_json::Value;
use xshell::{Shell, cmd};

use super::measure::Spread;
use super::page::spread;
use super::process::before_all_others;

/// The cost over one axis: for each place the CPU seconds of every round.
struct Axis {
    name: String,
    points: Vec<(f64, Vec<f64>)>,
}

/// What an axis is, what is held while it grows, and the slope that the arithmetic has.
fn words(name: &str) -> (&'static str, &'static str, &'static str) {
    match name {
        "N" => ("samples N", "M = 286, n = 15", "1: every pass goes over all samples"),
        "M" => ("candidates M", "N = 20 000, n = 15", "1: a pass makes one multiply-add for each candidate and sample"),
        _ => (
            "chosen terms n",
            "N = 20 000, M = 286",
            "between 1 (a column of inner products for each term) and 2 (the factorisation of the chosen columns)",
        ),
    }
}

/// Measures, writes the figures to `docs/figures`, and returns the block of the page.
pub fn run(shell: &Shell, root: &Path, rounds: usize) -> anyhow::Result<String> {
    let (program, rounds) = (root.join("target/release/timed"), rounds.to_string());
    let text = cmd!(shell, "{program} scaling {rounds}").quiet().read()?;
    let folder = root.join("docs/figures");
    shell.create_dir(&folder)?;
    let mut block =
        String::from("\n| cost against | held | slope | expected | slope of the upper half |\n|---|---|---|---|---|\n");
    let mut figures = String::new();
    for axis in read(&text)? {
        let (label, held, expected) = words(&axis.name);
        let middle: Vec<(f64, f64)> = axis.points.iter().map(|(x, s)| (*x, Spread::of(s).middle)).collect();
        let upper = &middle[middle.len() / 2..];
        // One slope for each round; their spread says how much the machine disturbed.
        let slopes: Vec<f64> = (0..axis.rounds())
            .map(|r| fit(&axis.round(r)).map(|(slope, _)| slope))
            .collect::<Option<_>>()
            .context("no line")?;
        let ((slope, level), (above, _)) = fit(&middle).zip(fit(upper)).context("no line")?;
        let slopes = Spread { middle: slope, ..Spread::of(&slopes) };
        eprintln!("cost against {label} ({held}): slope {}", spread(slopes));
        block += &format!("| {label} | {held} | {} | {expected} | {above:.2} |\n", spread(slopes));
        let line =
            [middle.first(), middle.last()].into_iter().flatten().map(|(x, _)| (*x, level * x.powf(slope))).collect();
        let all = axis.points.iter().flat_map(|(x, s)| s.iter().map(|y| (*x, *y))).collect();
        let svg = Plot::new(format!("{label} ({held})"), "CPU time in s")
            .sized(640, 320)
            .logarithmic(LogAxes::Both)
            .with(&format!("slope {slope:.2}"), Tone::After, Mark::Line, line)
            .with("each round", Tone::Measured, Mark::Dots, all)
            .svg()?;
        let file = format!("cost-{}.svg", label.split(' ').next().unwrap_or(label));
        std::fs::write(folder.join(&file), svg)?;
        figures += &format!("![CPU time against {label}](figures/{file})\n");
    }
    let command = format!("`{}cargo xtask bench --plots --rounds {rounds}`", before_all_others());
    Ok(format!(
        "{block}\nLines over logarithms, by least squares; one thread, median of {rounds} rounds (smallest to largest slope of a round), {command}.\n\n{figures}"
    ))
}

impl Axis {
    fn rounds(&self) -> usize {
        self.points.iter().map(|(_, s)| s.len()).min().unwrap_or(0)
    }

    fn round(&self, round: usize) -> Vec<(f64, f64)> {
        self.points.iter().filter_map(|(x, s)| Some((*x, *s.get(round)?))).collect()
    }
}

fn read(text: &str) -> anyhow::Result<Vec<Axis>> {
    let value: Value = serde_json::from_str(text.trim())?;
    let axis = |a: &Value| {
        let point =
            |p: &Value| Some((p["x"].as_f64()?, p["cpu_s"].as_array()?.iter().filter_map(Value::as_f64).collect()));
        let points = a["points"].as_array()?.iter().map(point).collect::<Option<_>>()?;
        Some(Axis { name: a["axis"].as_str()?.into(), points })
    };
    value.as_array().and_then(|axes| axes.iter().map(axis).collect()).context("`timed scaling` printed something else")
}

/// Slope and level of the line `log y = log level + slope log x` by least squares; `None` where the points make no line.
fn fit(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let logs: Vec<(f64, f64)> =
        points.iter().filter(|(x, y)| *x > 0.0 && *y > 0.0).map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = logs.len() as f64;
    let (mx, my) = (logs.iter().map(|p| p.0).sum::<f64>() / n, logs.iter().map(|p| p.1).sum::<f64>() / n);
    let xx: f64 = logs.iter().map(|p| (p.0 - mx).powi(2)).sum();
    let xy: f64 = logs.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
    (xx > 0.0).then(|| (xy / xx, (my - xy / xx * mx).exp()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_gives_its_exponent() {
        for (slope, level) in [(1.0, 3.0), (2.0, 1e-9), (-0.5, 7.0), (0.0, 2.0)] {
            let points: Vec<(f64, f64)> =
                [1.0, 10.0, 31.0, 1e6].iter().map(|x: &f64| (*x, level * x.powf(slope))).collect();
            let (s, l) = fit(&points).unwrap();
            assert!((s - slope).abs() < 1e-12 && (l / level - 1.0).abs() < 1e-12, "{slope} {level}: {s} {l}");
        }
    }

    #[test]
    fn the_line_is_that_of_least_squares() {
        // Logs (0, 0), (1, 1), (2, 0) and (3, 3): the slope is 0.8, the mean 1 at 1.5.
        let points: Vec<(f64, f64)> = [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0), (3.0, 3.0)]
            .iter()
            .map(|(x, y): &(f64, f64)| (x.exp(), y.exp()))
            .collect();
        let (slope, level) = fit(&points).unwrap();
        assert!((slope - 0.8).abs() < 1e-12 && (level.ln() + 0.2).abs() < 1e-12, "{slope} {level}");
    }

    #[test]
    fn one_place_makes_no_line() {
        for points in [&[][..], &[(1.0, 2.0)], &[(1.0, 2.0), (1.0, 3.0)], &[(0.0, 1.0), (2.0, 1.0)]] {
            assert!(fit(points).is_none(), "{points:?}");
        }
    }

    #[test]
    fn axes_are_read_and_anything_else_is_refused() {
        let axes = read(r#"[{"axis": "N", "points": [{"x": 10, "cpu_s": [1, 2]}, {"x": 20, "cpu_s": [3]}]}]"#).unwrap();
        assert_eq!((axes[0].name.as_str(), axes[0].rounds()), ("N", 1));
        assert_eq!(axes[0].round(0), [(10.0, 1.0), (20.0, 3.0)]);
        for text in ["", "{}", r#"[{"axis": "N"}]"#, r#"[{"axis": "N", "points": [{"y": 1}]}]"#] {
            assert!(read(text).is_err(), "{text}");
        }
    }
}
