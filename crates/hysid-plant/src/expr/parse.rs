//! From text to expression: a Pratt parser whose errors name the byte at fault.
//!
//! Binding, weakest first: `+ -`, `* /`, unary `-`, `^` (right associative; its exponent may have a sign).
//! A minus directly before a literal that is not a base of a power makes a negative literal. Depth is bounded so that no
//! text can exhaust the stack.

use super::{BinaryOp, Expr, Function, Memory};

/// Deepest nesting that the parser accepts.
const MAX_DEPTH: usize = 64;
/// Most tokens in one expression.
const MAX_TOKENS: usize = 10_000;

/// What is wrong with an expression's text, and where.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct ExprError {
    /// Byte offset into the text.
    pub at: usize,
    /// What was found and what is allowed.
    pub message: String,
}

#[derive(Debug, Clone, PartialEq)]
enum Token<'a> {
    Number(f64),
    Name(&'a str),
    Op(char),
    End,
}

fn error<T>(at: usize, message: impl Into<String>) -> Result<T, ExprError> {
    Err(ExprError { at, message: message.into() })
}

fn tokens(text: &str) -> Result<Vec<(usize, Token<'_>)>, ExprError> {
    let bytes = text.as_bytes();
    let digits = |mut i: usize| {
        while bytes.get(i).is_some_and(u8::is_ascii_digit) {
            i += 1;
        }
        i
    };
    let mut out = Vec::new();
    let mut at = 0;
    while let Some(&byte) = bytes.get(at) {
        let next = match byte {
            b' ' | b'\t' | b'\n' | b'\r' => {
                at += 1;
                continue;
            }
            b'0'..=b'9' | b'.' => {
                let mut end = digits(at);
                if bytes.get(end) == Some(&b'.') {
                    end = digits(end + 1);
                }
                if matches!(bytes.get(end), Some(b'e' | b'E')) {
                    let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
                    let exponent = digits(end + 1 + sign);
                    if exponent > end + 1 + sign {
                        end = exponent;
                    }
                }
                let literal = text.get(at..end).unwrap_or_default();
                match literal.parse::<f64>() {
                    Ok(value) if value.is_finite() => out.push((at, Token::Number(value))),
                    Ok(_) => return error(at, format!("the number `{literal}` is too large")),
                    Err(_) => return error(at, format!("`{literal}` is not a number")),
                }
                if bytes.get(end).is_some_and(|c| c.is_ascii_alphabetic() || *c == b'_') {
                    return error(end, "a number is followed by a name: write `*` between them");
                }
                end
            }
            b'a'..=b'z' | b'A'..=b'Z' => {
                let mut end = at;
                while bytes.get(end).is_some_and(|c| c.is_ascii_alphanumeric() || *c == b'_') {
                    end += 1;
                }
                out.push((at, Token::Name(text.get(at..end).unwrap_or_default())));
                end
            }
            b'+' | b'-' | b'*' | b'/' | b'^' | b'(' | b')' | b',' => {
                if byte == b'*' && bytes.get(at + 1) == Some(&b'*') {
                    return error(at, "`**` is not an operator here: a power is written `^`");
                }
                out.push((at, Token::Op(char::from(byte))));
                at + 1
            }
            b'<' | b'>' | b'=' | b'!' => {
                return error(at, "a comparison is written `step(a - b)`, which is 1 where a > b, else 0");
            }
            _ => {
                let found = text.get(at..).and_then(|rest| rest.chars().next()).unwrap_or('?');
                return error(at, format!("the character `{found}` is not allowed in an expression"));
            }
        };
        if out.len() > MAX_TOKENS {
            return error(at, format!("the expression is longer than {MAX_TOKENS} symbols"));
        }
        at = next;
    }
    out.push((text.len(), Token::End));
    Ok(out)
}

struct Parser<'a> {
    tokens: Vec<(usize, Token<'a>)>,
    position: usize,
}

impl<'a> Parser<'a> {
    fn peek(&self) -> (usize, Token<'a>) {
        // `tokens` always ends in `End`, and `next` never moves past it.
        self.tokens.get(self.position).cloned().unwrap_or((0, Token::End))
    }

    fn next(&mut self) -> (usize, Token<'a>) {
        let token = self.peek();
        if self.position + 1 < self.tokens.len() {
            self.position += 1;
        }
        token
    }

    fn expression(&mut self, strength: u8, depth: usize) -> Result<Expr, ExprError> {
        let (at, token) = self.next();
        if depth > MAX_DEPTH {
            return error(at, format!("the expression is nested deeper than {MAX_DEPTH}"));
        }
        let mut left = match token {
            Token::Number(value) => Expr::Number(value),
            Token::Name(name) => self.name(at, name, depth)?,
            Token::Op('-') => {
                let literal = match (self.peek().1, self.tokens.get(self.position + 1)) {
                    (Token::Number(_), Some((_, Token::Op('^')))) => None,
                    (Token::Number(value), _) => Some(value),
                    _ => None,
                };
                match literal {
                    Some(value) => {
                        self.next();
                        Expr::Number(-value)
                    }
                    None => Expr::Neg(Box::new(self.expression(5, depth + 1)?)),
                }
            }
            Token::Op('+') => self.expression(5, depth + 1)?,
            Token::Op('(') => {
                let inner = self.expression(0, depth + 1)?;
                self.close(at)?;
                inner
            }
            Token::Op(c) => return error(at, format!("a number, a symbol or `(` is expected, not `{c}`")),
            Token::End => return error(at, "the expression ends where a number, a symbol or `(` is expected"),
        };
        loop {
            let (at, token) = self.peek();
            let (op, binding, right) = match token {
                Token::Op('+') => (BinaryOp::Add, 1, 2),
                Token::Op('-') => (BinaryOp::Sub, 1, 2),
                Token::Op('*') => (BinaryOp::Mul, 3, 4),
                Token::Op('/') => (BinaryOp::Div, 3, 4),
                Token::Op('^') => (BinaryOp::Pow, 7, 6),
                Token::Op(')' | ',') | Token::End => return Ok(left),
                Token::Number(_) | Token::Name(_) | Token::Op(_) => {
                    return error(at, "an operator (`+ - * / ^`) is missing here");
                }
            };
            if binding < strength {
                return Ok(left);
            }
            self.next();
            left = Expr::binary(op, left, self.expression(right, depth + 1)?);
        }
    }

    fn close(&mut self, opened: usize) -> Result<(), ExprError> {
        match self.next() {
            (_, Token::Op(')')) => Ok(()),
            (_, Token::End) => error(opened, "this `(` is never closed"),
            (at, _) => error(at, "`)` is expected"),
        }
    }

    fn name(&mut self, at: usize, name: &str, depth: usize) -> Result<Expr, ExprError> {
        let function = Function::from_name(name);
        let memory = Memory::from_name(name);
        let (opened, follows) = self.peek();
        if follows != Token::Op('(') {
            return match (function, memory) {
                (None, None | Some(Memory::Derivative)) => Ok(Expr::Symbol(name.to_owned())),
                _ => error(at, format!("`{name}` is a function: its arguments in parentheses are expected")),
            };
        }
        let arity = match (function, memory) {
            (Some(f), _) => f.arity(),
            (_, Some(m)) => m.arity(),
            _ => return error(at, format!("`{name}` is not a function; {}", allowed_functions())),
        };
        self.next();
        let mut arguments = Vec::new();
        if self.peek().1 == Token::Op(')') {
            self.next();
        } else {
            loop {
                arguments.push(self.expression(0, depth + 1)?);
                if self.peek().1 != Token::Op(',') {
                    break;
                }
                self.next();
            }
            self.close(opened)?;
        }
        if arguments.len() != arity {
            let plural = if arity == 1 { "" } else { "s" };
            return error(at, format!("`{name}` takes {arity} argument{plural}, not {}", arguments.len()));
        }
        Ok(match (function, memory) {
            (Some(f), _) => Expr::Call(f, arguments),
            (_, Some(m)) => Expr::Memory(m, arguments),
            _ => Expr::Number(0.0), // not reached: the arity was found above
        })
    }
}

fn allowed_functions() -> String {
    let names = Function::ALL.iter().map(|(_, n)| *n).chain(Memory::ALL.iter().map(|(_, n)| *n));
    format!("allowed: {}", names.collect::<Vec<_>>().join(" "))
}

impl Expr {
    /// The expression that `text` stands for; an error names the byte at fault.
    pub fn parse(text: &str) -> Result<Self, ExprError> {
        let mut parser = Parser { tokens: tokens(text)?, position: 0 };
        let expr = parser.expression(0, 0)?;
        match parser.next() {
            (_, Token::End) => Ok(expr),
            (at, _) => error(at, "a `)` or `,` without its `(`"),
        }
    }
}

/// Byte offset of a use of `symbol` in an expression's text; the first one is number 0.
pub(crate) fn place_of_use(text: &str, symbol: &str, number: usize) -> Option<usize> {
    let found = tokens(text).ok()?;
    let mut uses = found.into_iter().filter(|(_, token)| matches!(token, Token::Name(name) if *name == symbol));
    uses.nth(number).map(|(at, _)| at)
}
