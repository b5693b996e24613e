//! The Preisach operator, equation (1) of Zhang, Zhu and Gu (2017): a weighted sum of relays over the half-plane `alpha >= beta`.
//!
//! `y(t) = sum mu(alpha, beta) R_{alpha beta}[u](t)`, where the relay goes up at `alpha` and down at `beta`. A
//! [`PreisachPlane`] says which relays there are; it makes three operators:
//!
//! - [`PreisachGrid`]: every relay one by one, the reference. Cost per sample proportional to the number of relays.
//! - [`PreisachStaircase`] over [`RelayTable`]: the same relays, remembered by the reversals that the input has not wiped out,
//!   and summed by an Everett function. Same output; cost per sample independent of the number of relays.
//! - [`PreisachStaircase`] over [`SmoothTable`]: the density spread over the cells of the grid, so that the output has no steps.
//!
//! The plane between `lower` and `upper` is cut into `cells` times `cells` cells. Cell (i, j) with `j < i` holds one relay whose
//! thresholds are the middles of the cells i (going up) and j (coming down). A cell on the diagonal has equal thresholds: a
//! relay without memory. References: Preisach, Z. Phys. 94 (1935) 277-302; Everett, Trans. Faraday Soc. 51 (1955) 1551-1557;
//! Mayergoyz, *Mathematical Models of Hysteresis* (1991).

mod everett;
mod grid;
mod staircase;

pub use everett::{Everett, RelayTable, SmoothTable};
pub use grid::PreisachGrid;
pub use staircase::{Corner, PreisachStaircase, StaircaseState};

use crate::ParameterError;
use crate::error::Check;

/// How the weight of the relays is spread over the plane. Only ratios matter where [`PreisachPlane::saturation`] is given.
///
/// The coercive field of a relay is `(alpha - beta)/2`, its interaction field `(alpha + beta)/2`.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Density {
    /// The same everywhere.
    Uniform,
    /// `exp(-((c - c0)/sc)^2/2) exp(-((m - m0)/sm)^2/2)` of the coercive field c and the interaction field m.
    Gaussian(Fields),
    /// `1/(1 + ((c - c0)/sc)^2) 1/(1 + ((m - m0)/sm)^2)` of the coercive field c and the interaction field m.
    Lorentzian(Fields),
    /// A weight for each cell, row by row: (0,0), (1,0), (1,1), (2,0), ...; the first index counts `alpha` upwards, the second `beta`.
    Table(Vec<f64>),
}

/// Centres and widths of a density, in the unit of the input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fields {
    /// The commonest coercive field, c0.
    pub coercive: f64,
    /// Its spread, sc.
    pub coercive_width: f64,
    /// The commonest interaction field, m0.
    pub interaction: f64,
    /// Its spread, sm.
    pub interaction_width: f64,
}

/// Whether the cells on the line `alpha = beta` belong to the plane: they add a part without memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Diagonal {
    /// Left out, as in the paper's data.
    Excluded,
    /// Included, with half a cell's weight since only half of the cell lies in the plane.
    Included,
}

/// The two outputs of a relay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Levels {
    /// 0 when down and 1 when up.
    ZeroOne,
    /// -1 when down and 1 when up.
    MinusPlus,
}

/// What the relays remember before the first sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// All are down: as after an input far below `lower`.
    AllOff,
    /// All are up: as after an input far above `upper`.
    AllOn,
    /// Up where `alpha + beta` is below `lower + upper`: as after slowly decaying reversals about the middle.
    Demagnetised,
}

/// Which relays a Preisach operator has.
#[derive(Debug, Clone, PartialEq)]
pub struct PreisachPlane {
    /// The input at and below which all relays are down.
    pub lower: f64,
    /// The input at and above which all relays are up.
    pub upper: f64,
    /// Cells along each side, 1 to 4096.
    pub cells: usize,
    /// How the weight is spread.
    pub density: Density,
    /// Whether the diagonal belongs to the plane.
    pub diagonal: Diagonal,
    /// The relays' two outputs.
    pub levels: Levels,
    /// What they remember before the first sample.
    pub start: Start,
    /// The output with all relays up; `None` sums the weights as they stand.
    pub saturation: Option<f64>,
}

/// Most cells along a side: the tables then take 200 MB.
const MOST_CELLS: usize = 4096;

impl PreisachPlane {
    /// A plane of even density between `lower` and `upper`: relays of -1 and 1, all down at first, the diagonal included, saturating at 1.
    pub fn uniform(lower: f64, upper: f64, cells: usize) -> Self {
        Self {
            lower,
            upper,
            cells,
            density: Density::Uniform,
            diagonal: Diagonal::Included,
            levels: Levels::MinusPlus,
            start: Start::AllOff,
            saturation: Some(1.0),
        }
    }

    /// The plane behind the paper's Preisach data: 4950 relays of 0 and 1 between -0.5 and 0.5, all down, saturating at 0.25.
    pub fn of_the_paper() -> Self {
        Self {
            diagonal: Diagonal::Excluded,
            levels: Levels::ZeroOne,
            saturation: Some(0.25),
            ..Self::uniform(-0.5, 0.5, 100)
        }
    }

    /// The operator that keeps every relay: the reference.
    ///
    /// # Errors
    /// `upper` not above `lower`, no cells or too many, a table of a wrong size, a negative weight, no weight at all, a width
    /// that is not above zero.
    pub fn grid(&self) -> Result<PreisachGrid, ParameterError> {
        Ok(PreisachGrid::new(self.weights()?))
    }

    /// The operator with the same output as [`Self::grid`] at a cost that does not depend on the number of relays.
    ///
    /// # Errors
    /// As for [`Self::grid`].
    pub fn staircase(&self) -> Result<PreisachStaircase<RelayTable>, ParameterError> {
        let weights = self.weights()?;
        Ok(PreisachStaircase::new(RelayTable::new(&weights), weights.scale, self.start))
    }

    /// The operator whose density is spread evenly over each cell, so that its output has no steps.
    ///
    /// # Errors
    /// As for [`Self::grid`].
    pub fn smooth(&self) -> Result<PreisachStaircase<SmoothTable>, ParameterError> {
        let weights = self.weights()?;
        Ok(PreisachStaircase::new(SmoothTable::new(&weights), weights.scale, self.start))
    }

    /// The checked weights of all cells.
    fn weights(&self) -> Result<Weights, ParameterError> {
        let check = Check("preisach");
        check.finite("lower", self.lower)?;
        check.finite("upper", self.upper)?;
        check.require("upper", self.upper, self.upper > self.lower, &format!("above lower = {}", self.lower))?;
        let cells = self.cells;
        check.require("cells", cells as f64, (1..=MOST_CELLS).contains(&cells), "1 to 4096")?;
        if let Density::Gaussian(f) | Density::Lorentzian(f) = &self.density {
            check.finite("coercive", f.coercive)?;
            check.finite("interaction", f.interaction)?;
            check.positive("coercive_width", f.coercive_width)?;
            check.positive("interaction_width", f.interaction_width)?;
        }
        if let Density::Table(table) = &self.density {
            let size = cells * (cells + 1) / 2;
            let what = format!("{size} for {cells} cells along a side");
            check.require("the table's size", table.len() as f64, table.len() == size, &what)?;
        }
        let width = (self.upper - self.lower) / cells as f64;
        let middles: Vec<f64> = (0..cells).map(|i| self.lower + (i as f64 + 0.5) * width).collect();
        let mut weight = Vec::with_capacity(cells * (cells + 1) / 2);
        for i in 0..cells {
            for j in 0..=i {
                let w = match (&self.density, self.diagonal) {
                    (_, Diagonal::Excluded) if i == j => 0.0,
                    (Density::Table(table), _) => table[weight.len()],
                    (density, _) => {
                        let cell = density.at((middles[i] - middles[j]) / 2.0, (middles[i] + middles[j]) / 2.0);
                        if i == j { cell / 2.0 } else { cell }
                    }
                };
                check.not_negative("a relay's weight", w)?;
                weight.push(w);
            }
        }
        let total: f64 = weight.iter().sum();
        check.require("the sum of the weights", total, total > 0.0 && total.is_finite(), "a finite number above 0")?;
        let saturation = self.saturation.unwrap_or(total);
        check.finite("saturation", saturation)?;
        let scale = Scale { total, saturation, levels: self.levels };
        Ok(Weights { lower: self.lower, width, middles, weight, scale, start: self.start })
    }
}

impl Density {
    /// The density at a coercive and an interaction field; a table has none (its cells are read by number).
    fn at(&self, coercive: f64, interaction: f64) -> f64 {
        let distances = |f: &Fields| {
            ((coercive - f.coercive) / f.coercive_width, (interaction - f.interaction) / f.interaction_width)
        };
        match self {
            Self::Uniform | Self::Table(_) => 1.0,
            Self::Gaussian(f) => {
                let (c, m) = distances(f);
                (-0.5 * (c * c + m * m)).exp()
            }
            Self::Lorentzian(f) => {
                let (c, m) = distances(f);
                1.0 / ((1.0 + c * c) * (1.0 + m * m))
            }
        }
    }
}

/// A checked plane: what the operators are made from.
#[derive(Debug, Clone)]
struct Weights {
    /// The input at the lower edge of cell 0.
    lower: f64,
    /// A cell's width.
    width: f64,
    /// The middle of each cell: the thresholds.
    middles: Vec<f64>,
    /// Weight of cell (i, j), `j <= i`, at `i(i + 1)/2 + j`.
    weight: Vec<f64>,
    scale: Scale,
    start: Start,
}

impl Weights {
    fn at(&self, i: usize, j: usize) -> f64 {
        self.weight[i * (i + 1) / 2 + j]
    }

    fn cells(&self) -> usize {
        self.middles.len()
    }
}

/// From the weight of the relays that are up to the output.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Scale {
    total: f64,
    saturation: f64,
    levels: Levels,
}

impl Scale {
    #[inline]
    fn output(&self, up: f64) -> f64 {
        // Multiplied before it is divided: the paper's data then come out to the last bit.
        match self.levels {
            Levels::ZeroOne => self.saturation * up / self.total,
            Levels::MinusPlus => self.saturation * (2.0 * up - self.total) / self.total,
        }
    }
}

#[cfg(test)]
mod tests;
