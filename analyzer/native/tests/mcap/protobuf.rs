//! Protocol Buffers messages: wire forms, defaults, and what is refused.

use _native::frames::{EXTENDED, FD, RX, TX};
use _native::mcap::{Form, Layout, Role};

use crate::common::messages::{field, nested, varint};
use crate::{plain, read, sent, LOG_TIME};

const T: i64 = LOG_TIME as i64;
const ID: (Role, u32, Form) = (Role::Id, 1, Form::Varint);

fn layout(fields: &[(Role, u32, Form)]) -> Layout {
    let fields = fields.iter().map(|&(role, number, form)| (role, vec![number], form));
    Layout::protobuf(fields.collect()).unwrap()
}

#[test]
fn integers_in_every_form() {
    for (form, value) in [
        (Form::Varint, field(1, 0, &varint(0x123))),
        (Form::Varint, field(1, 0, &[0xA3, 0x82, 0x80, 0x00])),
        (Form::ZigZag, field(1, 0, &varint(0x246))),
        (Form::Fixed32, field(1, 5, &0x123_u32.to_le_bytes())),
        (Form::SFixed32, field(1, 5, &0x123_u32.to_le_bytes())),
        (Form::Fixed64, field(1, 1, &0x123_u64.to_le_bytes())),
        (Form::SFixed64, field(1, 1, &0x123_u64.to_le_bytes())),
        (Form::Float, field(1, 5, &291_f32.to_le_bytes())),
        (Form::Double, field(1, 1, &291_f64.to_le_bytes())),
        (Form::String, nested(1, b"0x123")),
    ] {
        assert_eq!(
            read(layout(&[(Role::Id, 1, form)]), &value),
            Ok(plain(0x123, 0, &[])),
            "{form:?}"
        );
    }
    // The extended bit of a signed word of 32 bits.
    let word = 0x8000_0123_u32 as i32;
    for (form, value) in [
        (Form::Varint, field(1, 0, &varint(i64::from(word) as u64))),
        (Form::Varint, field(1, 0, &varint(0x8000_0123))),
        (
            Form::ZigZag,
            field(1, 0, &varint(u64::from(((word << 1) ^ (word >> 31)) as u32))),
        ),
        (Form::SFixed32, field(1, 5, &word.to_le_bytes())),
    ] {
        assert_eq!(
            read(layout(&[(Role::Id, 1, form)]), &value),
            Ok(plain(0x123, EXTENDED, &[])),
            "{form:?}"
        );
    }
    for (form, value, reason) in [
        (
            Form::Varint,
            field(1, 0, &varint(u64::MAX << 40)),
            "identifier out of range",
        ),
        (
            Form::Fixed64,
            field(1, 1, &u64::MAX.to_le_bytes()),
            "field is not an integer of 64 bits",
        ),
        (
            Form::Float,
            field(1, 5, &0.5_f32.to_le_bytes()),
            "field is not a number",
        ),
    ] {
        assert_eq!(read(layout(&[(Role::Id, 1, form)]), &value), Err(reason.to_owned()));
    }
}

#[test]
fn data_in_every_form() {
    let id = field(1, 0, &[7]);
    for (form, value, data) in [
        (Form::Bytes, vec![], &[][..]),
        (Form::Bytes, nested(2, &[1, 2, 0xFF]), &[1, 2, 0xFF]),
        (Form::Bytes, [nested(2, &[1, 2]), nested(2, &[3])].concat(), &[3]),
        (Form::Repeated, nested(2, &[1, 2, 0xFF, 1]), &[1, 2, 0xFF]),
        (
            Form::Repeated,
            [field(2, 0, &[1]), nested(2, &[2]), field(2, 0, &[3])].concat(),
            &[1, 2, 3],
        ),
    ] {
        let layout = layout(&[ID, (Role::Data, 2, form)]);
        assert_eq!(read(layout, &[id.clone(), value].concat()), Ok(plain(7, 0, data)));
    }
    let long = |form, count| read(layout(&[ID, (Role::Data, 2, form)]), &nested(2, &vec![1; count]));
    for form in [Form::Bytes, Form::Repeated] {
        assert_eq!(long(form, 64), Ok(plain(0, FD, &[1; 64])));
        assert_eq!(long(form, 65), Err("data longer than 64 bytes".to_owned()));
    }
    let large = read(
        layout(&[ID, (Role::Data, 2, Form::Repeated)]),
        &field(2, 0, &varint(256)),
    );
    assert_eq!(large, Err("data byte out of range".to_owned()));
    for (role, text) in [(Role::DataHex, "01 02"), (Role::DataBase64, "AQI=")] {
        let layout = layout(&[ID, (role, 2, Form::String)]);
        assert_eq!(read(layout, &nested(2, text.as_bytes())), Ok(plain(0, 0, &[1, 2])));
    }
    let repeated = vec![(Role::Id, vec![1], Form::Repeated)];
    assert!(Layout::protobuf(repeated).is_err(), "only data is a list");
}

#[test]
fn times_in_every_form() {
    let t = 1_700_000_000_123_456_768_i64;
    for (role, form, value) in [
        (Role::StampNs, Form::Fixed64, field(2, 1, &(t as u64).to_le_bytes())),
        (Role::StampNs, Form::Varint, field(2, 0, &varint(t as u64))),
        (Role::StampS, Form::String, nested(2, b"1700000000.123456768")),
    ] {
        assert_eq!(
            read(layout(&[ID, (role, 2, form)]), &value).map(|sent| sent.t),
            Ok(t),
            "{form:?}"
        );
    }
    let stamp = |role, value: f64| {
        read(
            layout(&[ID, (role, 2, Form::Double)]),
            &field(2, 1, &value.to_le_bytes()),
        )
    };
    assert_eq!(
        stamp(Role::StampS, 1_700_000_000.25).map(|sent| sent.t),
        Ok(1_700_000_000_250_000_000)
    );
    assert_eq!(
        stamp(Role::StampUs, 1_700_000_000_000_000.5).map(|sent| sent.t),
        Ok(1_700_000_000_000_000_500)
    );
    assert_eq!(stamp(Role::StampS, 0.0).map(|sent| sent.t), Ok(T));
    for value in [f64::NAN, f64::INFINITY, -1.0, 1e300, 9_223_372_037.0] {
        assert_eq!(
            stamp(Role::StampS, value),
            Err("time stamp out of range".to_owned()),
            "{value}"
        );
    }
}

#[test]
fn what_is_not_written_is_zero() {
    let fields = [
        ID,
        (Role::Extended, 2, Form::Varint),
        (Role::Bus, 3, Form::Varint),
        (Role::Sent, 4, Form::Varint),
    ];
    assert_eq!(read(layout(&fields), &[]), Ok(sent(T, "0", 0, RX, &[])));
    let given = [field(1, 0, &varint(0x800)), field(3, 0, &[2]), field(4, 0, &[1])].concat();
    assert_eq!(
        read(layout(&fields), &given),
        Ok(sent(T, "2", 0x800, EXTENDED | TX, &[]))
    );
    let standard = [given, field(2, 0, &[0])].concat();
    assert_eq!(
        read(layout(&fields), &standard),
        Err("standard identifier above 7FF".to_owned())
    );
    let named = layout(&[ID, (Role::Bus, 3, Form::String)]);
    assert_eq!(read(named, &[]), Ok(plain(0, 0, &[])));
}

#[test]
fn unknown_fields_are_skipped_and_the_last_one_wins() {
    let unknown = [
        field(9, 0, &varint(u64::MAX)),
        field(9, 1, &[8; 8]),
        nested(9, &[8; 9]),
        field(9, 5, &[8; 4]),
        [
            field(9, 3, &[]),
            field(1, 0, &[4]),
            field(1, 1, &[0; 8]),
            nested(1, b"x"),
            field(1, 5, &[0; 4]),
        ]
        .concat(),
        [field(8, 3, &[]), field(8, 4, &[]), field(9, 4, &[])].concat(),
    ];
    let message = [
        field(1, 0, &[5]),
        unknown.concat(),
        field(1, 0, &[6]),
        field((1 << 29) - 1, 0, &[0]),
    ]
    .concat();
    assert_eq!(read(layout(&[ID]), &message), Ok(plain(6, 0, &[])));
    let deep = vec![(Role::Id, vec![1, 2, 3], Form::Varint)];
    let message = nested(1, &[field(3, 0, &[9]), nested(2, &field(3, 0, &[4]))].concat());
    assert_eq!(read(Layout::protobuf(deep).unwrap(), &message), Ok(plain(4, 0, &[])));
}

#[test]
fn what_is_no_message_says_why() {
    let groups = |count: usize| [vec![0x4B; count], vec![0x4C; count]].concat();
    assert_eq!(read(layout(&[ID]), &groups(64)), Ok(plain(0, 0, &[])));
    for (message, reason) in [
        (vec![0x08], "protobuf ends early"),
        (vec![0x08, 0x80], "protobuf ends early"),
        (vec![0x4A, 5, 1], "protobuf ends early"),
        (vec![0x49, 5, 1], "protobuf ends early"),
        ([&[0x4A][..], &[0xFF; 9], &[1]].concat(), "protobuf ends early"),
        (
            [&[0x08][..], &[0xFF; 9], &[2]].concat(),
            "protobuf number longer than 64 bits",
        ),
        (
            [&[0x08][..], &[0xFF; 10], &[1]].concat(),
            "protobuf number longer than 64 bits",
        ),
        (vec![0x00, 0], "protobuf field number out of range"),
        (field(1 << 29, 0, &[0]), "protobuf field number out of range"),
        (vec![0x4E], "protobuf field of an unknown kind"),
        (vec![0x4C], "protobuf field of an unknown kind"),
        (vec![0x4B, 0x54], "protobuf group without its end"),
        (vec![0x4B], "protobuf ends early"),
        (groups(65), "protobuf groups nested too deep"),
        (vec![0x4B; 100_000], "protobuf groups nested too deep"),
        (nested(1, &[1]), "field 1 is not what was announced"),
        (vec![0x0B, 0x0C], "field 1 is not what was announced"),
    ] {
        assert_eq!(read(layout(&[ID]), &message), Err(reason.to_owned()), "{reason}");
    }
}
