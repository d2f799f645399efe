//! JSON messages: the forms that values take, and what is refused.

use _native::frames::{BRS, DLC_SHIFT, ERROR, ESI, EXTENDED, FD, REMOTE, RX, TX};
use _native::mcap::{Layout, Role};

use crate::common::Sent;
use crate::{plain, read, sent, LOG_TIME};

const T: i64 = LOG_TIME as i64;
const ROLES: [&str; 18] = [
    "id",
    "data",
    "data_base64",
    "data_hex",
    "extended",
    "rtr",
    "error",
    "fd",
    "brs",
    "esi",
    "dlc",
    "bus",
    "tx",
    "sec",
    "nsec",
    "stamp_ns",
    "stamp_us",
    "stamp_s",
];

/// Each key that has the name of a role stands for it, on the first level and inside `can`.
fn json(text: &str) -> Result<Sent, String> {
    let named = |name: &&str| text.contains(&format!("\"{name}\""));
    let roles = ROLES.iter().filter(|name| **name == "id" || named(name));
    let field = |name: &&str| (Role::named(name).unwrap(), vec![(*name).to_owned()]);
    read(Layout::json(roles.map(field).collect()).unwrap(), text.as_bytes())
}

#[test]
fn a_common_message() {
    let text = r#"{"id": 84149761, "data": [166, 53, 0, 0, 0, 0, 0, 156], "bus": "can0"}"#;
    let data = [166, 53, 0, 0, 0, 0, 0, 156];
    assert_eq!(json(text), Ok(sent(T, "can0", 0x0504_0601, EXTENDED, &data)));
}

#[test]
fn identifiers() {
    for (id, is, flags) in [
        ("0", 0, 0),
        ("2047", 0x7FF, 0),
        ("2048", 0x800, EXTENDED),
        ("2147483649", 1, EXTENDED),
        ("-2147483647", 1, EXTENDED),
        ("1.6e1", 16, 0),
        ("\"0x1ABCDEF\"", 0x01AB_CDEF, EXTENDED),
        ("\"291\"", 291, 0),
    ] {
        assert_eq!(
            json(&format!(r#"{{"id":{id},"data":[]}}"#)),
            Ok(plain(is, flags, &[])),
            "{id}"
        );
    }
    assert_eq!(
        json(r#"{"id":1,"extended":true,"data":[]}"#),
        Ok(plain(1, EXTENDED, &[]))
    );
    assert_eq!(
        json(r#"{"id":2048,"extended":null,"data":[]}"#),
        Ok(plain(2048, EXTENDED, &[]))
    );
    assert_eq!(json(r#"{"id":1073741825,"data":[]}"#), Ok(plain(1, REMOTE, &[])));
    assert_eq!(
        json(r#"{"id":536870916,"data":[1]}"#),
        Ok(sent(T, "announced", 4, ERROR, &[1]))
    );
    for (id, reason) in [
        ("4294967296", "identifier out of range"),
        ("-2147483649", "identifier out of range"),
        ("0.5", "field is not an integer of 64 bits"),
        ("\"12z\"", "field is not a number"),
        ("\"0x\"", "field is not a number"),
        ("true", "field is not a number"),
        ("{}", "field is not a single value"),
        ("null", "no identifier"),
        ("2048,\"extended\":false", "standard identifier above 7FF"),
    ] {
        assert_eq!(
            json(&format!(r#"{{"id":{id},"data":[]}}"#)),
            Err(reason.to_owned()),
            "{id}"
        );
    }
}

#[test]
fn data_in_three_forms() {
    for (text, data) in [
        (r#""data":[ 1 , 255 ]"#, &[1, 255][..]),
        (r#""data":[]"#, &[]),
        (r#""data":null"#, &[]),
        (r#""data_hex":"DE ad:BE-ef.01""#, &[0xDE, 0xAD, 0xBE, 0xEF, 1]),
        (r#""data_hex":"""#, &[]),
        (r#""data_hex":[1,2]"#, &[1, 2]),
        (r#""data_base64":"3q2+7w==""#, &[0xDE, 0xAD, 0xBE, 0xEF]),
        (r#""data_base64":"3q2-7w""#, &[0xDE, 0xAD, 0xBE, 0xEF]),
        (r#""data_base64":"AQI\u003d""#, &[1, 2]),
        (r#""data_base64":"""#, &[]),
        (r#""data":[1,2,3],"data":[4]"#, &[4]),
        (r#""data":[1,2,3],"data":null"#, &[]),
    ] {
        assert_eq!(json(&format!(r#"{{"id":1,{text}}}"#)), Ok(plain(1, 0, data)), "{text}");
    }
    for (text, reason) in [
        (r#""data":[256]"#, "data byte out of range"),
        (r#""data":[-1]"#, "data byte out of range"),
        (r#""data":[1.5]"#, "data byte out of range"),
        (r#""data":["1"]"#, "not a JSON value"),
        (r#""data":[true]"#, "data byte is not a number"),
        (r#""data":[[1]]"#, "not a JSON value"),
        (r#""data":[1,]"#, "not a JSON value"),
        (r#""data":[1 2]"#, "no comma in a JSON list"),
        (r#""data":"DEAD""#, "data is not what was announced"),
        (r#""data":5"#, "data is not what was announced"),
        (r#""data_hex":"DEA""#, "odd number of hex digits"),
        (r#""data_hex":"D EA""#, "not a hex digit in the data"),
        (r#""data_base64":"3q2+7w=""#, "data is not base64"),
        (r#""data_base64":"3q2+7""#, "data is not base64"),
        (r#""data_base64":"3q2+7x==""#, "data is not base64"),
        (r#""data_base64":"3q2 7w==""#, "data is not base64"),
        (r#""data_base64":"===""#, "data is not base64"),
    ] {
        assert_eq!(json(&format!(r#"{{"id":1,{text}}}"#)), Err(reason.to_owned()), "{text}");
    }
    let long = |count: usize| format!(r#"{{"id":1,"data":[{}]}}"#, vec!["7"; count].join(","));
    assert_eq!(json(&long(64)), Ok(plain(1, FD, &[7; 64])));
    assert_eq!(json(&long(65)), Err("data longer than 64 bytes".to_owned()));
}

#[test]
fn lengths_and_codes() {
    let (ten, code) = (vec!["7"; 64].join(","), |code: u16| code << DLC_SHIFT);
    for (dlc, count, more, flags, length) in [
        ("2", 8, "", 0, 2),
        ("8", 64, "", 0, 8),
        ("12", 64, "", FD, 12),
        ("12", 24, "", FD, 24),
        ("9", 12, "", FD, 12),
        ("15", 64, "", FD, 64),
        ("64", 64, "", FD, 64),
        ("15", 8, "", code(15), 8),
        ("9", 9, "", FD, 9),
        ("12", 12, r#","fd":false"#, 0, 12),
        ("8", 8, r#","fd":true,"brs":1,"esi":false"#, FD | BRS, 8),
        ("8", 8, r#","brs":false,"esi":true"#, FD | ESI, 8),
        ("8", 8, r#","fd":false,"brs":true,"esi":true"#, 0, 8),
        ("3", 0, r#","rtr":true"#, REMOTE | code(3), 0),
        ("3", 8, r#","rtr":true"#, REMOTE | code(3), 0),
        ("14", 0, r#","rtr":true"#, REMOTE | code(14), 0),
        ("null", 0, r#","rtr":true"#, REMOTE, 0),
        ("null", 5, r#","rtr":true"#, REMOTE | code(5), 0),
    ] {
        let data = &ten[..(2 * count as usize).saturating_sub(1)];
        let text = format!(r#"{{"id":1,"dlc":{dlc},"data":[{data}]{more}}}"#);
        assert_eq!(json(&text), Ok(plain(1, flags, &[7; 64][..length])), "{text}");
    }
    for (rest, reason) in [
        (r#""dlc":3,"data":[1,2]"#, "says 3 bytes, has 2"),
        (r#""dlc":9,"data":[1,2]"#, "says 9 bytes, has 2"),
        (r#""dlc":9,"fd":true,"data":[1,2]"#, "says 12 bytes, has 2"),
        (r#""dlc":65,"data":[1,2]"#, "says 65 bytes, has 2"),
        (r#""dlc":256,"data":[1,2]"#, "length out of range"),
        (r#""dlc":8"#, "says 8 bytes, has 0"),
        (r#""dlc":16,"rtr":true"#, "data longer than 15 bytes"),
        (r#""fd":true,"rtr":true"#, "remote request on a CAN FD frame"),
        (r#""fd":2"#, "flag is neither true nor false"),
        (r#""error":true,"data":[1,2,3,4,5,6,7,8,9]"#, "data longer than 8 bytes"),
    ] {
        assert_eq!(json(&format!(r#"{{"id":1,{rest}}}"#)), Err(reason.to_owned()), "{rest}");
    }
}

#[test]
fn times_are_exact() {
    for (text, t) in [
        (r#""sec":1700000000,"nsec":123456789"#, 1_700_000_000_123_456_789),
        (r#""sec":1700000000.123456789"#, 1_700_000_000_123_456_789),
        (r#""sec":"1700000000","nsec":"5""#, 1_700_000_000_000_000_005),
        (r#""stamp_ns":1700000000123456789"#, 1_700_000_000_123_456_789),
        (r#""stamp_us":1700000000123456.5"#, 1_700_000_000_123_456_500),
        (r#""stamp_s":1.7e9"#, 1_700_000_000_000_000_000),
        (r#""stamp_s":1700000000.1234567894"#, 1_700_000_000_123_456_789),
        (r#""stamp_s":0"#, T),
        (r#""sec":0,"nsec":0"#, T),
        (r#""stamp_s":null"#, T),
        (r#""stamp_s":"""#, T),
        (r#""stamp_ns":9223372036854775807"#, i64::MAX),
    ] {
        assert_eq!(
            json(&format!(r#"{{"id":1,{text}}}"#)).map(|sent| sent.t),
            Ok(t),
            "{text}"
        );
    }
    for text in [
        r#""stamp_ns":9223372036854775808"#,
        r#""stamp_s":9223372037"#,
        r#""sec":9223372036,"nsec":999999999"#,
        r#""stamp_s":-1"#,
        r#""stamp_s":1e300"#,
    ] {
        assert_eq!(
            json(&format!(r#"{{"id":1,{text}}}"#)),
            Err("time stamp out of range".to_owned())
        );
    }
}

#[test]
fn names_and_directions() {
    for (text, name) in [
        (r#""can1""#, "can1"),
        (r#""can1\u0000""#, "can1"),
        (r#""\u0063\"\n""#, "c\"\\x0a"),
        ("3", "3"),
        (r#""""#, "announced"),
        ("null", "announced"),
    ] {
        let text = format!(r#"{{"id":1,"bus":{text}}}"#);
        assert_eq!(json(&text).map(|sent| sent.name), Ok(name.to_owned()), "{text}");
    }
    for (text, flags) in [
        ("true", TX),
        ("false", RX),
        ("1", TX),
        ("0", RX),
        (r#""TX""#, TX),
        (r#""Rx""#, RX),
        (r#""""#, 0),
        ("null", 0),
    ] {
        assert_eq!(
            json(&format!(r#"{{"id":1,"tx":{text}}}"#)),
            Ok(plain(1, flags, &[])),
            "{text}"
        );
    }
    assert!(json(r#"{"id":1,"tx":"sideways"}"#).is_err());
}

#[test]
fn keys_nest_repeat_and_may_be_escaped() {
    let keys = |path: &[&str]| path.iter().map(ToString::to_string).collect::<Vec<_>>();
    let layout = || {
        let fields = vec![
            (Role::Id, keys(&["can", "id"])),
            (Role::Bus, keys(&["can", "at", "bus"])),
            (Role::Dlc, keys(&[""])),
        ];
        Layout::json(fields).unwrap()
    };
    for (text, id) in [
        (r#"{"id":3,"can":{"id":5}}"#, 5),
        (r#"{"can":{"id":5,"at":7,"can":{"id":9}},"at":{"bus":4}}"#, 5),
        (r#"{"can":{"id":5},"can":{"id":6}}"#, 6),
        (r#"{"can":{"id":5},"can":[{"id":6}]}"#, 5),
        (r#"{"c\u0061n":{"\u0069d":5}}"#, 5),
        (r#"{"x":{"can":{"id":4}},"":0,"y":"\\","can":{"id":5}}"#, 5),
    ] {
        assert_eq!(read(layout(), text.as_bytes()), Ok(plain(id, 0, &[])), "{text}");
    }
    let path = |key: &str, more: usize| vec![key.to_owned(); more];
    assert!(Layout::json(vec![(Role::Id, path("id", 16))]).is_ok());
    for fields in [
        vec![],
        vec![(Role::Id, vec![])],
        vec![(Role::Id, path("id", 17))],
        vec![(Role::Data, path("d", 1))],
        vec![(Role::Id, path("id", 1)), (Role::Id, path("x", 1))],
        vec![
            (Role::Id, path("id", 1)),
            (Role::Data, path("x", 1)),
            (Role::DataHex, path("y", 1)),
        ],
        vec![(Role::Id, path("id", 1)), (Role::Dlc, path("id", 1))],
        vec![(Role::Id, path("id", 1)), (Role::Dlc, path("id", 2))],
        vec![(Role::Id, path("id", 2)), (Role::Dlc, path("id", 1))],
    ] {
        assert!(Layout::json(fields.clone()).is_err(), "{fields:?}");
    }
}

#[test]
fn what_is_no_json_says_why() {
    for (text, reason) in [
        ("", "JSON ends early"),
        ("[1]", "not a JSON object"),
        ("{", "JSON ends early"),
        ("{}", "no identifier"),
        ("{id:1}", "no key in a JSON object"),
        (r#"{"id"=1}"#, "no colon in a JSON object"),
        (r#"{"id":1"x":2}"#, "no comma in a JSON object"),
        (r#"{"id":1,}"#, "no key in a JSON object"),
        (r#"{"id":1}}"#, "text after the JSON object"),
        (r#"{"id":01}"#, "not a JSON number"),
        (r#"{"id":.5}"#, "not a JSON value"),
        (r#"{"id":1.}"#, "not a JSON number"),
        (r#"{"id":NaN}"#, "not a JSON value"),
        (r#"{"id":1,"x":nul}"#, "not a JSON value"),
        (r#"{"id":1,"x":"\"#, "JSON ends early"),
        ("{\"id\":1,\"x\":\"\t\"}", "control byte in a JSON string"),
        (r#"{"id":1,"bus":"\q"}"#, "JSON escape not understood"),
        (r#"{"id":1,"x":[1 2]}"#, "no comma in a JSON list"),
    ] {
        assert_eq!(json(text), Err(reason.to_owned()), "{text}");
    }
    for (open, close) in [("[", "]"), ("{\"a\":", "}")] {
        let deep = |depth: usize| {
            let inside = if open == "[" { "" } else { "0" };
            format!(
                r#"{{"id":1,"x":{}{inside}{}}}"#,
                open.repeat(depth),
                close.repeat(depth)
            )
        };
        assert_eq!(json(&deep(63)), Ok(plain(1, 0, &[])));
        assert_eq!(json(&deep(64)), Err("JSON nested too deep".to_owned()));
        assert_eq!(json(&deep(100_000)), Err("JSON nested too deep".to_owned()));
    }
}
