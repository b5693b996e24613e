//! The Preisach operator by its staircase memory: the reversals that later ones have not wiped out, and an Everett function.
//!
//! The relays that are up form a staircase in the plane. Its corners are the remembered maxima (falling) and minima (rising):
//! a rise wipes out every lower maximum, a fall every higher minimum. A new sample touches only the last corner and those it
//! wipes out, so its cost is constant on average, whatever the number of relays. Reference: Mayergoyz (1991), sections 1.2
//! and 1.4.

use super::{Everett, Scale, Start};
use crate::Operator;

/// A Preisach operator with staircase memory over the Everett function `E`.
#[derive(Debug, Clone)]
pub struct PreisachStaircase<E> {
    everett: E,
    scale: Scale,
    start: Start,
}

/// The memory: the corners of the staircase, outermost first.
#[derive(Debug, Clone, PartialEq)]
pub struct StaircaseState<L> {
    corners: Vec<Corner<L>>,
}

impl<L> StaircaseState<L> {
    /// The remembered reversals, outermost first: maxima fall and minima rise.
    pub fn corners(&self) -> &[Corner<L>] {
        &self.corners
    }
}

/// One remembered maximum and the minimum after it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner<L> {
    /// The level of the maximum.
    pub maximum: L,
    /// The level of the minimum after it; the upper limit while the input has not fallen since.
    pub minimum: L,
    /// Weight of the relays that were up at the maximum.
    at_maximum: f64,
    /// Weight of those that the minimum has brought down.
    lost: f64,
}

impl<L> Corner<L> {
    fn up(&self) -> f64 {
        self.at_maximum - self.lost
    }
}

impl<E: Everett> PreisachStaircase<E> {
    pub(super) fn new(everett: E, scale: Scale, start: Start) -> Self {
        Self { everett, scale, start }
    }

    /// The Everett function.
    pub fn everett(&self) -> &E {
        &self.everett
    }

    /// The relays that go up at or below `level` go up: maxima up to it are wiped out.
    #[inline]
    fn rise(&self, corners: &mut Vec<Corner<E::Level>>, level: E::Level) {
        while corners.last().is_some_and(|corner| corner.maximum <= level) {
            corners.pop();
        }
        let (lowest, highest) = self.everett.limits();
        let (floor, up) = corners.last().map_or((lowest, 0.0), |corner| (corner.minimum, corner.up()));
        if floor < level {
            let at_maximum = up + self.everett.triangle(level, floor);
            corners.push(Corner { maximum: level, minimum: highest, at_maximum, lost: 0.0 });
        }
    }

    /// The relays that come down at or above `level` come down: minima down to it are wiped out.
    #[inline]
    fn fall(&self, corners: &mut Vec<Corner<E::Level>>, level: E::Level) {
        while let [.., before, _] = corners.as_slice() {
            if before.minimum < level {
                break;
            }
            corners.pop();
        }
        if let Some(last) = corners.last_mut().filter(|last| last.minimum > level) {
            last.minimum = level;
            last.lost = self.everett.triangle(last.maximum, level);
        }
    }
}

impl<E: Everett> Operator for PreisachStaircase<E> {
    type State = StaircaseState<E::Level>;

    fn init(&self) -> Self::State {
        let mut corners = Vec::new();
        let (_, highest) = self.everett.limits();
        match self.start {
            Start::AllOff => {}
            Start::AllOn => self.rise(&mut corners, highest),
            Start::Demagnetised => {
                for (maximum, minimum) in self.everett.demagnetised() {
                    self.rise(&mut corners, maximum);
                    self.fall(&mut corners, minimum);
                }
            }
        }
        StaircaseState { corners }
    }

    #[inline]
    fn step(&self, state: &mut Self::State, u: f64) -> f64 {
        // Whichever way the input went, the other of the two finds nothing to do.
        let (risen, fallen) = self.everett.levels(u);
        self.rise(&mut state.corners, risen);
        self.fall(&mut state.corners, fallen);
        let up = state.corners.last().map_or(0.0, Corner::up);
        self.scale.output(up + self.everett.without_memory(risen))
    }
}
