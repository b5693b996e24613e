//! A cell of a printed table beside ours, and a section of such cells.

use hysid_report::figure::Plot;

/// What we say of a cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Claim {
    /// We say that ours has the printed digits.
    Holds,
    /// We do not reach the printed value; why, or what was tried.
    Open(&'static str),
}

/// One printed value and ours.
#[derive(Debug, Clone)]
pub struct Cell {
    /// Which cell: row and column of the printed table.
    pub name: String,
    /// The printed value, digit by digit.
    pub printed: &'static str,
    /// Ours as the authors must have computed it.
    pub authors: f64,
    /// Ours by the right equations, as text; empty where there is nothing to set beside it.
    pub right: String,
    /// What we say of it.
    pub claim: Claim,
    /// A remark on this cell, such as a label that is printed wrong.
    pub remark: String,
}

impl Cell {
    /// Ours with as many decimals as the printed value has.
    pub fn rounded(&self) -> String {
        let decimals = self.printed.split_once('.').map_or(0, |(_, d)| d.len());
        // A value a rounding error below a half must not decide.
        let nudge = self.authors.signum() * 1e-12;
        format!("{:.decimals$}", self.authors + nudge)
    }

    /// Whether ours has the printed digits.
    pub fn agrees(&self) -> bool {
        self.rounded() == self.printed
    }

    /// The mark: `=` for the printed digits, `x` for a claim that does not hold, `-` for a value that is not claimed.
    pub fn mark(&self) -> &'static str {
        match (self.agrees(), &self.claim) {
            (true, _) => "=",
            (false, Claim::Holds) => "x",
            (false, Claim::Open(_)) => "-",
        }
    }
}

/// A plain table of our own results.
#[derive(Debug, Clone, Default)]
pub struct Grid {
    /// What it shows.
    pub caption: String,
    /// The headings.
    pub columns: Vec<String>,
    /// The rows, as text.
    pub rows: Vec<Vec<String>>,
}

/// One part of the reproduction.
#[derive(Debug, Clone, Default)]
pub struct Section {
    /// Its heading.
    pub title: String,
    /// How the values were computed.
    pub settings: Vec<String>,
    /// What the third column ("by the right equations") holds.
    pub right_label: String,
    /// The cells.
    pub cells: Vec<Cell>,
    /// Tables of results that have no printed counterpart.
    pub grids: Vec<Grid>,
    /// What follows from it, and what was tried.
    pub notes: Vec<String>,
    /// The figures with their captions.
    pub figures: Vec<(Plot, String)>,
}

impl Section {
    /// Cells that are claimed.
    pub fn claimed(&self) -> usize {
        self.cells.iter().filter(|c| c.claim == Claim::Holds).count()
    }

    /// One line on how many cells hold.
    pub fn summary(&self) -> String {
        if self.cells.is_empty() {
            return "no printed cells; see the tables of the section".to_owned();
        }
        let agreeing = self.cells.iter().filter(|c| c.agrees()).count();
        format!("{agreeing} of {} cells to the printed digit ({} claimed)", self.cells.len(), self.claimed())
    }

    /// The claimed cells that do not hold, a line each.
    pub fn broken_claims(&self) -> Vec<String> {
        let broken = self.cells.iter().filter(|c| c.claim == Claim::Holds && !c.agrees());
        broken.map(|c| format!("{}, {}: printed {}, ours {}", self.title, c.name, c.printed, c.rounded())).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_agrees_only_to_the_printed_digit() {
        let cell = |printed, authors| Cell {
            name: String::new(),
            printed,
            authors,
            right: String::new(),
            claim: Claim::Holds,
            remark: String::new(),
        };
        for (printed, ours, expected) in [
            ("0.0129", 0.012_917, true),
            ("0.0129", 0.012_951, false),
            ("-0.3914", -0.391_38, true),
            ("0.99", 0.9884, true),
        ] {
            assert_eq!(cell(printed, ours).agrees(), expected, "{printed} {ours}");
        }
    }
}
