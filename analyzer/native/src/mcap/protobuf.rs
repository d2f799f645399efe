//! Protocol Buffers messages: one pass over the wire format with the announced field numbers.
#![forbid(unsafe_code)]

use super::decimal::Decimal;
use super::found::Found;
use super::role::Role;
use super::tree::{Target, Tree};
use super::value::Value;
use crate::line::Reason;

/// Groups inside each other.
const MAX_GROUPS: usize = 64;
const MAX_NUMBER: u64 = (1 << 29) - 1;
const ENDS_EARLY: Reason = Reason::Borrowed("protobuf ends early");

/// How a field is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// `int32`, `int64`, `uint32`, `uint64`, `bool`, an enumeration.
    Varint,
    /// `sint32`, `sint64`.
    ZigZag,
    Fixed32,
    SFixed32,
    Fixed64,
    SFixed64,
    Float,
    Double,
    Bytes,
    String,
    /// Repeated varints, packed or not.
    Repeated,
}

impl Form {
    pub fn named(name: &str) -> Option<Form> {
        Some(match name {
            "varint" => Form::Varint,
            "zigzag" => Form::ZigZag,
            "fixed32" => Form::Fixed32,
            "sfixed32" => Form::SFixed32,
            "fixed64" => Form::Fixed64,
            "sfixed64" => Form::SFixed64,
            "float" => Form::Float,
            "double" => Form::Double,
            "bytes" => Form::Bytes,
            "string" => Form::String,
            "packed" | "repeated" => Form::Repeated,
            _ => return None,
        })
    }

    fn is_integer(self) -> bool {
        !matches!(
            self,
            Form::Float | Form::Double | Form::Bytes | Form::String | Form::Repeated
        )
    }
}

pub(super) type Fields = Tree<u32, (Role, Form)>;

/// # Errors
/// The reason why `data` is no such message.
pub(super) fn read(fields: &Fields, defaults: &[Role], data: &[u8], found: &mut Found) -> Result<(), Reason> {
    // A field that is not there is zero.
    for &role in defaults {
        found.set(role, Value::Number(0.into()))?;
    }
    message(fields, 0, data, found)
}

/// Fields whose absence says zero. A flag that is not there says nothing of its own but for the direction.
pub(super) fn has_default(role: Role, form: Form) -> bool {
    form.is_integer() && matches!(role, Role::Id | Role::Bus | Role::Sent)
}

/// One message; those inside it are at most as deep as the tree of fields.
fn message(fields: &Fields, node: usize, data: &[u8], found: &mut Found) -> Result<(), Reason> {
    let mut wire = Wire(data);
    while !wire.0.is_empty() {
        let (number, value) = wire.field()?;
        match fields.find(node, |&known| known == number) {
            None => {}
            Some(Target::Inner(inner)) => {
                let Raw::Bytes(bytes) = value else {
                    return Err(mismatch(number));
                };
                message(fields, inner, bytes, found)?;
            }
            Some(Target::Leaf((role, Form::Repeated))) => repeated(role, number, value, found)?,
            Some(Target::Leaf((role, form))) => {
                let value = value.meaning(form).ok_or_else(|| mismatch(number))?;
                found.set(role, value)?;
            }
        }
    }
    Ok(())
}

fn repeated(role: Role, number: u32, value: Raw<'_>, found: &mut Found) -> Result<(), Reason> {
    if !role.is_data() {
        return Err("only data can be repeated".into());
    }
    let data = found.more_data();
    match value {
        Raw::Varint(value) => data.push_number(i128::from(value).into()),
        Raw::Bytes(bytes) => {
            let mut wire = Wire(bytes);
            while !wire.0.is_empty() {
                data.push_number(i128::from(wire.varint()?).into())?;
            }
            Ok(())
        }
        _ => Err(mismatch(number)),
    }
}

fn mismatch(number: u32) -> Reason {
    format!("field {number} is not what was announced").into()
}

/// A field as the wire has it.
#[derive(Clone, Copy)]
enum Raw<'a> {
    Varint(u64),
    Fixed64([u8; 8]),
    Bytes(&'a [u8]),
    Group,
    Fixed32([u8; 4]),
}

impl<'a> Raw<'a> {
    /// `None` when it cannot be of this form.
    fn meaning(self, form: Form) -> Option<Value<'a>> {
        let number = |value: i64| Some(Value::Number(Decimal::from(i128::from(value))));
        match (form, self) {
            // Negative numbers of 32 bits are written with 64.
            (Form::Varint, Raw::Varint(value)) => number(value as i64),
            (Form::ZigZag, Raw::Varint(value)) => number((value >> 1) as i64 ^ -((value & 1) as i64)),
            (Form::Fixed32, Raw::Fixed32(bytes)) => number(u32::from_le_bytes(bytes).into()),
            (Form::SFixed32, Raw::Fixed32(bytes)) => number(i32::from_le_bytes(bytes).into()),
            (Form::Float, Raw::Fixed32(bytes)) => Some(Value::Float(f32::from_le_bytes(bytes).into())),
            (Form::Fixed64, Raw::Fixed64(bytes)) => Some(Value::Number(i128::from(u64::from_le_bytes(bytes)).into())),
            (Form::SFixed64, Raw::Fixed64(bytes)) => number(i64::from_le_bytes(bytes)),
            (Form::Double, Raw::Fixed64(bytes)) => Some(Value::Float(f64::from_le_bytes(bytes))),
            (Form::Bytes, Raw::Bytes(bytes)) => Some(Value::Bytes(bytes)),
            (Form::String, Raw::Bytes(bytes)) => Some(Value::Text(bytes)),
            _ => None,
        }
    }
}

/// What is left of a message.
struct Wire<'a>(&'a [u8]);

impl<'a> Wire<'a> {
    fn field(&mut self) -> Result<(u32, Raw<'a>), Reason> {
        let (number, kind) = self.tag()?;
        let raw = match kind {
            0 => Raw::Varint(self.varint()?),
            1 => Raw::Fixed64(self.fixed()?),
            2 => Raw::Bytes(self.bytes()?),
            3 => {
                self.skip_group(number)?;
                Raw::Group
            }
            5 => Raw::Fixed32(self.fixed()?),
            _ => return Err("protobuf field of an unknown kind".into()),
        };
        Ok((number, raw))
    }

    fn tag(&mut self) -> Result<(u32, u8), Reason> {
        let tag = self.varint()?;
        if !(1..=MAX_NUMBER).contains(&(tag >> 3)) {
            return Err("protobuf field number out of range".into());
        }
        Ok(((tag >> 3) as u32, (tag & 7) as u8))
    }

    /// Everything up to the end of the group whose start is read.
    fn skip_group(&mut self, number: u32) -> Result<(), Reason> {
        let mut open = vec![number];
        while let Some(&last) = open.last() {
            let (number, kind) = self.tag()?;
            match kind {
                0 => drop(self.varint()?),
                1 => drop(self.fixed::<8>()?),
                2 => drop(self.bytes()?),
                3 if open.len() == MAX_GROUPS => return Err("protobuf groups nested too deep".into()),
                3 => open.push(number),
                4 if number == last => drop(open.pop()),
                5 => drop(self.fixed::<4>()?),
                _ => return Err("protobuf group without its end".into()),
            }
        }
        Ok(())
    }

    #[inline]
    fn varint(&mut self) -> Result<u64, Reason> {
        let mut value = 0;
        for at in 0..10 {
            let byte = *self.0.get(at).ok_or(ENDS_EARLY)?;
            value |= u64::from(byte & 0x7F) << (7 * at);
            if byte < 0x80 {
                if at == 9 && byte > 1 {
                    break;
                }
                self.0 = &self.0[at + 1..];
                return Ok(value);
            }
        }
        Err("protobuf number longer than 64 bits".into())
    }

    fn bytes(&mut self) -> Result<&'a [u8], Reason> {
        let length = usize::try_from(self.varint()?).unwrap_or(usize::MAX);
        let (bytes, rest) = self.0.split_at_checked(length).ok_or(ENDS_EARLY)?;
        self.0 = rest;
        Ok(bytes)
    }

    fn fixed<const N: usize>(&mut self) -> Result<[u8; N], Reason> {
        let (bytes, rest) = self.0.split_first_chunk().ok_or(ENDS_EARLY)?;
        self.0 = rest;
        Ok(*bytes)
    }
}
