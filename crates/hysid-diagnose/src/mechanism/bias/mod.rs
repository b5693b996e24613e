//! Constants.

mod input_offset;
mod output_offset;

pub use input_offset::INPUT_OFFSET;
pub use output_offset::OUTPUT_OFFSET;
