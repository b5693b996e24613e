//! Hysteresis operators: an immutable model and a separate state for each, with the laws they obey as a conformance suite.
//!
//! An [`Operator`] maps an input sample to an output sample and keeps what it remembers in its own [`Operator::State`], so one
//! model serves many runs, on any thread. Operators without time (relay, play, stop, Preisach, Prandtl-Ishlinskii, Maxwell
//! slip) are operators as they stand. Operators given by a differential equation (Bouc-Wen, Dahl, LuGre, ...) implement
//! [`Differential`] and become operators by [`Sampled`], which adds the sampling period and integrates by RK4.
//!
//! ```
//! use hysid_hysteresis::{Operator, Play};
//! let gear = Play::new(0.5)?;
//! assert_eq!(gear.run(&[0.0, 1.0, 0.8, -1.0]), vec![0.0, 0.5, 0.5, -0.5]);
//! # Ok::<(), hysid_hysteresis::ParameterError>(())
//! ```

mod baber_noori;
mod bouc_wen;
pub mod catalogue;
pub mod conformance;
mod dahl;
mod differential;
mod duhem;
mod error;
mod goman_khrabrov;
mod jiles_atherton;
mod lugre;
mod maxwell_slip;
mod operator;
mod play;
mod prandtl_ishlinskii;
pub mod preisach;
mod reduced_frequency;
mod relay;
mod stop;

pub use baber_noori::{BaberNoori, Degradation, Pinching};
pub use bouc_wen::{BoucWen, BoucWenParameters};
pub use dahl::{Dahl, dahl};
pub use differential::{Differential, Sampled, SampledState, rk4};
pub use duhem::{Duhem, DuhemParameters};
pub use error::ParameterError;
pub use goman_khrabrov::{GomanKhrabrov, GomanKhrabrovParameters};
pub use jiles_atherton::{JilesAtherton, JilesAthertonParameters};
pub use lugre::{LuGre, LuGreParameters};
pub use maxwell_slip::{MaxwellSlip, SlipElement};
pub use operator::{DynOperator, Operator, Running};
pub use play::{Play, play};
pub use prandtl_ishlinskii::{PrandtlIshlinskii, WeightedPlay};
pub use preisach::{PreisachGrid, PreisachPlane, PreisachStaircase};
pub use reduced_frequency::{ReducedFrequency, ReducedFrequencyParameters, Wing};
pub use relay::{Relay, RelayState, relay};
pub use stop::Stop;

// The snippet of the page is run with the tests.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/operators.md")]
struct OperatorsPage;
