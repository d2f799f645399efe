//! Transfers of one type: who sent them.

use std::sync::Arc;

use _native::groups::{Group, MESSAGE, REQUEST, RESPONSE};
use _native::transfers::{Row, Sink as _, Status, Transfers};
use _native::wire::{Id, Kind};

fn transfers(rows: &[(Kind, u8, u8, Status, &[u8])]) -> Arc<Transfers> {
    let mut transfers = Transfers::default();
    for &(kind, bus, src, status, payload) in rows {
        let id = Id {
            kind,
            type_id: 7,
            src,
            dst: 0,
        };
        transfers.push(&Row {
            bus,
            status,
            ..Row::bare(id, payload)
        });
    }
    Arc::new(transfers)
}

#[test]
fn requests_and_responses_are_two_groups() {
    let all = transfers(&[
        (Kind::Response, 0, 1, Status::Ok, b""),
        (Kind::Request, 0, 2, Status::Ok, b""),
        (Kind::Response, 0, 3, Status::Ok, b""),
    ]);
    let rows = |groups: &[Group]| groups.iter().map(|g| (g.kind, g.rows.clone())).collect::<Vec<_>>();
    assert_eq!(
        rows(&Group::of(&all, vec![0, 1, 2], (true, 7, 0))),
        [(REQUEST, vec![1]), (RESPONSE, vec![0, 2])]
    );
    assert_eq!(
        rows(&Group::of(&all, vec![0, 2], (true, 7, 0))),
        [(RESPONSE, vec![0, 2])]
    );
    assert_eq!(
        rows(&Group::of(&all, vec![2, 1], (false, 7, 0))),
        [(MESSAGE, vec![2, 1])]
    );
}

#[test]
fn nodes_are_those_whose_crc_is_right() {
    let all = transfers(&[
        (Kind::Message, 255, 127, Status::Ok, b""),
        (Kind::Message, 0, 64, Status::BadCrc, b""),
        (Kind::Anonymous, 0, 0, Status::Ok, b""),
        (Kind::Message, 0, 63, Status::Ok, b""),
        (Kind::Message, 0, 63, Status::Ok, b""),
    ]);
    let group = &Group::of(&all, (0..5).collect(), (false, 7, 0))[0];
    assert_eq!(group.nodes(), [0, 63, 0xFF7F]);
    assert_eq!(group.senders(), [0xFF7F, 64, 0, 63, 63]);
    assert_eq!(group.trusted(), [1, 0, 1, 1, 1]);
    let picked = group.pick(&[3, 9, 1]);
    assert_eq!((picked.rows.clone(), picked.nodes()), (vec![3, 1], vec![63]));
}
