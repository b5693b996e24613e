//! All inner products of a design in one pass, where that is cheaper than columns of the Gram matrix asked for one after the other.
//!
//! Which of the two is taken depends on numbers of rows, terms and products only, so that the same data give the same bytes everywhere. The
//! pass is refused where its sums would be less exact (see [`Totals::is_sound`]).

use std::ops::Range;

use hysid_linalg::{Columns, Gram};

use crate::distinct::Distinct;
use crate::totals::Totals;
use crate::{Design, Quantity, Signal};

/// Terms beyond this number have too large a Gram matrix: 32 MB.
const LARGEST: usize = 2000;
// Costs in units of one distinct sum for one row (about 60 ps), measured for 35 to 1330 candidates of degrees 1 to 4. A column of the Gram
// matrix costs a unit for each candidate and row.
/// What the first pass over the samples costs, in columns.
const START: usize = 3;
/// Finding the classes of products, for each pair of terms.
const FIND: usize = 1500;
/// That, laying out their sums and gathering the matrix from them, for each pair.
const PREPARE: usize = 4000;
/// What enters and leaves at the ends of a stretch, for each pair.
const ENDS: usize = 20;
/// Of what the other way costs, the part that may be lost on finding out that there are too many classes.
const STAKE: usize = 16;
/// Sums beyond this number leave the second-level cache, and cost a third more.
const CACHED: usize = 32_000;

impl Design<'_> {
    /// All inner products; `None` where `columns` columns of the Gram matrix are cheaper, or `y` is not the output of the rows.
    pub(crate) fn whole_gram(&self, y: &[f64], columns: usize) -> Option<Gram> {
        let limit = self.most_classes(columns)?;
        let find = || Distinct::within(self.dictionary().terms(), limit);
        let (own, distinct) = rayon::join(|| self.is_target(y), find);
        let distinct = distinct.filter(|_| own)?;
        let mut totals = Totals::new(distinct, self.quantities());
        for (record, channels) in self.channels().iter().enumerate() {
            let own = self.stretches().iter().filter(|s| s.record == record);
            let ranges: Vec<Range<usize>> = own.map(|s| s.first..s.first + s.len).collect();
            totals.add(channels, &ranges);
        }
        let gram = totals.gram();
        totals.is_sound(&gram).then_some(gram)
    }

    /// The number of classes up to which one pass is the cheaper way; `None` where finding that out is itself too dear.
    fn most_classes(&self, columns: usize) -> Option<usize> {
        let (rows, m) = (self.rows(), self.cols());
        if m > LARGEST {
            return None;
        }
        let pairs = m * (m + 1) / 2;
        let apart = rows.saturating_mul(m).saturating_mul(columns.saturating_add(START));
        if pairs * FIND > apart / STAKE {
            return None;
        }
        let beside = pairs.saturating_mul(PREPARE + ENDS.saturating_mul(self.stretches().len()));
        let most = apart.saturating_sub(beside) / rows.max(1);
        Some(if most > CACHED { CACHED.max(most / 4 * 3) } else { most })
    }

    /// Whether `y` is the output at each row.
    fn is_target(&self, y: &[f64]) -> bool {
        let output = |record| self.samples_of(record, Quantity::Value(Signal::Output));
        y.len() == self.rows()
            && self.stretches().iter().all(|s| y[s.row..s.row + s.len] == output(s.record)[s.first..s.first + s.len])
    }
}
