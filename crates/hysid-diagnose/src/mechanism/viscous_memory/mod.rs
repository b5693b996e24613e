//! Linear memory: relaxation and creep.

mod log_creep;
mod viscoelastic;

pub use log_creep::LOG_CREEP;
pub use viscoelastic::VISCOELASTIC;
