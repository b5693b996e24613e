//! Whether an equation contains an expression of a given form.

use hysid_plant::{BinaryOp, Expr, Function};

/// No symbol of a simulation begins like this.
const WILD: char = '?';

/// The form as a tree: known symbols replaced, single capital letters turned into wildcards. `None` where the text is no
/// expression or uses a symbol that is neither.
pub(super) fn prepare(form: &str, known: impl Fn(&str) -> Option<Expr>) -> Option<Expr> {
    let parsed = Expr::parse(form).ok()?;
    let mut complete = true;
    let prepared = parsed.map(&mut |e| match e {
        Expr::Symbol(name) if name != "t" && name != "pi" => {
            let mut letters = name.chars();
            if let Some(expr) = known(&name) {
                expr
            } else if letters.next().is_some_and(|c| c.is_ascii_uppercase()) && letters.next().is_none() {
                Expr::Symbol(format!("{WILD}{name}"))
            } else {
                complete = false;
                Expr::Symbol(name)
            }
        }
        other => other,
    });
    complete.then(|| prepared.simplified())
}

/// Whether any part of `expr` has this form.
pub(super) fn occurs(form: &Expr, expr: &Expr) -> bool {
    let mut found = false;
    expr.visit(&mut |e| found = found || matches(form, e) || quotient(form, e).is_some());
    if found {
        return true;
    }
    // A product of three is a tree of two: `c*v*abs(v)` holds `v*abs(v)` only after its factors are sorted out.
    if let Expr::Binary(BinaryOp::Mul, ..) = form {
        let wanted = factors(form);
        expr.visit(&mut |e| {
            found = found
                || (matches!(e, Expr::Binary(BinaryOp::Mul | BinaryOp::Div, ..)) && contains(&wanted, &factors(e)))
        });
    }
    found
}

/// The square roots in `expr`.
pub(super) fn roots(expr: &Expr) -> Vec<&Expr> {
    let mut found = Vec::new();
    expr.visit(&mut |e| {
        if matches!(e, Expr::Call(Function::Sqrt, _)) {
            found.push(e);
        }
    });
    found
}

/// The first part of `expr` that has this form.
pub(super) fn part(form: &Expr, expr: &Expr) -> Option<Expr> {
    let mut found = None;
    expr.visit(&mut |e| {
        if found.is_none() {
            found = if matches(form, e) { Some(e.clone()) } else { quotient(form, e).map(|(part, _)| part) };
        }
    });
    found
}

/// The part of a quotient that has the form of one, and the other factors above its line: `F*v/(abs(v) + e)` holds `v/(abs(v) + e)`, and the tree has
/// no such branch.
fn quotient<'e>(form: &Expr, expr: &'e Expr) -> Option<(Expr, Vec<&'e Expr>)> {
    let (Expr::Binary(BinaryOp::Div, wanted, divisor), Expr::Binary(BinaryOp::Div, above, below)) = (form, expr) else {
        return None;
    };
    if !matches(divisor, below) || !matches!(**above, Expr::Binary(BinaryOp::Mul, ..)) {
        return None;
    }
    let mut others = multiplied(above);
    let own = others.remove(others.iter().position(|f| matches(wanted, f))?);
    Some((own.clone() / (**below).clone(), others))
}

/// The expression with every part of this form replaced, also where something else stands above its line.
pub(super) fn replaced(form: &Expr, expr: &Expr, by: &dyn Fn(&Expr) -> Expr) -> Expr {
    expr.map(&mut |e| match quotient(form, &e) {
        Some((part, others)) => others.into_iter().rev().fold(by(&part), |product, other| other.clone() * product),
        None if matches(form, &e) => by(&e),
        None => e,
    })
}

/// The symbol that is the only other factor of a product which `expr` holds of something of this form: `F` of `F*sign(v)`.
pub(super) fn size_of<'e>(form: &Expr, expr: &'e Expr) -> Option<&'e str> {
    let mut found = None;
    expr.visit(&mut |e| {
        let others = match (e, quotient(form, e)) {
            (_, Some((_, others))) => others,
            (Expr::Binary(BinaryOp::Mul, ..), None) => {
                let (of_form, others): (Vec<&Expr>, Vec<&Expr>) =
                    factors(e).into_iter().partition(|f| matches(form, f));
                if of_form.len() == 1 { others } else { return }
            }
            _ => return,
        };
        if let [Expr::Symbol(size)] = others[..] {
            found.get_or_insert(size.as_str());
        }
    });
    found
}

/// The smooth step in this symbol that `expr` holds first: `1/(1 + exp(Z))`, also where something else stands above its line, `tanh(Z)` or `atan(Z)`; it
/// holds no memory.
pub(super) fn step_in(expr: &Expr, symbol: &str) -> Option<Expr> {
    let form = prepare("1 + exp(Z)", |_| None)?;
    let mut found = None;
    expr.visit(&mut |e| {
        let step = match e {
            Expr::Binary(BinaryOp::Div, _, below) if matches(&form, below) => Expr::Number(1.0) / (**below).clone(),
            Expr::Call(Function::Tanh | Function::Atan, _) => e.clone(),
            _ => return,
        };
        if found.is_none() && step.uses(symbol) && !step.has_memory() {
            found = Some(step);
        }
    });
    found
}

/// The factors above the line of a product.
pub(super) fn factors(expr: &Expr) -> Vec<&Expr> {
    match expr {
        Expr::Binary(BinaryOp::Mul, a, b) => factors(a).into_iter().chain(factors(b)).collect(),
        Expr::Binary(BinaryOp::Div, a, _) | Expr::Neg(a) => factors(a),
        other => vec![other],
    }
}

/// What a product is made of, without a look at signs and quotients.
fn multiplied(expr: &Expr) -> Vec<&Expr> {
    match expr {
        Expr::Binary(BinaryOp::Mul, a, b) => multiplied(a).into_iter().chain(multiplied(b)).collect(),
        other => vec![other],
    }
}

/// Whether every wanted factor finds one of its own.
fn contains(wanted: &[&Expr], present: &[&Expr]) -> bool {
    let mut left: Vec<&Expr> = present.to_vec();
    wanted.iter().all(|form| match left.iter().position(|e| matches(form, e)) {
        Some(at) => {
            left.remove(at);
            true
        }
        None => false,
    })
}

fn matches(form: &Expr, expr: &Expr) -> bool {
    match (form, expr) {
        (Expr::Symbol(name), _) if name.starts_with(WILD) => true,
        (Expr::Number(a), Expr::Number(b)) => a == b,
        (Expr::Symbol(a), Expr::Symbol(b)) => a == b,
        (Expr::Neg(a), Expr::Neg(b)) => matches(a, b),
        (Expr::Binary(op, a, b), Expr::Binary(other, c, d)) if op == other => {
            (matches(a, c) && matches(b, d))
                || (matches!(op, BinaryOp::Add | BinaryOp::Mul) && matches(a, d) && matches(b, c))
        }
        (Expr::Call(f, a), Expr::Call(g, b)) => f == g && a.iter().zip(b).all(|(a, b)| matches(a, b)),
        (Expr::Memory(f, a), Expr::Memory(g, b)) => f == g && a.iter().zip(b).all(|(a, b)| matches(a, b)),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_form_is_found_wherever_it_stands() {
        let check = |form: &str, text: &str, expected: bool| {
            let known = |s: &str| match s {
                "x" => Some(Expr::parse("x1 - x2").unwrap()),
                "v" => Some(Expr::symbol("v")),
                _ => None,
            };
            let form = prepare(form, known).unwrap();
            assert_eq!(occurs(&form, &Expr::parse(text).unwrap()), expected, "{text}");
        };
        check("sign(v)", "(u - c*v - F*sign(v))/m", true);
        check("sign(v)", "(u - c*v)/m", false);
        check("tanh(v/P)", "u - F*tanh(v/0.01)", true);
        check("x^3", "u - a*(x1 - x2)^3", true);
        check("v*abs(v)", "u - c*v*abs(v)", true);
        check("v*abs(v)", "u - c*abs(v)*v", true);
        check("abs(v)*Z", "v - abs(v)*z/g", true);
        check("abs(v)*Z", "v - abs(v)", false);
        check("v/(abs(v) + P)", "u - F*v/(abs(v) + e)", true);
        check("v/(abs(v) + P)", "u - F*v*N/(e + abs(v))/m", true);
        check("v/(abs(v) + P)", "u - F*w/(abs(v) + e)", false);
    }

    #[test]
    fn what_stands_above_a_line_keeps_the_other_factors() {
        let form = prepare("v/(abs(v) + P)", |s| (s == "v").then(|| Expr::symbol("v"))).unwrap();
        let check = |text: &str, own: &str, expected: &str| {
            let expr = Expr::parse(text).unwrap();
            assert_eq!(part(&form, &expr).unwrap().to_string(), own, "{text}");
            let sharp = replaced(&form, &expr, &|_| Expr::parse("sign(v)").unwrap());
            assert_eq!(sharp.to_string(), Expr::parse(expected).unwrap().to_string(), "{text}");
        };
        check("u - F*v/(abs(v) + e)", "v/(abs(v) + e)", "u - F*sign(v)");
        check("(u - mu*v*N/(e + abs(v)))/m", "v/(e + abs(v))", "(u - mu*(N*sign(v)))/m");
        check("u - F*(v/(abs(v) + e))", "v/(abs(v) + e)", "u - F*sign(v)");
    }

    #[test]
    fn the_size_of_a_force_is_what_multiplies_it_alone() {
        let check = |text: &str, expected: Option<&str>| {
            let form = prepare("sign(v)", |s| (s == "v").then(|| Expr::symbol("v"))).unwrap();
            assert_eq!(size_of(&form, &Expr::parse(text).unwrap()), expected, "{text}");
        };
        check("(u - c*v - F*sign(v))/m", Some("F"));
        check("(u - sign(v)*F)/m", Some("F"));
        check("u - mu*N*sign(v)", None);
        check("u - c*v", None);
        check("u - sign(v)", None);
        let smooth = prepare("v/(abs(v) + P)", |s| (s == "v").then(|| Expr::symbol("v"))).unwrap();
        assert_eq!(size_of(&smooth, &Expr::parse("(u - F*v/(abs(v) + e))/m").unwrap()), Some("F"));
    }
}
