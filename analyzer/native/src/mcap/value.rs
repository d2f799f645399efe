//! Single values of a described message: what they mean as identifier, flag or time.
#![forbid(unsafe_code)]

use super::decimal::Decimal;
use super::{bytes, OUT_OF_RANGE};
use crate::line::Reason;

/// Larger floats are no identifiers and no times.
const MAX_WHOLE: f64 = 1e18;

/// A value that is neither a list nor a message.
#[derive(Clone, Copy, Debug)]
pub(super) enum Value<'a> {
    Null,
    Bool(bool),
    Number(Decimal),
    Float(f64),
    Text(&'a [u8]),
    Bytes(&'a [u8]),
}

/// Signed words of 32 bits are taken for the unsigned ones with the same bits.
pub(super) fn identifier(value: i64) -> Result<u32, Reason> {
    let word = u32::try_from(value).or_else(|_| i32::try_from(value).map(|word| word as u32));
    word.map_err(|_| "identifier out of range".into())
}

pub(super) fn flag(value: Value<'_>) -> Result<Option<bool>, Reason> {
    match value {
        Value::Null => Ok(None),
        Value::Bool(flag) => Ok(Some(flag)),
        _ => match integer(value)? {
            Some(0) => Ok(Some(false)),
            Some(1) => Ok(Some(true)),
            _ => Err("flag is neither true nor false".into()),
        },
    }
}

/// Numbers may stand in text, decimal or with `0x` in front; empty text is none.
fn number(value: Value<'_>) -> Result<Option<Decimal>, Reason> {
    let number = match value {
        Value::Null | Value::Text([]) => return Ok(None),
        Value::Number(number) => Some(number),
        Value::Text([b'0', b'x' | b'X', digits @ ..]) => {
            bytes::hex_number(digits).map(|number| i128::from(number).into())
        }
        Value::Text(text) => Decimal::read(text)
            .filter(|&(_, used)| used == text.len())
            .map(|(number, _)| number),
        Value::Float(float) if float.fract() == 0.0 && float.abs() < MAX_WHOLE => Some(i128::from(float as i64).into()),
        Value::Bool(_) | Value::Float(_) | Value::Bytes(_) => None,
    };
    number.map(Some).ok_or("field is not a number".into())
}

pub(super) fn integer(value: Value<'_>) -> Result<Option<i64>, Reason> {
    let Some(number) = number(value)? else {
        return Ok(None);
    };
    number
        .integer()
        .map(Some)
        .ok_or("field is not an integer of 64 bits".into())
}

/// Nanoseconds of a value that counts `10^digits` of them; there is no clock from before 1970.
pub(super) fn time(value: Value<'_>, digits: i32) -> Result<Option<i64>, Reason> {
    let t = match value {
        Value::Float(float) => {
            // The whole units alone are exact.
            let scale = 10_f64.powi(digits);
            let (whole, fraction) = (float.trunc(), (float.fract() * scale).round());
            let whole = (whole.abs() < MAX_WHOLE).then(|| Decimal::from(i128::from(whole as i64)));
            whole
                .and_then(|whole| whole.scaled(digits))
                .and_then(|whole| whole.checked_add(fraction as i64))
        }
        _ => match number(value)? {
            None => return Ok(None),
            Some(number) => number.scaled(digits),
        },
    };
    t.filter(|&t| t >= 0).map(Some).ok_or(OUT_OF_RANGE.into())
}
