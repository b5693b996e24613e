//! Recordings in which an effect is concealed, for the proof. Shares no simulation code with the engine.
//!
//! A case is a plant that a simulation describes well, an effect that the simulation leaves out, noise, and wrong parameters.
//! [`bank`] draws cases by seed and writes, for each, a folder with what the program under test may see; the labels go to one
//! separate file. The integrator ([`integrate`]) is adaptive and locates events, friction has a hard sign and sticks.

pub mod bank;
pub mod body;
pub mod case;
pub mod design;
pub mod excite;
pub mod input;
pub mod integrate;
pub mod law;
pub mod machine;
pub mod noise;
pub mod oracle;
pub mod refit;
pub mod seed;
pub mod strength;
