//! The model in other notations: LaTeX for people, C and Python for machines.

mod code;
mod latex;
