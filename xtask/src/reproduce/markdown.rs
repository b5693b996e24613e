//! `docs/reproduction.md`: the sections as text.

use std::fmt::Write;

use super::cell::{Cell, Grid, Section};

/// The document.
pub fn document(sections: &[Section]) -> String {
    let mut text = String::from(
        "# The paper's tables, cell by cell\n\n\
         W. Zhang, J. Zhu, D. Gu, \"Identification of robotic systems with hysteresis using Nonlinear AutoRegressive eXogenous input models\", International Journal of Advanced \
         Robotic Systems (2017).\n\n\
         This page is written by `cargo xtask reproduce`; do not edit it by hand. The task ends with status 1 if a claimed cell does not hold.\n\n\
         Marks: `=` ours has the printed digits; `-` it has not, and we do not claim it (the notes say what was tried); `x` a claim that does not hold.\n\n\
         | part | outcome |\n|---|---|\n",
    );
    for s in sections {
        let _ = writeln!(text, "| {} | {} |", s.title, s.summary());
    }
    for s in sections {
        section(&mut text, s);
    }
    text.push_str(ERRORS);
    text
}

fn section(text: &mut String, s: &Section) {
    let _ = write!(text, "\n## {}\n", s.title);
    for line in &s.settings {
        let _ = write!(text, "\n- {line}");
    }
    text.push('\n');
    if !s.cells.is_empty() {
        let right = !s.right_label.is_empty();
        let _ = write!(text, "\n| cell | printed | as the authors computed it | mark |");
        let _ = writeln!(text, "{}", if right { format!(" {} | remark |", s.right_label) } else { " remark |".into() });
        let _ = writeln!(text, "|---|---|---|---|---|{}", if right { "---|" } else { "" });
        for c in &s.cells {
            let _ = write!(text, "| {} | {} | {} | `{}` |", c.name, c.printed, c.rounded(), c.mark());
            if right {
                let _ = write!(text, " {} |", c.right);
            }
            let _ = writeln!(text, " {} |", remark(c));
        }
    }
    for g in &s.grids {
        grid(text, g);
    }
    for note in &s.notes {
        let _ = write!(text, "\n{note}\n");
    }
}

/// What stands beside a cell: its label's correction and why it is not claimed.
pub fn remark(cell: &Cell) -> String {
    let open = match cell.claim {
        super::cell::Claim::Open(why) => why,
        super::cell::Claim::Holds => "",
    };
    [cell.remark.as_str(), open].into_iter().filter(|t| !t.is_empty()).collect::<Vec<_>>().join("; ")
}

fn grid(text: &mut String, g: &Grid) {
    // A bar would end the cell.
    let line = |cells: &[String]| cells.iter().map(|c| c.replace('|', "\\|")).collect::<Vec<_>>().join(" | ");
    let _ = write!(text, "\n{}:\n\n| {} |\n|{}\n", g.caption, line(&g.columns), "---|".repeat(g.columns.len()));
    for row in &g.rows {
        let _ = writeln!(text, "| {} |", line(row));
    }
}

const ERRORS: &str = "\n## Errors in the equations, and the right form\n
- (5): the lag ranges are muddled; (6) is meant. The constant (m = 0) was left out by the authors.
- (9), (10): the index is off by one (r_1 must be Y), a transpose is missing, w is the raw candidate. Right: orthogonalise every candidate, w = phi - sum (phi'w_k / w_k'w_k) w_k.
- (11): the error reduction ratios have different normalisers; use (Y'w_i)^2 / (Y'Y w_i'w_i).
- (15) is right: brute-force leave-one-out equals it (tested in hysid-select). (16): x_T should be x_i.
- (18) lacks a square: SSE / (1 - n/N)^2. N much larger than n, which it needs, does not hold here: 12 to 15 rows for 9 or 10 terms.
- (19) lacks an absolute value, k must stop at N/L - 2, and y = 0 divides. (21): its odd range N/L - 1 contradicts its even range N - L, and y = 0 divides.
- Figure 2 shows a low-pass that the tables did not use; the stated noise is absent from their data (noise of standard deviation 1e-6 would already move the parameters by 3e-4).
- Away from the turning point y is an exact cubic polynomial of (y(t-3), u(t), u(t-3)): tiny one-step errors prove little. Free run is the test.
";
