//! Several captures as one, in the order of their times.
//!
//! Rows of one capture keep their order: a row counts as no earlier than the one before it. Rows go out as soon as no
//! capture can deliver an earlier one, so memory is bounded by what the captures deliver at once.
#![forbid(unsafe_code)]

pub mod meeting;
mod overlap;

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

use crate::buses::Buses;
use crate::events::{Event, EventKind};
use crate::frame_batch::FrameBatch;
use crate::frames::NO_TIME;
use overlap::Overlaps;

/// How one capture enters the sum.
#[derive(Clone, Debug, Default)]
pub struct Entry {
    /// Nanoseconds to add to its times.
    pub offset: i64,
    /// New names of interfaces: the first entry that fits, `None` fits all.
    pub names: Vec<(Option<String>, String)>,
}

struct Input {
    entry: Entry,
    label: String,
    /// The merged index of its buses.
    bus: Vec<Option<u8>>,
    batches: VecDeque<Held>,
    /// Time of the last row that went out, and of the latest one that came in.
    out: i64,
    latest: i64,
    done: bool,
}

/// A batch of which some rows are still to go out.
struct Held {
    batch: FrameBatch,
    frame: usize,
    event: usize,
}

pub struct Merger {
    inputs: Vec<Input>,
    /// All captures recorded one bus, whatever they call it.
    same_bus: bool,
    buses: Buses,
    overlaps: Overlaps,
    out: FrameBatch,
    before: u64,
    /// What came up to the last `take_later` ends before this time.
    reached: i64,
}

impl Merger {
    pub fn new(entries: Vec<Entry>, same_bus: bool) -> Self {
        let input = |entry| Input {
            entry,
            label: String::new(),
            bus: vec![],
            batches: VecDeque::new(),
            out: NO_TIME,
            latest: NO_TIME,
            done: false,
        };
        Merger {
            inputs: entries.into_iter().map(input).collect(),
            same_bus,
            buses: Buses::default(),
            overlaps: Overlaps::default(),
            out: FrameBatch::default(),
            before: 0,
            reached: NO_TIME,
        }
    }

    /// The next rows of capture `index`; `label` stands in front of the numbers of records that cannot be read, if
    /// it is not empty.
    pub fn push(&mut self, index: usize, batch: FrameBatch, label: &str) {
        let Some(input) = self.inputs.get_mut(index) else {
            return;
        };
        for name in batch.buses.names().iter().skip(input.bus.len()) {
            let new = input
                .entry
                .names
                .iter()
                .find(|(old, _)| old.as_ref().is_none_or(|old| old == name));
            let name = new.map_or(name, |(_, new)| new);
            let bus = if self.same_bus && !self.buses.names().is_empty() {
                Some(0)
            } else {
                self.buses.index(name.as_bytes()).map(|(bus, _)| bus)
            };
            input.bus.push(bus);
            if let Some(bus) = bus {
                self.overlaps.recorded(bus, index);
            }
        }
        for t in batch.frames.t.iter().chain(&batch.events.t).filter(|&&t| t != NO_TIME) {
            input.latest = input.latest.max(t.saturating_add(input.entry.offset));
        }
        self.out.stamps.insert(batch.stamps);
        label.clone_into(&mut input.label);
        input.batches.push_back(Held {
            batch,
            frame: 0,
            event: 0,
        });
    }

    /// Capture `index` has ended.
    pub fn finish(&mut self, index: usize) {
        if let Some(input) = self.inputs.get_mut(index) {
            input.done = true;
        }
    }

    /// The capture that has to deliver next before more rows can go out; `None` once all have ended.
    pub fn awaited(&self) -> Option<usize> {
        let waiting = self.inputs.iter().enumerate().filter(|(_, input)| !input.done);
        waiting.min_by_key(|(_, input)| input.latest).map(|(index, _)| index)
    }

    /// All rows that nothing can come before any more.
    pub fn take(&mut self) -> FrameBatch {
        let waiting = self.inputs.iter().filter(|input| !input.done);
        let frontier = waiting.map(|input| input.latest).min();
        self.release(frontier)
    }

    /// For buses, which do not wait for each other: all rows up to the latest one that had come when this was called
    /// the last time. What another bus delivered late in between still finds its place.
    pub fn take_later(&mut self) -> FrameBatch {
        let frontier = self.reached;
        let latest = self.inputs.iter().map(|input| input.latest).max();
        self.reached = latest.map_or(NO_TIME, |latest| latest.saturating_add(1));
        self.release(Some(frontier))
    }

    /// All rows before a time, all there are without one.
    fn release(&mut self, frontier: Option<i64>) -> FrameBatch {
        let mut heap: BinaryHeap<Reverse<(i64, usize)>> = BinaryHeap::new();
        for (index, input) in self.inputs.iter_mut().enumerate() {
            heap.extend(input.next_time(&mut self.out).map(|t| Reverse((t, index))));
        }
        while let Some(Reverse((t, index))) = heap.pop() {
            if frontier.is_some_and(|frontier| t >= frontier) {
                break;
            }
            let limit = heap.peek().map(|&Reverse(next)| next);
            let mut next = Some(t);
            while let Some(t) = next.filter(|&t| limit.is_none_or(|limit| (t, index) < limit)) {
                if frontier.is_some_and(|frontier| t >= frontier) {
                    break;
                }
                self.emit(index, t);
                next = self.inputs[index].next_time(&mut self.out);
            }
            heap.extend(next.map(|t| Reverse((t, index))));
        }
        self.before += self.out.counts.lines;
        self.out.buses.clone_from(&self.buses);
        std::mem::take(&mut self.out)
    }

    /// Lets the next row of a capture go.
    fn emit(&mut self, index: usize, t: i64) {
        let input = &mut self.inputs[index];
        input.out = t;
        let Some(held) = input.batches.front_mut() else {
            return;
        };
        let line = self.before + self.out.counts.lines + 1;
        let bus_of = |bus: u8| input.bus.get(usize::from(bus)).copied().flatten();
        let (batch, offset) = (&held.batch, input.entry.offset);
        if held.frame_is_next() {
            let row = held.frame;
            held.frame += 1;
            let frames = &batch.frames;
            let Some(bus) = bus_of(frames.bus[row]) else {
                let text = "one interface too many";
                self.out.counts.unreadable += 1;
                self.out.counts.lines += 1;
                let event = Event::remark(NO_TIME, line, EventKind::Unreadable, text);
                return self.out.events.push(&event);
            };
            let time = shifted(frames.t[row], offset);
            let content = (frames.id[row], frames.flags[row], frames.data_of(row));
            if time != NO_TIME && self.overlaps.repeats(bus, index, time, content) {
                self.out.counts.repeated += 1;
                self.out.counts.lines += 1;
                return;
            }
            let line = u32::try_from(line).unwrap_or(u32::MAX);
            self.out.add_frame(batch, row, time, bus, line);
        } else {
            let row = held.event;
            held.event += 1;
            let events = &batch.events;
            self.out.count_event(batch, row);
            let first = self.out.events.len();
            let unreadable = events.kind[row] == EventKind::Unreadable as u8;
            if unreadable && !input.label.is_empty() {
                let text = format!("{} {}: {}", input.label, events.line[row], events.text_of(row));
                let event = Event::remark(events.t[row], line, EventKind::Unreadable, &text);
                self.out.events.push(&event);
            } else {
                self.out.events.extend(events, row..row + 1);
            }
            let out = &mut self.out.events;
            out.t[first] = shifted(out.t[first], offset);
            out.line[first] = u32::try_from(line).unwrap_or(u32::MAX);
            match bus_of(events.bus[row]).filter(|_| events.bus_valid[row] != 0) {
                Some(bus) => (out.bus[first], out.bus_valid[first]) = (bus, 1),
                None => out.bus_valid[first] = 0,
            }
        }
    }
}

impl Input {
    /// The time that the next row counts as; batches without further rows are put away, what they counted goes to `out`.
    fn next_time(&mut self, out: &mut FrameBatch) -> Option<i64> {
        while let Some(held) = self.batches.front() {
            let (frame, event) = (held.frame, held.event);
            let own = if held.frame_is_next() {
                held.batch.frames.t[frame]
            } else if event < held.batch.events.len() {
                held.batch.events.t[event]
            } else {
                let counts = &held.batch.counts;
                out.counts.blank += counts.blank;
                out.counts.other += counts.other;
                out.counts.lines += counts.blank + counts.other;
                self.batches.pop_front();
                continue;
            };
            return Some(shifted(own, self.entry.offset).max(self.out));
        }
        None
    }
}

impl Held {
    /// Whether the next row is a frame; frames and events are in the order of their records.
    fn frame_is_next(&self) -> bool {
        let (frames, events) = (&self.batch.frames, &self.batch.events);
        self.frame < frames.len() && (self.event >= events.len() || frames.line[self.frame] < events.line[self.event])
    }
}

fn shifted(t: i64, offset: i64) -> i64 {
    if t == NO_TIME {
        NO_TIME
    } else {
        t.saturating_add(offset).max(NO_TIME + 1)
    }
}
