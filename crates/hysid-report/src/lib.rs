//! One self-contained HTML page with SVG figures, for a fit, a diagnosis or a proof.
//!
//! A page holds no script and fetches nothing: it can be mailed, archived and printed. Text is escaped by construction
//! (maud). Figures are drawn from plain slices; a series longer than the figure has pixels is drawn by its envelope, so
//! that no peak is lost and a page stays small.
//!
//! * [`figure`] draws lines, points, stems, bands and maps.
//! * [`page`] puts sections, facts, tables and figures together.
//! * [`diagnosis`] is the page of a diagnosis, [`fit`] that of an identified model.

pub mod diagnosis;
pub mod figure;
pub mod fit;
pub mod page;
mod words;

pub use words::Provenance;
