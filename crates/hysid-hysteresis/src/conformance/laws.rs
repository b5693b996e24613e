//! How each law is tested.

use super::path::{Paths, STEPS};
use super::{Law, Laws, Violation};
use crate::DynOperator;

/// Random cases for each law.
const TRIALS: usize = 12;

/// An operator under test.
pub(super) struct Test<'a> {
    op: &'a dyn DynOperator,
    laws: &'a Laws,
    /// What is allowed as an error of the output.
    slack: f64,
}

fn broken(law: impl Into<String>, detail: String) -> Result<(), Violation> {
    Err(Violation { law: law.into(), detail })
}

impl<'a> Test<'a> {
    pub(super) fn new(op: &'a dyn DynOperator, laws: &'a Laws) -> Self {
        let mut test = Self { op, laws, slack: 0.0 };
        let mut paths = test.paths();
        let reversals = paths.reversals(8);
        let y = op.respond(&paths.through(&reversals));
        let range = y.iter().copied().fold(f64::MIN, f64::max) - y.iter().copied().fold(f64::MAX, f64::min);
        test.slack = laws.tolerance * if range > 0.0 && range.is_finite() { range } else { 1.0 };
        test
    }

    fn paths(&self) -> Paths {
        Paths::new(self.laws.lower, self.laws.upper, self.laws.seed)
    }

    /// What every operator must hold.
    pub(super) fn every_operator(&self) -> Result<(), Violation> {
        let mut paths = self.paths();
        let mut reversals = paths.reversals(8);
        // Both ends of the range are visited.
        reversals.extend([STEPS, 0]);
        let u = paths.through(&reversals);
        let y = self.op.respond(&u);
        if y.len() != u.len() {
            return broken("one output for each input", format!("{} outputs for {} inputs", y.len(), u.len()));
        }
        if let Some(n) = y.iter().position(|y| !y.is_finite()) {
            return broken("finite output", format!("{} at sample {n}, input {}", y[n], u[n]));
        }
        if self.op.respond(&u) != y {
            return broken("repeatability", "a second run over the same input differs".into());
        }
        let mut run = self.op.start();
        let middle = u.len() / 2;
        for n in 0..u.len() {
            if n == middle {
                let mut fork = run.fork();
                let continued: Vec<f64> = u[n..].iter().map(|u| fork.step(*u)).collect();
                if continued != y[n..] {
                    return broken("a fork continues the run", format!("forked at sample {n}"));
                }
            }
            if run.step(u[n]) != y[n] {
                return broken("a run is its steps", format!("sample {n} differs; a fork was taken at {middle}"));
            }
        }
        // Only that there is no panic: what comes out is not specified.
        self.op.respond(&[
            0.0,
            f64::NAN,
            1.0,
            f64::INFINITY,
            f64::NEG_INFINITY,
            1e300,
            -1e300,
            f64::MAX,
            f64::MIN,
            0.0,
        ]);
        self.op.respond(&[]);
        Ok(())
    }

    pub(super) fn law(&self, law: Law) -> Result<(), Violation> {
        let mut paths = self.paths();
        for _ in 0..TRIALS {
            match law {
                Law::RateIndependent => self.rate_independent(&mut paths),
                Law::WipingOut => self.wiping_out(&mut paths),
                Law::Congruent => self.congruent(&mut paths),
                Law::Monotone => self.monotone(&mut paths),
                Law::Odd => self.odd(&mut paths),
                Law::Bounded { lowest, highest } => self.bounded(&mut paths, lowest, highest),
                Law::Work => self.dissipates(&mut paths, Law::Work, |u, y, v, z| 0.5 * (y + z) * (v - u)),
                Law::LagWork => self.dissipates(&mut paths, Law::LagWork, |u, y, v, z| 0.5 * (u + v) * (z - y)),
            }?;
        }
        Ok(())
    }

    /// The first sample where two outputs that should be equal are not.
    fn differ(&self, a: &[f64], b: &[f64]) -> Option<String> {
        let n = a.iter().zip(b).position(|(a, b)| (a - b).abs() > self.slack)?;
        Some(format!("{} and {} at sample {n} of the comparison", a[n], b[n]))
    }

    fn rate_independent(&self, paths: &mut Paths) -> Result<(), Violation> {
        let reversals = paths.reversals(6);
        let u = paths.through(&reversals);
        // Each step is held for a while, or gone in several smaller ones.
        let (mut warped, mut at) = (vec![u[0]], vec![0]);
        for pair in u.windows(2) {
            let parts = paths.between(1, 4);
            warped.extend((1..parts).map(|p| pair[0] + (pair[1] - pair[0]) * p as f64 / parts as f64));
            warped.push(pair[1]);
            at.push(warped.len() - 1);
            warped.extend(std::iter::repeat_n(pair[1], paths.between(0, 2)));
        }
        let slow = self.op.respond(&warped);
        let slow: Vec<f64> = at.into_iter().map(|n| slow[n]).collect();
        match self.differ(&self.op.respond(&u), &slow) {
            Some(detail) => broken("RateIndependent", format!("with the time stretched, outputs are {detail}")),
            None => Ok(()),
        }
    }

    fn wiping_out(&self, paths: &mut Paths) -> Result<(), Violation> {
        // From both ends of the range to a maximum, then perhaps down into inner loops and back up to it, then a probe.
        let maximum = paths.between(STEPS / 4, STEPS - 1);
        let minimum = paths.between(1, maximum - 1);
        let mut inner = vec![minimum];
        inner.extend((0..4).map(|_| paths.between(minimum, maximum)));
        let mut probe = vec![maximum];
        probe.extend(paths.reversals(3));
        let start = [STEPS, 0, maximum];
        let with: Vec<usize> = start.iter().chain(&inner).chain(&probe).copied().collect();
        let without: Vec<usize> = start.iter().chain(&probe).copied().collect();
        let length = paths.through(&probe).len();
        let tail = |reversals: &[usize]| {
            let y = self.op.respond(&paths.through(reversals));
            y[y.len() - length..].to_vec()
        };
        match self.differ(&tail(&with), &tail(&without)) {
            Some(detail) => broken("WipingOut", format!("after a wiped-out loop below {maximum} of {STEPS}: {detail}")),
            None => Ok(()),
        }
    }

    fn congruent(&self, paths: &mut Paths) -> Result<(), Violation> {
        let low = paths.between(0, STEPS - 2);
        let high = paths.between(low + 1, STEPS);
        let mut shape = || {
            let mut reversals = paths.reversals(4);
            reversals.extend([low, high, low, high]);
            let y = self.op.respond(&paths.through(&reversals));
            let last = &y[y.len() - 1 - (high - low)..];
            last.iter().map(|y| y - last[0]).collect::<Vec<f64>>()
        };
        match self.differ(&shape(), &shape()) {
            Some(detail) => {
                broken("Congruent", format!("minor loops between steps {low} and {high} after two histories: {detail}"))
            }
            None => Ok(()),
        }
    }

    fn monotone(&self, paths: &mut Paths) -> Result<(), Violation> {
        let reversals = paths.reversals(6);
        let u = paths.through(&reversals);
        let y = self.op.respond(&u);
        match (1..u.len()).find(|&n| (u[n] - u[n - 1]).signum() * (y[n] - y[n - 1]) < -self.slack) {
            Some(n) => {
                broken("Monotone", format!("input from {} to {}, output from {} to {}", u[n - 1], u[n], y[n - 1], y[n]))
            }
            None => Ok(()),
        }
    }

    fn odd(&self, paths: &mut Paths) -> Result<(), Violation> {
        let reversals = paths.reversals(6);
        let u = paths.through(&reversals);
        let mirrored: Vec<f64> = u.iter().map(|u| -u).collect();
        let y: Vec<f64> = self.op.respond(&mirrored).iter().map(|y| -y).collect();
        match self.differ(&self.op.respond(&u), &y) {
            Some(detail) => broken("Odd", detail),
            None => Ok(()),
        }
    }

    fn bounded(&self, paths: &mut Paths, lowest: f64, highest: f64) -> Result<(), Violation> {
        let reversals = paths.reversals(6);
        let u = paths.through(&reversals);
        let y = self.op.respond(&u);
        match y.iter().position(|y| *y < lowest - self.slack || *y > highest + self.slack) {
            Some(n) => broken("Bounded", format!("{} outside [{lowest}, {highest}] at input {}", y[n], u[n])),
            None => Ok(()),
        }
    }

    /// The energy of one cycle after some that let the operator settle; `part` is the energy from (u, y) to (v, z).
    ///
    /// A cycle that has not settled does not close: what it left behind, times the range of the input, may be missing.
    fn dissipates(
        &self,
        paths: &mut Paths,
        law: Law,
        part: impl Fn(f64, f64, f64, f64) -> f64,
    ) -> Result<(), Violation> {
        let turns = paths.between(2, 5);
        let cycle = paths.reversals(turns);
        let mut reversals: Vec<usize> = cycle.iter().copied().cycle().take(10 * turns).collect();
        reversals.push(cycle[0]);
        let u = paths.through(&reversals);
        let y = self.op.respond(&u);
        let mut one = cycle.clone();
        one.push(cycle[0]);
        let (start, end) = (u.len() - paths.through(&one).len(), u.len() - 1);
        let energy: f64 = (start + 1..=end).map(|n| part(u[n - 1], y[n - 1], u[n], y[n])).sum();
        let missing = ((y[end] - y[start]).abs() + self.slack) * (self.laws.upper - self.laws.lower);
        if energy < -missing {
            return broken(format!("{law:?}"), format!("a cycle through the steps {cycle:?} gives off {}", -energy));
        }
        Ok(())
    }
}
