//! The electrical side of a drive.

mod back_emf;

pub use back_emf::BACK_EMF;
