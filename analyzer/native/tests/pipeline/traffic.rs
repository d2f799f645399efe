//! Valid traffic: a few sessions, each with transfers in order, their frames mixed as arbitration would.

use std::collections::VecDeque;

use _native::frames::{EXTENDED, FD};
use _native::wire::{Id, Kind};

use crate::log::CanFrame;
use crate::random::Random;
use crate::sender::{anonymous_id, cut, message_id, service_id};

/// One session: its transfers as (transfer ID, payload), in order.
pub(crate) struct Sent {
    pub(crate) id: u32,
    pub(crate) bus: u8,
    pub(crate) transfers: Vec<(u8, Vec<u8>)>,
}

pub(crate) struct Traffic {
    pub(crate) frames: Vec<CanFrame>,
    pub(crate) sent: Vec<Sent>,
}

/// Known messages, a known service both ways, and types without a definition. Only one node may be anonymous, because
/// two would be one session.
fn identifier(random: &mut Random, node: u8) -> u32 {
    let other = node % 100 + 20;
    if node == 1 && random.one_in(2) {
        return anonymous_id(1, random.next() as u16);
    }
    match random.below(9) {
        0 | 1 => message_id(1034, node),
        2 => message_id(1030, node),
        3 => message_id(341, node),
        4 => service_id(1, true, node, other),
        5 => service_id(1, false, node, other),
        6 => message_id(1033, node),
        7 => message_id(20_000 + u16::from(node), node),
        _ => service_id(200, true, node, other),
    }
}

pub(crate) fn traffic(random: &mut Random) -> Traffic {
    let mut traffic = Traffic {
        frames: vec![],
        sent: vec![],
    };
    let mut queues: Vec<(u32, u8, u16, VecDeque<Vec<u8>>)> = vec![];
    for node in 1..=1 + random.below(6) as u8 {
        let (id, bus) = (identifier(random, node), random.below(2) as u8);
        let anonymous = Id::parse(id).kind == Kind::Anonymous;
        let (fd, mut transfer_id) = (random.one_in(4) && !anonymous, random.next() as u8 & 31);
        let mut sent = Sent {
            id,
            bus,
            transfers: vec![],
        };
        let mut queue = VecDeque::new();
        for _ in 0..=random.below(8) {
            // CAN FD pads what fits no length code, so these lengths do.
            let length = if fd {
                [3, 7, 15, 63, 76, 128][random.below(6)]
            } else {
                [random.below(8), 8 + random.below(60)][usize::from(!anonymous && random.one_in(2))]
            };
            let payload = random.bytes(length);
            queue.extend(cut(id, transfer_id, &payload, fd));
            sent.transfers.push((transfer_id, payload));
            transfer_id = (transfer_id + 1) & 31;
        }
        let flags = if fd { EXTENDED | FD } else { EXTENDED };
        queues.push((id, bus, flags, queue));
        traffic.sent.push(sent);
    }
    let mut t = 1_700_000_000_000_000_000;
    while !queues.is_empty() {
        let at = random.below(queues.len());
        let (id, bus, flags, queue) = &mut queues[at];
        if let Some(data) = queue.pop_front() {
            t += i64::from(random.next() % 1_000_000);
            let (bus, id, flags) = (*bus, *id, *flags);
            traffic.frames.push(CanFrame {
                t,
                bus,
                id,
                flags,
                data,
            });
        } else {
            queues.swap_remove(at);
        }
    }
    traffic
}
