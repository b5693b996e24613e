//! How names and numbers stand in messages: short, on one line, without digits that tell nothing.

/// Characters of a name or of a value as the user wrote it that a message repeats.
const LONGEST: usize = 60;

/// The text for a message: line ends and other control characters escaped, cut with an ellipsis after 60 characters.
pub fn brief(text: &str) -> String {
    let mut out = String::new();
    for (n, c) in text.chars().enumerate() {
        if n == LONGEST {
            out.push('…');
            break;
        }
        if c.is_control() {
            out.extend(c.escape_debug());
        } else {
            out.push(c);
        }
    }
    out
}

/// The number with at most so many significant digits, with an exponent where the plain form would be long.
pub fn digits(x: f64, significant: usize) -> String {
    let rounded = format!("{x:.*e}", significant.saturating_sub(1)).parse::<f64>().unwrap_or(x);
    if rounded == 0.0 || !rounded.is_finite() || (1e-4..1e7).contains(&rounded.abs()) {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}

/// `1 sample`, `2 samples`: the number and the word, whose plural ends in `s`.
pub fn counted(n: impl TryInto<u64>, word: &str) -> String {
    let n = n.try_into().unwrap_or(u64::MAX);
    format!("{n} {word}{}", if n == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_cut_and_stay_on_one_line() {
        assert_eq!(brief("force_N"), "force_N");
        assert_eq!(brief("a\nb\t°"), "a\\nb\\t°");
        assert_eq!(brief(&"é".repeat(60)), "é".repeat(60));
        assert_eq!(brief(&"é".repeat(61)), format!("{}…", "é".repeat(60)));
    }

    #[test]
    fn numbers_lose_what_rounding_left() {
        for (x, text) in [
            (0.009_999_999_999_999_787, "0.01"),
            (0.001_638_4, "0.001638"),
            (-2.5e-7, "-2.5e-7"),
            (1e100, "1e100"),
            (0.0, "0"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(digits(x, 4), text);
        }
        assert_eq!((counted(1_usize, "field"), counted(0_u64, "field")), ("1 field".into(), "0 fields".into()));
    }
}
