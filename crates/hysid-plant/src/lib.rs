//! Simulation files (`.sim.toml`): parse, compile, simulate, sensitivities, calibrate.
//!
//! [`Simulation`] is the document as the user wrote it, with its equations as [`Expr`] trees that can be rewritten and
//! printed again. Nothing here knows a mechanism: what is missing in a simulation is found elsewhere, by rewriting one
//! `Simulation` into another.

mod calibrate;
mod dimension;
mod document;
mod engine;
mod error;
mod expr;
mod number;
mod still;
mod unit;

pub use calibrate::{Calibration, CalibrationError, Data, Effort, Flag, INITIAL_SHARE, Settings};
pub use document::{ClockSource, Hold, Initial, Input, LARGEST_FILE, Output, Parameter, Simulation, State, Time};
pub use engine::{
    Compiled, DataError, Direction, Drive, Injection, Linearisation, Observer, Response, Run, Sensitivity, Slot, Start,
    StepCheck,
};
pub use error::{Error, ErrorKind, Place};
pub use expr::{BinaryOp, Expr, ExprError, Function, Memory, is_legal_symbol};
pub use unit::{Unit, UnitError};
