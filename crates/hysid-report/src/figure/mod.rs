//! Figures as SVG text: [`Plot`] for anything over two axes, [`Map`] for a value over a grid of cells.

mod legend;
mod map;
mod plot;
mod thin;

pub use legend::Mark;
pub use map::{Map, Scale};
pub use plot::{Band, Layer, LogAxes, Plot, Tone};
pub use thin::envelope;

/// Why a figure could not be drawn: the drawing library's words.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("a figure could not be drawn: {0}")]
pub struct FigureError(pub String);

impl FigureError {
    fn of(error: impl std::fmt::Display) -> Self {
        Self(error.to_string())
    }
}
