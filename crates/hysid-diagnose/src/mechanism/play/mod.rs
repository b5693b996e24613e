//! Backlash, and how a play begins.

mod backlash;

pub use backlash::BACKLASH;

/// A play of this half-width over `signal`, as text, that an input which came from `from` has moved by the first sample. Of its own a play begins in the
/// middle of its band. The first time is the time delayed by the whole recording, `T_r`.
pub(super) fn moved_play(signal: &str, radius: &str, from: &str) -> String {
    format!("play({signal} + (1 - sign(t - delay(t, T_r)))*max(min({from} - {signal}, {radius}), -{radius}), {radius})")
}
