//! Rewriting of expressions: substitution, symbols used, simplification.

use std::collections::BTreeSet;

use super::{BinaryOp, Expr, Function};

impl Expr {
    /// The tree with every node rebuilt by `rebuild`, leaves first.
    pub fn map(&self, rebuild: &mut impl FnMut(Expr) -> Expr) -> Expr {
        let inner = match self {
            Self::Number(_) | Self::Symbol(_) => self.clone(),
            Self::Neg(a) => Self::Neg(Box::new(a.map(rebuild))),
            Self::Binary(op, a, b) => {
                let a = a.map(rebuild);
                Self::binary(*op, a, b.map(rebuild))
            }
            Self::Call(f, arguments) => Self::Call(*f, arguments.iter().map(|a| a.map(rebuild)).collect()),
            Self::Memory(m, arguments) => Self::Memory(*m, arguments.iter().map(|a| a.map(rebuild)).collect()),
        };
        rebuild(inner)
    }

    /// Calls `visit` on every node, parents first.
    pub fn visit<'a>(&'a self, visit: &mut impl FnMut(&'a Expr)) {
        visit(self);
        match self {
            Self::Number(_) | Self::Symbol(_) => {}
            Self::Neg(a) => a.visit(visit),
            Self::Binary(_, a, b) => {
                a.visit(visit);
                b.visit(visit);
            }
            Self::Call(_, arguments) | Self::Memory(_, arguments) => arguments.iter().for_each(|a| a.visit(visit)),
        }
    }

    /// The expression with every use of `symbol` replaced by `by`.
    pub fn substitute(&self, symbol: &str, by: &Expr) -> Expr {
        self.replace(&Self::symbol(symbol), by)
    }

    /// The expression with every occurrence of `part`, as it is written, replaced by `by`.
    pub fn replace(&self, part: &Expr, by: &Expr) -> Expr {
        self.map(&mut |e| if e == *part { by.clone() } else { e })
    }

    /// The symbols used, in alphabetical order, `t` and `pi` among them.
    pub fn symbols(&self) -> BTreeSet<String> {
        let mut found = BTreeSet::new();
        self.visit(&mut |e| {
            if let Self::Symbol(name) = e {
                found.insert(name.clone());
            }
        });
        found
    }

    /// Whether `symbol` is used.
    pub fn uses(&self, symbol: &str) -> bool {
        let mut found = false;
        self.visit(&mut |e| found |= matches!(e, Self::Symbol(name) if name == symbol));
        found
    }

    /// Whether an operator with memory occurs.
    pub fn has_memory(&self) -> bool {
        let mut found = false;
        self.visit(&mut |e| found |= matches!(e, Self::Memory(..)));
        found
    }

    /// The terms of the outermost sum with their signs: `a - (b + c)` gives `+a`, `-b`, `-c`.
    pub fn terms(&self) -> Vec<(f64, &Expr)> {
        fn walk<'a>(expr: &'a Expr, sign: f64, out: &mut Vec<(f64, &'a Expr)>) {
            match expr {
                Expr::Binary(BinaryOp::Add, a, b) => {
                    walk(a, sign, out);
                    walk(b, sign, out);
                }
                Expr::Binary(BinaryOp::Sub, a, b) => {
                    walk(a, sign, out);
                    walk(b, -sign, out);
                }
                Expr::Neg(a) => walk(a, -sign, out),
                other => out.push((sign, other)),
            }
        }
        let mut out = Vec::new();
        walk(self, 1.0, &mut out);
        out
    }

    /// The expression without `+ 0`, `* 0`, `* 1`, `^ 1`, double signs and operations on two literals.
    ///
    /// The value is the same wherever both are finite; operations on literals whose result is not finite are left.
    pub fn simplified(&self) -> Expr {
        self.map(&mut simplify_node)
    }
}

fn simplify_node(expr: Expr) -> Expr {
    use BinaryOp::{Add, Div, Mul, Pow, Sub};
    let zero = |e: &Expr| matches!(e, Expr::Number(v) if *v == 0.0);
    let is = |e: &Expr, value: f64| matches!(e, Expr::Number(v) if *v == value);
    match expr {
        Expr::Neg(a) => negated(*a),
        Expr::Binary(op, a, b) => {
            if let (Expr::Number(x), Expr::Number(y)) = (&*a, &*b) {
                let value = match op {
                    Add => x + y,
                    Sub => x - y,
                    Mul => x * y,
                    Div => x / y,
                    Pow => x.powf(*y),
                };
                // A quotient such as 1/3 is left as the user wrote it: it reads better and keeps its meaning.
                if value.is_finite() && !(op == Div && value.fract() != 0.0) {
                    return Expr::Number(value);
                }
            }
            match op {
                Add if zero(&a) => *b,
                Add | Sub if zero(&b) => *a,
                Sub if zero(&a) => negated(*b),
                Add => match *b {
                    Expr::Neg(inner) => Expr::Binary(Sub, a, inner),
                    other => Expr::Binary(Add, a, Box::new(other)),
                },
                Sub => match *b {
                    Expr::Neg(inner) => Expr::Binary(Add, a, inner),
                    other => Expr::Binary(Sub, a, Box::new(other)),
                },
                Mul if zero(&a) || zero(&b) => Expr::Number(0.0),
                Mul if is(&a, 1.0) => *b,
                Mul | Div | Pow if is(&b, 1.0) => *a,
                Mul if is(&a, -1.0) => negated(*b),
                Mul if is(&b, -1.0) => negated(*a),
                Div if zero(&a) && !zero(&b) => Expr::Number(0.0),
                Pow if zero(&b) => Expr::Number(1.0),
                _ => Expr::Binary(op, a, b),
            }
        }
        Expr::Call(f @ (Function::Abs | Function::Sign | Function::Step), arguments) => match arguments.as_slice() {
            [Expr::Number(x)] => Expr::Number(match f {
                Function::Abs => x.abs(),
                Function::Sign => crate::number::sign(*x),
                _ => f64::from(u8::from(*x > 0.0)),
            }),
            _ => Expr::Call(f, arguments),
        },
        other => other,
    }
}

fn negated(expr: Expr) -> Expr {
    match expr {
        Expr::Neg(inner) => *inner,
        Expr::Number(value) => Expr::Number(-value),
        other => Expr::Neg(Box::new(other)),
    }
}
