//! pcapng: what the interfaces of a capture are called, and a capture that has none with CAN frames.

use crate::pcapng::{block, interface, option, packet, section};
use crate::{can, read, rows, Ends};

const L: Ends = Ends::Little;

/// The names of the interfaces of packets, in order.
fn names(blocks: &[Vec<u8>]) -> Vec<String> {
    let all = read("pcapng", &[section(L), blocks.concat()].concat());
    assert_eq!(all.0.counts.unreadable, 0);
    rows(&all).into_iter().map(|row| row.1).collect()
}

#[test]
fn a_made_up_name_is_that_of_no_other_interface() {
    let named = |name: &[u8]| interface(L, 227, &option(L, 2, name));
    let bare = || interface(L, 227, &[]);
    let frame = |index| packet(L, index, 1, &can(1, &[]), &[]);
    assert_eq!(names(&[named(b"x"), bare(), frame(1), frame(0)]), ["can1", "x"]);
    assert_eq!(
        names(&[named(b"can1"), bare(), frame(0), frame(1)]),
        ["can1", "interface1"]
    );
    assert_eq!(
        names(&[bare(), named(b"can0"), frame(0), frame(1), frame(0)]),
        ["interface0", "can0", "interface0"]
    );
    let taken = [named(b"can2"), named(b"interface2"), bare(), frame(2), frame(1)];
    assert_eq!(names(&taken), ["interface2_", "interface2"]);
    // Frames came before the name that they were given was stated: none of them may be mixed with those of another.
    let late = [
        bare(),
        frame(0),
        named(b"can0"),
        frame(1),
        frame(0),
        named(b"can0"),
        frame(2),
    ];
    assert_eq!(names(&late), ["can0", "interface1", "can0", "interface2"]);
    // Each section has its own.
    let next = [named(b"can1"), section(L), bare(), bare(), frame(1)];
    assert_eq!(names(&next), ["can1"]);
    // Two that state the same name share it.
    assert_eq!(names(&[named(b"a"), named(b"a"), frame(1), frame(0)]), ["a", "a"]);
}

#[test]
fn a_capture_without_any_can_interface_says_so() {
    let damage = |blocks: &[Vec<u8>]| {
        let damage = read("pcapng", &[section(L), blocks.concat()].concat()).1;
        damage.map(|damage| (damage.at, damage.reason))
    };
    let ethernet = || [interface(L, 1, &[]), packet(L, 0, 2, &[0x45; 61], &[])].concat();
    let told = |reason: &str| Some((0, reason.to_owned()));
    assert_eq!(damage(&[ethernet()]), told("link type 1 carries no CAN frames"));
    assert_eq!(
        damage(&[ethernet(), section(L), ethernet()]),
        told("link type 1 carries no CAN frames")
    );
    assert_eq!(
        damage(&[ethernet(), interface(L, 101, &[])]),
        told("no interface carries CAN frames")
    );
    assert_eq!(damage(&[ethernet(), interface(L, 227, &[])]), None);
    assert_eq!(damage(&[interface(L, 113, &[]), section(L), ethernet()]), None);
    assert_eq!(damage(&[]), None);
    // What cannot be read may have been one.
    assert_eq!(damage(&[block(L, 1, &[1]), ethernet()]), None);
    assert_eq!(damage(&[ethernet(), packet(L, 7, 2, &[], &[])]), None);
    let mut broken = interface(L, 227, &[]);
    broken[4] = 0x18;
    assert_eq!(damage(&[broken, ethernet()]), None);
    let cut = [ethernet(), ethernet()[..30].to_vec()];
    assert_eq!(damage(&cut), Some((180, "pcapng data ends early".to_owned())));
}
