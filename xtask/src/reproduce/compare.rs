//! What it was all for: the paper's recipe and the default of `hysid fit`, on the same two systems with the stated noise.

use super::cell::Section;

/// The section.
pub fn section() -> anyhow::Result<Section> {
    Ok(Section { title: "The default fit beside the paper's recipe".into(), ..Section::default() })
}
