//! What a message of a described layout holds, field by field, whatever it is written in.
#![forbid(unsafe_code)]

use super::bytes::{self, Bytes};
use super::can::{within, Can};
use super::role::Role;
use super::texts::{data_sign, id_sign, Coding, Sign};
use super::value::{flag, identifier, integer, time, Value};
use super::{Message, OUT_OF_RANGE};
use crate::frames::{BRS, ESI, MAX_CLASSIC, MAX_DATA, RX, TX, WORD_REMOTE};
use crate::line::Reason;
use crate::socketcan::fd_length;

/// Bytes of a name that are looked at.
const MAX_NAME: usize = 256;

/// The fields of one message; of a field that stands there twice the last one.
#[derive(Debug, Default)]
pub(super) struct Found {
    id: Option<u32>,
    extended: Option<bool>,
    remote: Option<bool>,
    error: Option<bool>,
    fd: Option<bool>,
    brs: Option<bool>,
    esi: Option<bool>,
    sent: Option<bool>,
    dlc: Option<u8>,
    name: Vec<u8>,
    stamp: Option<i64>,
    seconds: Option<i64>,
    nanoseconds: Option<i64>,
    data: Option<Bytes>,
    /// Identifier and data in text whose coding the channel knows, empty for none.
    id_text: Vec<u8>,
    data_text: Vec<u8>,
}

impl Found {
    pub fn clear(&mut self) {
        let [name, id_text, data_text] = [&mut self.name, &mut self.id_text, &mut self.data_text].map(|text| {
            text.clear();
            std::mem::take(text)
        });
        *self = Found {
            name,
            id_text,
            data_text,
            ..Found::default()
        };
    }

    /// The data field, to begin anew.
    pub fn new_data(&mut self) -> &mut Bytes {
        self.data_text.clear();
        self.data.insert(Bytes::EMPTY)
    }

    /// The data field, to go on with.
    pub fn more_data(&mut self) -> &mut Bytes {
        self.data.get_or_insert(Bytes::EMPTY)
    }

    /// # Errors
    /// The reason why the field cannot be what its role says.
    pub fn set(&mut self, role: Role, value: Value<'_>) -> Result<(), Reason> {
        match role {
            Role::Id => self.id = integer(value)?.map(identifier).transpose()?,
            Role::IdText => {
                self.id_text.clear();
                match value {
                    Value::Text(text) => self.id_text.extend_from_slice(text),
                    _ => self.id = integer(value)?.map(identifier).transpose()?,
                }
            }
            Role::Data | Role::DataBase64 | Role::DataHex | Role::DataText => self.set_data(role, value)?,
            Role::Extended => self.extended = flag(value)?,
            Role::Remote => self.remote = flag(value)?,
            Role::Error => self.error = flag(value)?,
            Role::Fd => self.fd = flag(value)?,
            Role::Brs => self.brs = flag(value)?,
            Role::Esi => self.esi = flag(value)?,
            Role::Dlc => {
                let length = |value: i64| u8::try_from(value).map_err(|_| "length out of range");
                self.dlc = integer(value)?.map(length).transpose()?;
            }
            Role::Bus => self.set_name(value)?,
            Role::Sent => {
                self.sent = match value {
                    Value::Text(text) if text.eq_ignore_ascii_case(b"tx") => Some(true),
                    Value::Text(text) if text.eq_ignore_ascii_case(b"rx") => Some(false),
                    Value::Text([]) => None,
                    _ => flag(value)?,
                }
            }
            Role::Seconds => self.seconds = time(value, 9)?,
            Role::Nanoseconds => self.nanoseconds = time(value, 0)?,
            Role::StampNs => self.stamp = time(value, 0)?,
            Role::StampUs => self.stamp = time(value, 3)?,
            Role::StampS => self.stamp = time(value, 9)?,
        }
        Ok(())
    }

    fn set_data(&mut self, role: Role, value: Value<'_>) -> Result<(), Reason> {
        self.data = None;
        self.data_text.clear();
        match (value, role) {
            (Value::Null, _) => Ok(()),
            (Value::Bytes(bytes), Role::Data) => {
                within(bytes.len(), MAX_DATA)?;
                let data = self.new_data();
                bytes.iter().try_for_each(|&byte| data.push(byte))
            }
            (Value::Text(text) | Value::Bytes(text), Role::DataBase64) => bytes::base64(text, self.new_data()),
            (Value::Text(text) | Value::Bytes(text), Role::DataHex) => bytes::hex(text, self.new_data()),
            (Value::Text(text), Role::DataText) => {
                self.data_text.extend_from_slice(text);
                Ok(())
            }
            _ => Err("data is not what was announced".into()),
        }
    }

    fn set_name(&mut self, value: Value<'_>) -> Result<(), Reason> {
        self.name.clear();
        match value {
            Value::Null => {}
            Value::Text(text) | Value::Bytes(text) => {
                let text = text.strip_suffix(&[0]).unwrap_or(text);
                self.name.extend_from_slice(&text[..text.len().min(MAX_NAME)]);
            }
            _ => {
                if let Some(number) = integer(value)? {
                    self.name.extend_from_slice(number.to_string().as_bytes());
                }
            }
        }
        Ok(())
    }

    /// How the texts of identifier and data look coded.
    pub fn signs(&self) -> (Sign, Sign) {
        let remote = self.remote == Some(true) || self.id.is_some_and(|id| id & WORD_REMOTE != 0);
        let stated = self.dlc.filter(|_| !remote);
        let fd = self.fd.or((self.brs == Some(true)).then_some(true));
        (id_sign(&self.id_text), data_sign(&self.data_text, stated, fd))
    }

    /// Reads the texts of identifier and data as they are coded; if that is open, it makes no difference.
    ///
    /// # Errors
    /// The reason why they are not coded like that.
    pub fn decode(&mut self, id: Coding, data: Coding) -> Result<(), Reason> {
        if !self.id_text.is_empty() {
            let value = match (id, bytes::hex_number(&self.id_text)) {
                (Coding::Hex, Some(number)) => Value::Number(i128::from(number).into()),
                _ => Value::Text(&self.id_text),
            };
            self.id = integer(value)?.map(identifier).transpose()?;
        }
        if !self.data_text.is_empty() {
            let mut read = Bytes::EMPTY;
            match data {
                Coding::Other => bytes::base64(&self.data_text, &mut read)?,
                Coding::Hex | Coding::Open => bytes::hex(&self.data_text, &mut read)?,
            }
            self.data = Some(read);
        }
        Ok(())
    }

    /// # Errors
    /// The reason why the fields do not make a frame together.
    pub fn message(&self) -> Result<Message<'_>, Reason> {
        let id = self.id.ok_or("no identifier")?;
        let remote = self.remote.unwrap_or(false);
        let brs_or_esi = self.brs == Some(true) || self.esi == Some(true);
        let held = self.data.as_ref().map_or(&[][..], Bytes::as_slice);
        // A longer field may be a classic one, filled up.
        let long = held.len() > MAX_CLASSIC && self.dlc.is_none_or(|stated| usize::from(stated) > MAX_CLASSIC);
        let fd = self.fd.unwrap_or(brs_or_esi || long);
        let (data, code) = self.length(held, remote || id & WORD_REMOTE != 0, fd)?;
        let mark = |flag: Option<bool>, bit: u16| if flag == Some(true) { bit } else { 0 };
        Ok(Message {
            stamp: self.stamp()?,
            name: &self.name,
            can: Can {
                id,
                extended: self.extended,
                remote,
                error: self.error.unwrap_or(false),
                fd,
                // Some loggers fill the marks of CAN FD in for classic frames.
                marks: mark(self.brs.filter(|_| fd), BRS)
                    | mark(self.esi.filter(|_| fd), ESI)
                    | mark(self.sent, TX)
                    | mark(self.sent.map(|sent| !sent), RX),
                code,
                data,
            },
        })
    }

    /// The data field by the stated length, if any, and the length code to keep.
    fn length<'a>(&self, held: &'a [u8], remote: bool, fd: bool) -> Result<(&'a [u8], u8), Reason> {
        let Some(stated) = self.dlc else {
            return Ok((held, if remote { held.len() as u8 } else { 0 }));
        };
        if remote {
            within(usize::from(stated), 15)?;
            return Ok((&[], stated));
        }
        let length = usize::from(stated);
        if let Some(meant) = fd_length(stated).filter(|_| length > MAX_CLASSIC && held.len() != length) {
            // A code: of a CAN FD frame for a longer field, of a classic one for all 8 bytes.
            if fd && (held.len() == meant || length != 12) {
                return Ok((held.get(..meant).ok_or_else(|| says(meant, held.len()))?, 0));
            }
            if !fd && held.len() == MAX_CLASSIC {
                return Ok((held, stated));
            }
        }
        // Fields of a fixed size are filled up behind the data.
        Ok((held.get(..length).ok_or_else(|| says(length, held.len()))?, 0))
    }

    fn stamp(&self) -> Result<Option<i64>, Reason> {
        let split = || match (self.seconds, self.nanoseconds) {
            (None, None) => Some(None),
            (seconds, nanoseconds) => seconds.unwrap_or(0).checked_add(nanoseconds.unwrap_or(0)).map(Some),
        };
        let t = match self.stamp {
            Some(t) => Some(t),
            None => split().ok_or(OUT_OF_RANGE)?,
        };
        Ok(t.filter(|&t| t != 0))
    }
}

fn says(stated: usize, held: usize) -> Reason {
    format!("says {stated} bytes, has {held}").into()
}
