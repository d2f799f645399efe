//! Records of wanted names as a log holds them, a table for each way in which the log describes one.
#![forbid(unsafe_code)]

use super::layout::{Description, Kind};

/// Bytes of a name, and of what a log says of the columns: short texts without zero bytes.
type Text = Vec<u8>;

/// The records that are kept.
#[derive(Clone, Debug, Default)]
pub struct Kept {
    wanted: Vec<Text>,
    pub tables: Vec<KeptTable>,
    /// Records so far, of any type.
    records: u64,
}

/// Records of one description, one behind the other.
#[derive(Clone, Debug, Default)]
pub struct KeptTable {
    pub name: Text,
    /// A character a column.
    pub format: Text,
    /// Names, with commas between them.
    pub columns: Text,
    /// With their headers.
    pub records: Vec<u8>,
    /// The number of each record in the log, from 0.
    pub numbers: Vec<u64>,
}

impl Kept {
    pub fn of(wanted: Vec<Text>) -> Self {
        Kept {
            wanted,
            ..Kept::default()
        }
    }

    /// What is to be done with records of a type.
    pub fn kind(&mut self, told: &Description) -> Kind {
        if !self.wanted.iter().any(|name| name == told.name) {
            return Kind::Other;
        }
        if told.fields().is_none() {
            let name = told.name.escape_ascii();
            return Kind::Unclear(format!("columns of a {name} record not understood").into());
        }
        let known = self.tables.iter().position(|table| {
            (&*table.name, &*table.format, &*table.columns) == (told.name, told.format, told.columns)
        });
        Kind::Kept(known.unwrap_or_else(|| {
            self.tables.push(KeptTable {
                name: told.name.to_vec(),
                format: told.format.to_vec(),
                columns: told.columns.to_vec(),
                ..KeptTable::default()
            });
            self.tables.len() - 1
        }))
    }

    /// Takes the next record; `table` is the one that it is kept in.
    pub fn add(&mut self, table: Option<usize>, record: &[u8]) {
        if let Some(table) = table {
            self.tables[table].records.extend_from_slice(record);
            self.tables[table].numbers.push(self.records);
        }
        self.records += 1;
    }
}
