//! Selection against brute force, doubled precision and systems whose terms are known.

mod common;
mod gram;
mod known_system;
mod precision;
mod press;
mod searches;
