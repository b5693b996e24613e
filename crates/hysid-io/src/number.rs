//! Numbers in text, read at the speed of a large file, to the same bits as the standard library reads them.
//!
//! A number of up to 19 digits is w 10^e. With w up to 2^53 and |e| up to 22 it is one exact product or quotient of two doubles
//! (Clinger, "How to read floating point numbers accurately", PLDI 1990); with -e up to 27 it is a quotient of two 64-bit numbers and a
//! power of two, which is rounded once ([`quotient`]); every other number goes to the standard library. What is not plainly a number is
//! left to [`parse`], which judges it.

use hysid_signal::tell::brief;

use crate::error::InputProblem;

/// The largest magnitude that a sample may have: squares and products of a few samples must stay finite.
pub const LARGEST_VALUE: f64 = 1e100;

/// A number at the beginning of some text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Found {
    pub value: f64,
    /// Bytes that it takes.
    pub len: usize,
    /// Decimals it was written with, as [`decimals`] counts them.
    pub decimals: u32,
}

/// Powers of ten that are exact in a double.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];
/// Powers of five that fit a `u64`.
const FIVES: [u64; 28] = {
    let mut fives = [1; 28];
    let mut i = 1;
    while i < 28 {
        fives[i] = 5 * fives[i - 1];
        i += 1;
    }
    fives
};
/// Up to here every whole number is a double.
const EXACT: u64 = 1 << 53;
/// Digits that fit a `u64` whatever they are.
const DIGITS: usize = 19;

/// The number that `text` begins with, however it goes on; `None` where it does not plainly begin with one of a sample's size.
#[inline]
pub(crate) fn leading(text: &[u8]) -> Option<Found> {
    let mut at = usize::from(matches!(text.first(), Some(b'-' | b'+')));
    let negative = text.first() == Some(&b'-');
    let begin = at;
    let mut w = 0;
    digits(text, &mut at, &mut w);
    let mut count = at - begin;
    let mut after_point = 0;
    let has_point = text.get(at) == Some(&b'.');
    if has_point {
        at += 1;
        let point = at;
        digits(text, &mut at, &mut w);
        after_point = at - point;
        count += after_point;
    }
    if count == 0 {
        return None;
    }
    let mut exponent = -(after_point as i64);
    let mut decimals = after_point as u32;
    if let Some(b'e' | b'E') = text.get(at) {
        at += 1;
        let down = text.get(at) == Some(&b'-');
        at += usize::from(matches!(text.get(at), Some(b'-' | b'+')));
        let (from, mut e) = (at, 0_u64);
        digits(text, &mut at, &mut e);
        if at == from || at - from > 5 {
            return None;
        }
        exponent += if down { -(e as i64) } else { e as i64 };
        if has_point {
            decimals = ROUNDED_NOWHERE;
        }
    }
    let places = exponent.unsigned_abs() as usize;
    let size = match (POWERS.get(places), FIVES.get(places)) {
        (Some(power), _) if count <= DIGITS && w <= EXACT => {
            Some(if exponent < 0 { w as f64 / power } else { w as f64 * power })
        }
        (_, Some(&five)) if count <= DIGITS && exponent < 0 && w > 0 => Some(quotient(w, five, places as i64)),
        _ => None,
    };
    let value = match size {
        Some(size) if negative => -size,
        Some(size) => size,
        None => std::str::from_utf8(&text[..at]).ok()?.parse().ok()?,
    };
    (value.abs() <= LARGEST_VALUE).then_some(Found { value, len: at, decimals })
}

/// w / (five 2^places), correctly rounded; neither is 0.
///
/// Both are shifted up to 64 bits, so that the quotient of one, 63 bits further up, and the other has 63 or 64 bits: ten more than a
/// double. A remainder is noted in its last bit, and the conversion rounds the whole.
#[inline]
fn quotient(w: u64, five: u64, places: i64) -> f64 {
    let (up, by) = (w.leading_zeros(), five.leading_zeros());
    let (top, bottom) = (u128::from(w << up) << 63, u128::from(five << by));
    let (whole, rest) = (top / bottom, top % bottom);
    let bits = whole as u64 | u64::from(rest != 0);
    // A power of two well inside the range of normal doubles, so that the product is exact.
    let exponent = 1023 - 63 + i64::from(by) - i64::from(up) - places;
    bits as f64 * f64::from_bits((exponent as u64) << 52)
}

/// Takes the digits at `at` into `w` (which wraps when there are too many) and moves on behind them.
#[inline]
fn digits(text: &[u8], at: &mut usize, w: &mut u64) {
    while let Some(eight) = text.get(*at..*at + 8).and_then(|b| <[u8; 8]>::try_from(b).ok()) {
        let v = u64::from_le_bytes(eight);
        // All eight are digits when each byte is 0x30..=0x39.
        let high = v & 0xF0F0_F0F0_F0F0_F0F0;
        let over = v.wrapping_add(0x0606_0606_0606_0606) & 0xF0F0_F0F0_F0F0_F0F0;
        if high != 0x3030_3030_3030_3030 || over != 0x3030_3030_3030_3030 {
            break;
        }
        // Neighbours are joined: digits to pairs, pairs to fours, fours to eight.
        let v = (v & 0x0F0F_0F0F_0F0F_0F0F).wrapping_mul((10 << 8) + 1) >> 8;
        let v = (v & 0x00FF_00FF_00FF_00FF).wrapping_mul((100 << 16) + 1) >> 16;
        let v = (v & 0x0000_FFFF_0000_FFFF).wrapping_mul((10_000 << 32) + 1) >> 32;
        *w = w.wrapping_mul(100_000_000).wrapping_add(v);
        *at += 8;
    }
    while let Some(d) = text.get(*at).map(|b| b.wrapping_sub(b'0')).filter(|d| *d < 10) {
        *w = w.wrapping_mul(10).wrapping_add(u64::from(d));
        *at += 1;
    }
}

/// The number in a field; `NaN` for an empty field or one that says `NaN`.
pub(crate) fn parse(field: &[u8]) -> Result<f64, InputProblem> {
    let field = field.trim_ascii();
    if field.is_empty() {
        return Ok(f64::NAN);
    }
    let text = std::str::from_utf8(field).map_err(|_| InputProblem::NotUtf8(""))?;
    match text.parse::<f64>() {
        Ok(value) if value.abs() <= LARGEST_VALUE || value.is_nan() => Ok(value),
        Ok(_) => Err(InputProblem::OutOfRange(brief(text))),
        Err(_) if text.contains('\0') => Err(InputProblem::NotUtf8(" (zero bytes: UTF-16 or a binary file)")),
        Err(_) => Err(InputProblem::NotANumber(brief(text))),
    }
}

/// What [`decimals`] says of a number with an exponent: it counts as exact.
const ROUNDED_NOWHERE: u32 = 20;

/// Decimals of a plain number (`0.00164` has five); numbers with an exponent count as exact.
pub(crate) fn decimals(field: &[u8]) -> u32 {
    let field = field.trim_ascii();
    match field.iter().position(|&b| b == b'.') {
        None => 0,
        Some(point) => {
            let after = &field[point + 1..];
            if after.iter().all(u8::is_ascii_digit) { after.len() as u32 } else { ROUNDED_NOWHERE }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The quick reader against the standard library on text that ends with a comma.
    fn check(number: &str) {
        let text = format!("{number},9");
        let expected: f64 = number.parse().unwrap();
        match leading(text.as_bytes()) {
            Some(found) => {
                assert_eq!(found.value.to_bits(), expected.to_bits(), "{number}");
                assert_eq!(found.len, number.len(), "{number}");
                assert_eq!(found.decimals, decimals(number.as_bytes()), "{number}");
            }
            None => assert!(expected.abs() > LARGEST_VALUE, "{number}"),
        }
    }

    #[test]
    fn numbers_of_every_form_are_read_exactly() {
        for number in [
            "0",
            "-0",
            "+1",
            "1.",
            ".5",
            "-.25",
            "12345678",
            "123456789.87654321",
            "9007199254740992",
            "9007199254740993",
            "18446744073709551615",
            "18446744073709551616",
            "99999999999999999999",
            "0.00000000000000000000000001",
            "00000000000000000000000000000001.5",
            "1e22",
            "1e23",
            "-1.5E-22",
            "2.2250738585072014e-308",
            "5e-324",
            "1e-400",
            "1e100",
            "1.0000000000000002e100",
            "-1e300",
            "3.7976931348623157",
            "0.1",
            "0.30000000000000004",
            "1.000000000000000000e+00",
            "0.999999999999999999",
            "9999999999999999999e-27",
            "1e-27",
            "9007199254740993e-1",
            "0.5000000000000000001",
            "1.5000000000000002e-9",
            "18014398509481985e-1",
            "-9007199254740993.5",
            "0.000000000000000000",
        ] {
            check(number);
        }
        for odd in ["", "-", ".", "+.", "e5", "1e", "1e+", "nan", "inf", " 1", "\"1\"", "--1", "1e999999"] {
            assert_eq!(leading(odd.as_bytes()), None, "{odd}");
        }
    }

    proptest! {
        #[test]
        fn shortest_and_fixed_forms_are_read_exactly(bits in any::<u64>(), x in -1e3..1e3_f64, places in 0..30_usize, digits in any::<u64>()) {
            let any = f64::from_bits(bits);
            prop_assume!(any.is_finite());
            check(&format!("{any:e}"));
            check(&format!("{any:.17e}"));
            check(&x.to_string());
            check(&format!("{x:.places$}"));
            check(&format!("{digits}e-{places}"));
            // Half way between two doubles, where rounding is to the even one, and its neighbours.
            let half = 2 * (digits >> 11) + 1;
            for near in [half - 1, half, half + 1] {
                check(&format!("{}e-{}", 5 * near, places % 4));
                check(&(5 * near).to_string());
            }
        }
    }
}
