//! The distinct products behind the Gram matrix of a dictionary.
//!
//! The inner product of two terms depends on the product of their factors only, and a product of lagged signals one sample later is the same
//! sum but for its ends. So the M (M + 1) / 2 inner products of M candidates are sums over far fewer products (286 candidates of degree 3 in
//! ten lagged signals: 41 041 inner products, 5126 sums). Each class of products that differ by a shift in time only is summed up once; its other
//! members follow from what enters and leaves at the ends of a stretch (see [`Class::least`]).

use std::collections::HashMap;

use crate::{Factor, Quantity, Signal, Term};

/// Products that differ by a shift in time only.
#[derive(Debug, Clone)]
pub(crate) struct Class {
    /// The factors, by lag, the smallest lag being 0.
    pub factors: Vec<Factor>,
    /// The shift that is summed up.
    pub base: usize,
    /// The smallest and largest shift in use. With S(s) the sum over the rows a..b of the product shifted by s,
    /// S(s) - S(s + 1) = c(b - 1 - s) - c(a - 1 - s), where c is the product as it stands here.
    pub least: usize,
    pub most: usize,
}

/// A member of a class.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Member {
    pub class: u32,
    pub shift: u32,
}

/// Which sums the Gram matrix of some terms consists of.
#[derive(Debug)]
pub(crate) struct Distinct {
    pub classes: Vec<Class>,
    /// Inner product of terms i <= j at j (j + 1) / 2 + i.
    pub gram: Vec<Member>,
    /// Inner product of each term with the output.
    pub cross: Vec<Member>,
    /// The output's square.
    pub target: Member,
}

impl Distinct {
    /// The classes of `terms`; `None` when the inner products of the terms with each other are of more than `limit` classes.
    pub fn within(terms: &[Term], limit: usize) -> Option<Self> {
        let mut products = Products::of(terms);
        let codes: Vec<Vec<u64>> = terms.iter().map(|t| products.codes(t)).collect();
        let mut gram = Vec::with_capacity(terms.len() * (terms.len() + 1) / 2);
        for (j, b) in codes.iter().enumerate() {
            gram.extend(codes[..=j].iter().map(|a| products.member(a, b)));
            if products.classes.len() > limit {
                return None;
            }
        }
        Some(products.finish(&codes, gram))
    }
}

/// The products met so far. A factor is a code here: its lag times 2^32 and the number of its quantity, so that codes in order are factors
/// by lag.
struct Products {
    quantities: Vec<Quantity>,
    classes: Vec<Class>,
    known: HashMap<Vec<u64>, u32>,
    /// The product at hand.
    product: Vec<u64>,
}

/// One sample of lag.
const LAG: u64 = 1 << 32;

impl Products {
    fn of(terms: &[Term]) -> Self {
        let output = Quantity::Value(Signal::Output);
        let factors = terms.iter().flat_map(|t| t.factors().iter().map(|f| f.quantity));
        let mut quantities: Vec<Quantity> = factors.chain([output]).collect();
        quantities.sort();
        quantities.dedup();
        Self { quantities, classes: Vec::new(), known: HashMap::new(), product: Vec::new() }
    }

    fn codes(&self, term: &Term) -> Vec<u64> {
        let number = |q: &Quantity| self.quantities.binary_search(q).unwrap_or(0) as u64;
        let mut codes: Vec<u64> = term.factors().iter().map(|f| f.lag as u64 * LAG + number(&f.quantity)).collect();
        codes.sort_unstable();
        codes
    }

    /// The product of two products.
    fn member<'a>(&mut self, mut a: &'a [u64], mut b: &'a [u64]) -> Member {
        let Self { quantities, classes, known, product } = self;
        product.clear();
        loop {
            let from = match (a, b) {
                ([], []) => break,
                ([x, ..], [y, ..]) if x > y => &mut b,
                ([], _) => &mut b,
                _ => &mut a,
            };
            let next = from[0];
            *from = &from[1..];
            // The square of a sign is 1.
            if product.last() == Some(&next) && quantities[(next % LAG) as usize].is_sign() {
                product.pop();
            } else {
                product.push(next);
            }
        }
        let shift = product.first().map_or(0, |f| f / LAG);
        product.iter_mut().for_each(|f| *f -= shift * LAG);
        let shift = shift as usize;
        let class = match known.get(product.as_slice()) {
            Some(&class) => class,
            None => {
                let factor = |&f: &u64| Factor { quantity: quantities[(f % LAG) as usize], lag: (f / LAG) as usize };
                let factors = product.iter().map(factor).collect();
                classes.push(Class { factors, base: shift, least: shift, most: shift });
                known.insert(product.clone(), (classes.len() - 1) as u32);
                (classes.len() - 1) as u32
            }
        };
        let c = &mut classes[class as usize];
        (c.least, c.most) = (c.least.min(shift), c.most.max(shift));
        Member { class, shift: shift as u32 }
    }

    /// With the products with the output.
    fn finish(mut self, codes: &[Vec<u64>], gram: Vec<Member>) -> Distinct {
        let output = self.codes(&Term::new([Factor::value(Signal::Output, 0)]));
        let cross = codes.iter().map(|t| self.member(t, &output)).collect();
        let target = self.member(&output, &output);
        let mut classes = self.classes;
        // Summed up is the smallest shift that the matrix itself needs: then most sums begin at the same lag and share their heads.
        let mut least = vec![usize::MAX; classes.len()];
        for m in &gram {
            least[m.class as usize] = least[m.class as usize].min(m.shift as usize);
        }
        for (c, least) in classes.iter_mut().zip(least) {
            c.base = if least == usize::MAX { c.least } else { least };
        }
        Distinct { classes, gram, cross, target }
    }
}
