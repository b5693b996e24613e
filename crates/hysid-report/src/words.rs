//! Words and numbers as people read them, and how a page can be made again.

/// How a page can be made again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Provenance {
    /// The command line as typed.
    pub command: String,
    /// The program's version.
    pub version: String,
}

/// Four significant digits, an exponent where the number is large or small.
pub(crate) fn number(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        return "-".into();
    }
    if size == 0.0 {
        return "0".into();
    }
    if !(1e-3..1e6).contains(&size) {
        return format!("{value:.3e}");
    }
    let decimals = (3.0 - size.log10().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// Coefficients and what they multiply as a sum: `- 0.64 e[n-1] + 0.2 e[n-2]`, every sign before its number.
pub(crate) fn sum(terms: impl IntoIterator<Item = (f64, String)>) -> String {
    let signed = |(c, what): (f64, String)| {
        format!("{} {} {what}", if c.is_sign_negative() { '-' } else { '+' }, number(c.abs()))
    };
    terms.into_iter().map(signed).collect::<Vec<_>>().join(" ")
}

/// A share as a percentage.
pub(crate) fn percent(share: f64) -> String {
    format!("{} %", number((1e3 * share).round() / 10.0))
}

/// A probability; never a certainty.
pub(crate) fn probability(p: f64) -> String {
    if p > 0.995 {
        "> 0.99".into()
    } else if p < 0.005 {
        "< 0.01".into()
    } else {
        format!("{p:.2}")
    }
}

/// A p-value; never zero.
pub(crate) fn p_value(p: f64) -> String {
    if p < 1e-4 { "< 0.0001".into() } else { number(p) }
}

/// An interval; empty where an end is missing.
pub(crate) fn interval(low: Option<f64>, high: Option<f64>) -> String {
    match (low, high) {
        (Some(low), Some(high)) => format!("{} to {}", number(low), number(high)),
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_true() {
        let cases = [
            (20.3, "20.3"),
            (0.0123456, "0.01235"),
            (1234.56, "1235"),
            (0.0, "0"),
            (1e-7, "1.000e-7"),
            (f64::NAN, "-"),
        ];
        for (value, expected) in cases {
            assert_eq!(number(value), expected);
        }
    }

    #[test]
    fn a_sum_has_its_signs_before_the_numbers() {
        let cases: [(&[f64], &str); 3] =
            [(&[], ""), (&[-0.6452], "- 0.6452 e1"), (&[0.5, -0.1, 2.0], "+ 0.5 e1 - 0.1 e2 + 2 e3")];
        for (coefficients, expected) in cases {
            assert_eq!(sum(coefficients.iter().zip(1..).map(|(c, i)| (*c, format!("e{i}")))), expected);
        }
    }

    #[test]
    fn nothing_is_certain() {
        assert_eq!(probability(1.0), "> 0.99");
        assert_eq!(probability(0.0), "< 0.01");
        assert_eq!(p_value(0.0), "< 0.0001");
        assert_eq!(percent(0.123_45), "12.3 %");
    }
}
