//! What the fields of a described message are for.
#![forbid(unsafe_code)]

/// What a field is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    Id,
    /// Perhaps in text that does not say whether it is hex or decimal.
    IdText,
    /// Bytes, or a list of numbers.
    Data,
    DataBase64,
    DataHex,
    /// Text that may be either.
    DataText,
    Extended,
    Remote,
    Error,
    Fd,
    Brs,
    Esi,
    /// Length in bytes, or length code.
    Dlc,
    Bus,
    /// True or `tx` for frames that were sent, false or `rx` for received ones.
    Sent,
    Seconds,
    /// Beside the seconds.
    Nanoseconds,
    StampNs,
    StampUs,
    StampS,
}

impl Role {
    pub fn named(name: &str) -> Option<Role> {
        Some(match name {
            "id" => Role::Id,
            "id_text" => Role::IdText,
            "data" => Role::Data,
            "data_base64" => Role::DataBase64,
            "data_hex" => Role::DataHex,
            "data_text" => Role::DataText,
            "extended" => Role::Extended,
            "rtr" => Role::Remote,
            "error" => Role::Error,
            "fd" => Role::Fd,
            "brs" => Role::Brs,
            "esi" => Role::Esi,
            "dlc" => Role::Dlc,
            "bus" => Role::Bus,
            "tx" => Role::Sent,
            "sec" => Role::Seconds,
            "nsec" => Role::Nanoseconds,
            "stamp_ns" => Role::StampNs,
            "stamp_us" => Role::StampUs,
            "stamp_s" => Role::StampS,
            _ => return None,
        })
    }

    pub fn is_id(self) -> bool {
        matches!(self, Role::Id | Role::IdText)
    }

    pub fn is_data(self) -> bool {
        matches!(self, Role::Data | Role::DataBase64 | Role::DataHex | Role::DataText)
    }
}
