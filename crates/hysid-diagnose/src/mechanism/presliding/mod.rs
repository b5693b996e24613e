//! Friction with an elastic part before sliding.

mod dahl;
mod elastoplastic;
mod lugre;

pub use dahl::DAHL_FRICTION;
pub use elastoplastic::ELASTOPLASTIC_FRICTION;
pub use lugre::LUGRE_FRICTION;
