//! Nodes whose transfer-ID counters break, and what explains that, step by step.
//!
//! A [`step`] that is no step of 1 is held back by its [`node`] until it is clear whether one counter for all types
//! ([`shared_counter`]), several devices ([`several`]) or a counter that always wraps early ([`early_wraps`]) explain it.
//! What nothing explains is told: [`begun_anew`] knows which counters that come to 0 are those of a node that restarted,
//! [`late_copies`] and [`places`] what only came again, or in another order.
#![forbid(unsafe_code)]

use std::collections::HashMap;

use crate::frames::NO_TIME;
use crate::seeded::Seeded;
use around::Around;
use begun_anew::Stated;
use node::Node;
use shared_counter::Message;
use step::{Cause, Step, Told, LATE};
use walk::Walk;

pub mod around;
pub mod begun_anew;
pub mod early_wraps;
pub mod late_copies;
pub mod node;
pub mod odd;
pub mod places;
pub mod several;
pub mod shared_counter;
pub mod step;
pub mod walk;

/// A node of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sender {
    pub bus: u8,
    pub node: u8,
}

/// What a batch has of one node: each in the order of its transfers.
#[derive(Debug, Default)]
pub struct Sent {
    pub steps: Vec<Step>,
    pub messages: Vec<Message>,
    pub stated: Vec<Stated>,
}

/// What was found: causes of a node each time that they show, and steps that nothing explains.
#[derive(Debug, Default)]
pub struct Events {
    pub causes: Vec<(Sender, Cause)>,
    pub told: Vec<(Sender, Told)>,
}

/// All nodes that are followed, in the order in which they came.
#[derive(Clone, Debug, Default)]
pub struct IdNodes {
    nodes: Vec<(Sender, Node)>,
    places: HashMap<Sender, usize, Seeded>,
}

impl IdNodes {
    /// Nodes with a counter that several types may share: their messages are wanted although none is odd.
    pub fn sharing(&self) -> impl Iterator<Item = Sender> + '_ {
        let nodes = self.nodes.iter().filter(|(_, node)| node.shares());
        nodes.map(|(sender, _)| *sender)
    }

    /// Takes what a batch has of nodes, in the order in which these are judged; `end` is the last time so far.
    pub fn feed(&mut self, mut sent: Vec<(Sender, Sent)>, around: Around<'_>, end: i64) -> Events {
        let mut found = Events::default();
        for (sender, sent) in &mut sent {
            let at = *self.places.entry(*sender).or_insert_with(|| {
                self.nodes.push((*sender, Node::default()));
                self.nodes.len() - 1
            });
            let node = &mut self.nodes[at].1;
            let mut walk = Walk::new(&sent.messages, &sent.stated);
            let mut causes = vec![];
            for step in sent.steps.drain(..) {
                node.add(step, &mut walk, around, &mut causes);
            }
            node.pass(&mut walk, around, u32::MAX);
            found.causes.extend(causes.into_iter().map(|cause| (*sender, cause)));
        }
        for (sender, node) in &mut self.nodes {
            if end != NO_TIME && node.holds() && end.saturating_sub(node.last()) > LATE {
                node.calm();
            }
            found.told.extend(node.founds().map(|one| (*sender, one)));
        }
        found
    }

    /// Tells what is held back.
    pub fn finish(&mut self) -> Events {
        let mut found = Events::default();
        for (sender, node) in &mut self.nodes {
            node.calm();
            found.told.extend(node.founds().map(|one| (*sender, one)));
        }
        found
    }
}

#[cfg(test)]
mod tests;
