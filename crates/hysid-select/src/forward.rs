//! Orthogonal forward regression on inner products: a pivoted Cholesky factorisation that grows and shrinks a row at a time.
//!
//! With the chosen columns taken out, candidate j has the energy S_j and the inner product c_j with what is left of the
//! target; its error reduction ratio is c_j^2 / S_j. Choosing a column subtracts its row of the factor from both; giving
//! one back rotates its direction into the last row (Givens) and adds that row again.

use crate::evidence::Evidence;
use crate::moments::Moments;

/// An inner product of unit vectors below this is rounding.
pub(crate) const NOISE: f64 = 64.0 * f64::EPSILON;

/// The factor so far, and what is left of every candidate.
#[derive(Clone)]
pub(crate) struct Factor {
    /// The chosen columns, in order.
    pub chosen: Vec<usize>,
    /// Inner product of each chosen column's new direction with the target.
    pub gain: Vec<f64>,
    /// Row i of the factor, for all candidates.
    rows: Vec<Vec<f64>>,
    /// Energy left of each candidate.
    pub energy: Vec<f64>,
    /// Inner product left of each candidate with the target.
    pub cross: Vec<f64>,
}

/// A chosen column seen from the others: what its own direction (orthogonal to all others chosen) holds.
pub(crate) struct Member {
    /// Energy that the target would have left in addition without it.
    pub worth: f64,
    /// Its direction, as a combination of the factor's rows.
    direction: Vec<f64>,
}

impl Factor {
    pub fn new<E: Evidence + ?Sized>(moments: &Moments<'_, E>) -> Self {
        let energy = (0..moments.len()).map(|j| if moments.is_zero(j) { 0.0 } else { 1.0 }).collect();
        let cross = moments.cross.clone();
        Self { chosen: Vec::new(), gain: Vec::new(), rows: Vec::new(), energy, cross }
    }

    /// The factor of these columns in this order, leaving out what the guard does not let in.
    pub fn of<E: Evidence + ?Sized>(moments: &mut Moments<'_, E>, columns: &[usize], guard: f64) -> Self {
        let mut factor = Self::new(moments);
        for (i, &j) in columns.iter().enumerate() {
            if factor.energy[j] > guard {
                moments.make(j, columns[i..].iter().copied());
                factor.add(j, moments.column(j));
            }
        }
        factor
    }

    /// Error reduction ratio of the chosen column of this place.
    pub fn err(&self, place: usize) -> f64 {
        self.gain[place] * self.gain[place]
    }

    /// Energy that the chosen column of this place had left when it was chosen.
    pub fn pivot(&self, place: usize) -> f64 {
        let diagonal = self.rows[place][self.chosen[place]];
        diagonal * diagonal
    }

    /// What is left of the target's energy.
    pub fn sse(&self) -> f64 {
        1.0 - self.gain.iter().map(|g| g * g).sum::<f64>()
    }

    /// The error reduction ratio that candidate `j` would have; `None` if it may not be chosen.
    pub fn score(&self, j: usize, guard: f64) -> Option<f64> {
        score(self.energy[j], self.cross[j], guard)
    }

    /// The candidates with the largest scores, best first, ties by number.
    pub fn best(&self, count: usize, guard: f64) -> Vec<usize> {
        let mut scored: Vec<(f64, usize)> =
            (0..self.energy.len()).filter_map(|j| self.score(j, guard).map(|s| (s, j))).collect();
        let by = |a: &(f64, usize), b: &(f64, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        if scored.len() > count && count > 0 {
            scored.select_nth_unstable_by(count - 1, by);
            scored.truncate(count);
        }
        scored.sort_by(by);
        scored.into_iter().map(|(_, j)| j).collect()
    }

    /// Takes candidate `j`, given its column of the Gram matrix.
    pub fn add(&mut self, j: usize, gram: &[f64]) {
        let mut row = gram.to_vec();
        for before in &self.rows {
            let a = before[j];
            for (r, b) in row.iter_mut().zip(before) {
                *r -= a * b;
            }
        }
        let diagonal = self.energy[j].sqrt();
        let inverse = 1.0 / diagonal;
        let gain = self.cross[j] * inverse;
        for ((r, s), c) in row.iter_mut().zip(&mut self.energy).zip(&mut self.cross) {
            *r *= inverse;
            *s -= *r * *r;
            *c -= *r * gain;
        }
        // What the algebra makes zero is zero: a chosen column has nothing left, and the factor is triangular.
        for &k in &self.chosen {
            row[k] = 0.0;
        }
        row[j] = diagonal;
        self.rows.push(row);
        self.chosen.push(j);
        self.gain.push(gain);
        self.clear_chosen();
    }

    /// Gives back the chosen column of this place.
    pub fn remove(&mut self, place: usize) {
        let removed = self.chosen.remove(place);
        let last = self.rows.len() - 1;
        for p in place..last {
            let c = self.chosen[p];
            let (head, tail) = self.rows.split_at_mut(p + 1);
            let (upper, lower) = (&mut head[p], &mut tail[0]);
            let (a, b) = (upper[c], lower[c]);
            let r = a.hypot(b);
            let (cs, sn) = (a / r, b / r);
            for (u, l) in upper.iter_mut().zip(lower.iter_mut()) {
                (*u, *l) = (cs * *u + sn * *l, cs * *l - sn * *u);
            }
            (upper[c], lower[c]) = (r, 0.0);
            let (gu, gl) = (self.gain[p], self.gain[p + 1]);
            (self.gain[p], self.gain[p + 1]) = (cs * gu + sn * gl, cs * gl - sn * gu);
        }
        if let (Some(row), Some(gain)) = (self.rows.pop(), self.gain.pop()) {
            for ((r, s), c) in row.iter().zip(&mut self.energy).zip(&mut self.cross) {
                *s += r * r;
                *c += r * gain;
            }
            self.energy[removed] = row[removed] * row[removed];
            self.cross[removed] = row[removed] * gain;
        }
        self.clear_chosen();
    }

    fn clear_chosen(&mut self) {
        for &k in &self.chosen {
            (self.energy[k], self.cross[k]) = (0.0, 0.0);
        }
    }

    /// Every chosen column seen from the others.
    ///
    /// The direction of column i that is orthogonal to the others is the i-th row of the factor's inverse, in terms of the
    /// factor's rows.
    pub fn members(&self) -> Vec<Member> {
        let n = self.chosen.len();
        (0..n)
            .map(|i| {
                // T' v = e_i by forward substitution; v is zero before place i.
                let mut v = vec![0.0; n];
                for b in i..n {
                    let known: f64 = (i..b).map(|a| self.rows[a][self.chosen[b]] * v[a]).sum();
                    v[b] = (f64::from(u8::from(b == i)) - known) / self.rows[b][self.chosen[b]];
                }
                let norm = v.iter().map(|x| x * x).sum::<f64>().sqrt();
                v.iter_mut().for_each(|x| *x /= norm);
                let gain: f64 = v.iter().zip(&self.gain).map(|(x, g)| x * g).sum();
                Member { worth: gain * gain, direction: v }
            })
            .collect()
    }

    /// The candidate that would best take the place of a member, and the energy it would explain; ties by number.
    pub fn best_replacement(&self, place: usize, member: &Member, guard: f64) -> Option<(usize, f64)> {
        let removed = self.chosen[place];
        let mut back = vec![0.0; self.energy.len()];
        let mut gain = 0.0;
        for ((row, v), g) in self.rows.iter().zip(&member.direction).zip(&self.gain).skip(place) {
            gain += v * g;
            for (b, r) in back.iter_mut().zip(row) {
                *b += v * r;
            }
        }
        let mut best: Option<(usize, f64)> = None;
        for (j, b) in back.iter().enumerate() {
            // A chosen column has no energy left and none along a direction orthogonal to it, but for the removed one.
            if j == removed || self.energy[j] <= 0.0 {
                continue;
            }
            if let Some(s) = score(self.energy[j] + b * b, self.cross[j] + b * gain, guard)
                && best.is_none_or(|(_, t)| s > t)
            {
                best = Some((j, s));
            }
        }
        best
    }
}

fn score(energy: f64, cross: f64, guard: f64) -> Option<f64> {
    (energy > guard && cross.abs() > NOISE).then(|| cross * cross / energy)
}
