//! ArduPilot's dataflash log (`.bin`): records of two mark bytes, a type, and fields that `FMT` records describe.
//!
//! `CANF` and `CAFD` records hold the frames that ArduPilot's CAN logging received and sent, without saying which;
//! every other sound record counts as `other`. Behind a damaged record, the next is where mark bytes and a type that
//! the log has described come together. Bytes that are all 0x00 or all 0xFF up to the end are the unwritten rest of a
//! medium, not damage.
//!
//! Made with names of records, it keeps those as they are, and no frames.
#![forbid(unsafe_code)]

mod kept;
mod layout;

use crate::binary::{Binary, Format, Order, Start, Step};
use crate::frames::{MAX_DATA, NO_TIME};
use crate::line::Reason;
use crate::reader::Rows;
use crate::socketcan::{fd_length, Frame};
use crate::stamp::Stamps;

pub use kept::{Kept, KeptTable};
use layout::{Description, Fields, Kind, Layout};

/// Dataflash logs to rows.
pub type Dataflash = Binary<DataflashFormat>;

const MARK: [u8; 2] = [0xA3, 0x95];
const HEADER: usize = 3;
const DESCRIPTION: u8 = 128;
const DESCRIPTION_LENGTH: usize = 89;

pub struct DataflashFormat {
    /// What the log has said so far of each type.
    layouts: Vec<Option<Layout>>,
    /// The index in the rows by the log's number of a bus.
    buses: [Option<u8>; 256],
    /// What is kept instead of frames.
    kept: Option<Kept>,
}

impl Default for DataflashFormat {
    fn default() -> Self {
        let mut layouts = vec![None; 256];
        layouts[usize::from(DESCRIPTION)] = Some(Layout {
            length: DESCRIPTION_LENGTH,
            kind: Kind::Other,
        });
        DataflashFormat {
            layouts,
            buses: [None; 256],
            kept: None,
        }
    }
}

impl Format for DataflashFormat {
    const NAME: &'static str = "dataflash log";
    const PADDED: bool = true;

    fn record(&mut self, bytes: &[u8], _: bool, rows: &mut Rows) -> Step {
        if !bytes.starts_with(&MARK[..bytes.len().min(MARK.len())]) {
            return Step::Damaged("no record".into());
        }
        let Some([_, _, kind]) = bytes.first_chunk() else {
            return Step::Need(HEADER);
        };
        let Some(layout) = &self.layouts[usize::from(*kind)] else {
            return Step::Damaged(format!("record of unknown type {kind}").into());
        };
        let length = layout.length;
        let Some(record) = bytes.get(..length) else {
            return Step::Need(length);
        };
        if let Some(kept) = &mut self.kept {
            let table = match layout.kind {
                Kind::Kept(table) => Some(table),
                _ => None,
            };
            kept.add(table, record);
        }
        let read = match &layout.kind {
            _ if *kind == DESCRIPTION => self.description(&record[HEADER..]).map(|()| rows.other(1)),
            Kind::Other | Kind::Kept(_) => {
                rows.other(1);
                Ok(())
            }
            Kind::Frame(fields) => frame(record, fields, &mut self.buses, rows),
            Kind::Unclear(reason) => Err(reason.clone()),
        };
        if let Err(reason) = read {
            rows.unreadable(NO_TIME, None, &reason);
        }
        Step::Used(length)
    }

    fn starts(&self, bytes: &[u8], _: bool) -> Start {
        if !bytes.starts_with(&MARK[..bytes.len().min(MARK.len())]) {
            return Start::Not;
        }
        match bytes.first_chunk() {
            None => Start::Need(HEADER),
            Some([_, _, kind]) if self.layouts[usize::from(*kind)].is_some() => Start::Here,
            Some(_) => Start::Not,
        }
    }
}

impl DataflashFormat {
    /// Keeps records of these names instead of frames.
    pub fn keeping(names: Vec<Vec<u8>>) -> Self {
        DataflashFormat {
            kept: Some(Kept::of(names)),
            ..DataflashFormat::default()
        }
    }

    /// What was kept since the last call; the order of the tables goes on.
    pub fn take(&mut self) -> Vec<KeptTable> {
        let tables = self.kept.iter_mut().flat_map(|kept| &mut kept.tables);
        tables
            .map(|table| KeptTable {
                records: std::mem::take(&mut table.records),
                numbers: std::mem::take(&mut table.numbers),
                ..table.clone()
            })
            .collect()
    }

    /// Takes the description of a type.
    fn description(&mut self, body: &[u8]) -> Result<(), Reason> {
        let told = Description::read(body);
        if told.of == DESCRIPTION {
            return Ok(());
        }
        if told.length < HEADER {
            return Err(format!("record type {} of {} bytes", told.of, told.length).into());
        }
        let kind = match &mut self.kept {
            Some(kept) => kept.kind(&told),
            None => told.frame(),
        };
        let problem = match &kind {
            Kind::Unclear(reason) => Err(reason.clone()),
            _ => Ok(()),
        };
        let length = told.length;
        self.layouts[usize::from(told.of)] = Some(Layout { length, kind });
        problem
    }
}

fn frame(record: &[u8], fields: &Fields, buses: &mut [Option<u8>; 256], rows: &mut Rows) -> Result<(), Reason> {
    let order = Order::Little;
    let micros = i64::try_from(order.u64(record, fields.time)).ok();
    let t = micros
        .and_then(|us| us.checked_mul(1000))
        .ok_or("time stamp out of range")?;
    let (word, code, number) = (order.u32(record, fields.id), record[fields.code], record[fields.bus]);
    let mut data = [0; MAX_DATA];
    let mut held = 0;
    for column in &fields.data {
        data[held..held + column.len()].copy_from_slice(&record[column.clone()]);
        held += column.len();
    }
    let data = &data[..held];
    let frame = if fields.fd {
        let length = fd_length(code).ok_or_else(|| format!("length code {code}"))?;
        let data = data
            .get(..length)
            .ok_or_else(|| format!("less than its {length} bytes of data"))?;
        Frame::fd(word, 0, data)?
    } else {
        Frame::classic(word, code, data)?
    };
    let bus = &mut buses[usize::from(number)];
    *bus = bus.or_else(|| rows.bus(format!("can{number}").as_bytes()));
    let bus = bus.ok_or_else(Rows::too_many_buses)?;
    rows.stamp(Stamps::ZERO);
    rows.stamp(Stamps::MICROSECONDS);
    frame.push(t, bus, rows);
    Ok(())
}
