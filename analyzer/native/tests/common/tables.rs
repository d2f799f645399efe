//! Every table that the pipeline makes of a text, and the laws between text, frames and events.

use _native::counts::Counts;
use _native::events::{EventKind, Events};
use _native::pipeline::{Input, Pipeline};
use _native::verdict::VERDICTS;

use crate::capture::Capture;
use crate::sender::signatures;

/// Time, interface, line, kind, class, flags, error counters, text.
type EventRow = (i64, Option<u8>, u32, u8, u32, u16, Option<(u8, u8)>, Vec<u8>);

#[derive(Debug, PartialEq, Eq)]
pub struct Tables {
    pub capture: Capture,
    pub events: Vec<EventRow>,
    pub buses: Vec<String>,
    pub lines: Counts,
    pub counts: [u64; VERDICTS],
}

impl Tables {
    /// Runs the chunks; the tables are taken behind each one that says so, and at the end.
    pub fn of<'a>(chunks: impl Iterator<Item = (&'a [u8], bool)>) -> Tables {
        let mut pipeline = Pipeline::new(Box::new(signatures));
        let (mut capture, mut events) = (Capture::default(), vec![]);
        let mut take = |pipeline: &mut Pipeline| {
            let batch = pipeline.take();
            assert_eq!(pipeline.waiting(), 0);
            capture.join(&batch.frames, batch.results);
            append(&mut events, &batch.events);
        };
        for (chunk, taken) in chunks {
            pipeline.feed(Input::Text(chunk));
            if taken {
                take(&mut pipeline);
            }
        }
        pipeline.finish();
        take(&mut pipeline);
        Tables {
            capture,
            events,
            buses: pipeline.buses().to_vec(),
            lines: *pipeline.counts(),
            counts: pipeline.reassembler.counts(),
        }
    }

    pub fn check(&self) {
        let Counts {
            lines,
            frames,
            error_frames,
            drops,
            comments,
            blank,
            unreadable,
            ..
        } = self.lines;
        assert_eq!(lines, frames + error_frames + drops + comments + blank + unreadable);
        assert_eq!(self.capture.frames.len() as u64, frames);
        let of = |kind| self.events.iter().filter(|event| event.3 == kind as u8).count() as u64;
        assert_eq!(
            [
                EventKind::ErrorFrame,
                EventKind::Drop,
                EventKind::Comment,
                EventKind::Unreadable
            ]
            .map(of),
            [error_frames, drops, comments, unreadable]
        );
        assert!(self
            .capture
            .frames
            .bus
            .iter()
            .all(|&bus| usize::from(bus) < self.buses.len()));
        assert!(self.capture.frames.line.is_sorted() && self.events.is_sorted_by_key(|event| event.2));
        self.capture.check(self.counts);
    }
}

fn append(rows: &mut Vec<EventRow>, events: &Events) {
    let mut start = 0;
    for row in 0..events.len() {
        let end = events.text_end[row] as usize;
        rows.push((
            events.t[row],
            (events.bus_valid[row] != 0).then_some(events.bus[row]),
            events.line[row],
            events.kind[row],
            events.class[row],
            events.flags[row],
            (events.errors_valid[row] != 0).then_some((events.tx_errors[row], events.rx_errors[row])),
            events.text[start..end].to_vec(),
        ));
        start = end;
    }
}
