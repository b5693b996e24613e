//! The table on standard output and in `docs/recordings.md`.

use std::fmt::Write;
use std::path::Path;

use super::Line;

const HEAD: &str = "| set | validation | ours | linear, same way | ratio | std of y | target | met | terms | every | time s | quoted in meta.json |\n\
                    |---|---|---:|---:|---:|---:|---:|:-:|---:|---:|---:|---|\n";
/// The parts of the page that this task writes stand between these marks.
pub(crate) const FIT: (&str, &str) = ("<!-- fit: begin -->", "<!-- fit: end -->");
pub(crate) const DIAGNOSED: (&str, &str) = ("<!-- diagnosis: begin -->", "<!-- diagnosis: end -->");
pub(crate) const UNTOUCHED: (&str, &str) = ("<!-- untouched: begin -->", "<!-- untouched: end -->");

/// One line of the table.
pub(crate) fn row(l: &Line) -> String {
    let number = |x: f64| if x.is_finite() { format!("{x:.4}") } else { "diverges".into() };
    let met = match l.target {
        Some(t) if l.ours <= t => "yes",
        Some(_) => "**no**",
        None if l.diverged.is_none() && l.ours < l.linear => "yes",
        None => "**no**",
    };
    let target = l.target.map_or("linear".to_string(), |t| format!("{t}"));
    let ratio =
        if l.linear.is_finite() && l.ours.is_finite() { format!("{:.3}", l.ours / l.linear) } else { "-".into() };
    format!(
        "| {} | {} | {} {} | {} | {ratio} | {} | {target} | {met} | {} | {} | {:.1} | {} |",
        l.set,
        l.file,
        number(l.ours),
        l.unit,
        number(l.linear),
        number(l.std),
        l.terms,
        l.rate,
        l.seconds,
        l.published
    )
}

/// The whole table.
pub(crate) fn table(lines: &[Line]) -> String {
    let mut out = String::from(HEAD);
    for l in lines {
        out.push_str(&row(l));
        out.push('\n');
    }
    out
}

/// The table with the models below it.
pub(crate) fn with_models(lines: &[Line]) -> anyhow::Result<String> {
    let mut part = String::from(
        "Root mean square errors of the free run over the validation recordings, made by `cargo xtask recordings`.\n\n",
    );
    writeln!(part, "{}", table(lines))?;
    writeln!(part, "The models:\n")?;
    let mut last = "";
    for l in lines.iter() {
        if l.set != last {
            writeln!(part, "- {}: `{}`", l.set, l.equation)?;
            last = &l.set;
        }
    }
    Ok(part)
}

/// Puts the text into the page, between these marks.
pub(crate) fn write(path: &Path, marks: (&str, &str), text: &str) -> anyhow::Result<()> {
    let before =
        std::fs::read_to_string(path).unwrap_or_else(|_| format!("# Recordings\n\n{}\n{}\n", marks.0, marks.1));
    let (Some(from), Some(to)) = (before.find(marks.0), before.find(marks.1)) else {
        anyhow::bail!("{}: the marks {marks:?} are missing", path.display());
    };
    let (head, tail) = (&before[..from + marks.0.len()], &before[to..]);
    hysid_io::write_text(path, &format!("{head}\n\n{}\n\n{tail}", text.trim()))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(ours: f64, target: Option<f64>) -> Line {
        Line {
            set: "s".into(),
            file: "f".into(),
            unit: "mV",
            ours,
            linear: 2.0,
            std: 5.0,
            terms: 3,
            rate: 1,
            seconds: 0.1,
            diverged: (!ours.is_finite()).then_some(7),
            target,
            published: "-".into(),
            equation: "y[n] = 1".into(),
        }
    }

    #[test]
    fn a_target_that_is_missed_is_said_to_be() {
        for (ours, target, met) in [
            (0.2, Some(0.25), true),
            (0.3, Some(0.25), false),
            (1.0, None, true),
            (3.0, None, false),
            (f64::INFINITY, None, false),
            (f64::INFINITY, Some(0.25), false),
        ] {
            assert_eq!(row(&line(ours, target)).contains("| yes |"), met, "{ours} {target:?}");
        }
    }

    #[test]
    fn the_page_keeps_what_others_wrote() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("recordings.md");
        std::fs::write(&path, format!("# Head\n\n{}\nold\n{}\n\nTail\n", FIT.0, FIT.1)).unwrap();
        write(&path, FIT, &with_models(&[line(0.2, None)]).unwrap()).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(
            text.starts_with("# Head")
                && text.ends_with("Tail\n")
                && !text.contains("old")
                && text.contains("y[n] = 1")
        );
    }
}
