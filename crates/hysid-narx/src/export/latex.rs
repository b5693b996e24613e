//! The model as a LaTeX equation.

use hysid_dictionary::{Factor, Quantity};

use crate::NarxModel;

impl NarxModel {
    /// The model as a LaTeX `align*` environment (of the package amsmath), a term to a line; coefficients with six digits.
    pub fn latex(&self) -> String {
        let output = &self.signals().output().symbol;
        let mut lines = Vec::new();
        for (i, c) in self.parts().coefficients.iter().enumerate() {
            let sign = match (i, c.theta < 0.0) {
                (0, false) => "",
                (_, false) => "+ ",
                (_, true) => "- ",
            };
            lines.push(format!("{sign}{}{}", number(c.theta.abs()), self.product(c.term.factors())));
        }
        for t in &self.parts().noise {
            let sign = if t.theta < 0.0 { "-" } else { "+" };
            let product = self.product(t.term.factors());
            lines.push(format!("{sign} {}{product}\\, e[n-{}]", number(t.theta.abs()), t.lag));
        }
        let sum = lines.join(" \\\\\n&\\quad ");
        format!("\\begin{{align*}}\n{}[n] &= {sum}\n\\end{{align*}}", symbol(output))
    }

    fn product(&self, factors: &[Factor]) -> String {
        let mut out = String::new();
        let mut i = 0;
        while i < factors.len() {
            let power = factors[i..].iter().take_while(|f| **f == factors[i]).count();
            let atom = self.latex_factor(factors[i]);
            out.push_str("\\, ");
            out.push_str(&if power > 1 { format!("{atom}^{{{power}}}") } else { atom });
            i += power;
        }
        out
    }

    fn latex_factor(&self, f: Factor) -> String {
        let name = self.signals().name(f.quantity.signal()).map_or("?", |n| n.symbol.as_str());
        let time = if f.lag == 0 { "n".to_string() } else { format!("n-{}", f.lag) };
        let name = symbol(name);
        match f.quantity {
            Quantity::Value(_) => format!("{name}[{time}]"),
            Quantity::Difference(_) => format!("\\Delta {name}[{time}]"),
            Quantity::Sign(_) => format!("\\operatorname{{sgn}}(\\Delta {name}[{time}])"),
        }
    }
}

/// `u1` as `u_{1}`, underscores made harmless.
fn symbol(name: &str) -> String {
    let split = name.find(|c: char| c.is_ascii_digit()).filter(|&i| i > 0);
    match split {
        Some(i) if name[i..].chars().all(|c| c.is_ascii_digit()) => format!("{}_{{{}}}", &name[..i], &name[i..]),
        _ => name.replace('_', "\\_"),
    }
}

/// Six digits, powers of ten written out.
fn number(x: f64) -> String {
    let text = format!("{x:.5e}");
    match text.split_once('e') {
        Some((mantissa, "0")) => mantissa.to_string(),
        Some((mantissa, exponent)) if exponent.parse::<i32>().is_ok_and(|e| !(-3..=4).contains(&e)) => {
            format!("{mantissa}\\cdot 10^{{{exponent}}}")
        }
        _ => {
            let digits = 5 - x.abs().log10().floor() as i32;
            format!("{x:.*}", digits.max(0) as usize)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_symbols() {
        for (x, expected) in
            [(1.5, "1.50000"), (0.012345678, "0.0123457"), (1234.5, "1234.50"), (2.5e-9, "2.50000\\cdot 10^{-9}")]
        {
            assert_eq!(number(x), expected);
        }
        assert_eq!(number(0.0), "0.00000");
        for (name, expected) in [("u", "u"), ("u12", "u_{12}"), ("force_N", "force\\_N"), ("u1b", "u1b")] {
            assert_eq!(symbol(name), expected);
        }
    }
}
