//! What a plan must be, and the words in which the others are refused.

use crate::table::tokens;
use _native::plan::{Kind, Plan};

type Words<'a> = &'a [(&'a str, u32, u32)];

fn error(list: Words) -> String {
    Plan::parse(&tokens(list)).unwrap_err().to_string()
}

#[test]
fn the_prefix_ends_at_the_first_field_of_variable_size() {
    let plan = [
        ("struct", 4, 0),
        ("uint", 32, 0),
        ("struct", 2, 0),
        ("bool", 1, 0),
        ("void", 7, 0),
    ];
    let list = [("list", 3, 2), ("uint", 8, 0), ("uint", 8, 0)];
    let plan = Plan::parse(&tokens(&[&plan[..], &list[..]].concat())).unwrap();
    assert_eq!(plan.prefix, 2);
    assert_eq!(plan.root.min_bits, 32 + 8 + 2 + 8);
    let Kind::Struct(fields) = plan.root.kind else {
        unreachable!()
    };
    assert_eq!(
        fields.iter().map(|f| (f.fixed, f.width())).collect::<Vec<_>>(),
        [(true, 4), (true, 0), (false, 0), (true, 1)]
    );
}

#[test]
fn each_rule_has_its_words() {
    let cases: [(Words, &str); 19] = [
        (&[], "token 0: missing, the type is not complete"),
        (
            &[("struct", 2, 0), ("bool", 1, 0)],
            "token 2: missing, the type is not complete",
        ),
        (
            &[("struct", 0, 0), ("bool", 1, 0)],
            "token 1 stands behind the end of the type",
        ),
        (&[("uint", 8, 0)], "the outermost type must be a struct or a union"),
        (&[("struct", 1, 0), ("byte", 8, 0)], "token 1: unknown kind \"byte\""),
        (
            &[("struct", 1, 0), ("uint", 0, 0)],
            "token 1: uint of 0 bits, 1 to 64 exist",
        ),
        (
            &[("struct", 1, 0), ("int", 65, 0)],
            "token 1: int of 65 bits, 1 to 64 exist",
        ),
        (
            &[("struct", 1, 0), ("void", 65, 0)],
            "token 1: void of 65 bits, 1 to 64 exist",
        ),
        (
            &[("struct", 1, 0), ("float", 24, 0)],
            "token 1: float of 24 bits, 16, 32 and 64 exist",
        ),
        (&[("struct", 1, 0), ("bool", 8, 0)], "token 1: bool of 8 bits"),
        (
            &[("struct", 1, 0), ("array", 0, 0), ("bool", 1, 0)],
            "token 1: array of no elements",
        ),
        (
            &[("struct", 1, 0), ("list", 0, 1), ("bool", 1, 0)],
            "token 1: list of no elements",
        ),
        (
            &[("struct", 1, 0), ("list", 4, 2), ("bool", 1, 0)],
            "token 1: a length of 2 bits for up to 4 elements",
        ),
        (
            &[("struct", 1, 0), ("list", 4, 33), ("bool", 1, 0)],
            "token 1: a length of 33 bits for up to 4 elements",
        ),
        (&[("union", 0, 1)], "token 0: union of no members"),
        (
            &[("union", 3, 1), ("bool", 1, 0)],
            "token 0: a tag of 1 bits for 3 members",
        ),
        (
            &[("struct", 1, 0), ("list", 4, 3), ("struct", 0, 0)],
            "token 1: an element without bits",
        ),
        (
            &[("struct", 1, 0), ("array", 4, 0), ("void", 3, 0)],
            "token 1: void as element",
        ),
        (&[("union", 1, 0), ("void", 3, 0)], "token 0: void as union member"),
    ];
    for (plan, text) in cases {
        assert_eq!(error(plan), format!("decode plan: {text}"));
    }
}

#[test]
fn depth_and_number_of_nodes_are_bounded() {
    let nested = |depth: usize| {
        let mut list = vec![("struct", 1, 0); depth - 1];
        list.push(("bool", 1, 0));
        Plan::parse(&tokens(&list)).map_err(|error| error.to_string())
    };
    assert!(nested(32).is_ok());
    assert_eq!(nested(33).unwrap_err(), "decode plan: token 32: nested deeper than 32");
    let wide = |nodes| {
        let mut list = vec![("bool", 1, 0); nodes];
        list[0] = ("struct", nodes as u32 - 1, 0);
        Plan::parse(&tokens(&list)).map_err(|error| error.to_string())
    };
    assert!(wide(4096).is_ok());
    assert_eq!(wide(4097).unwrap_err(), "decode plan: 4097 nodes, the most are 4096");
}

#[test]
fn sizes_beyond_any_payload_saturate() {
    let mut list = vec![("struct", 1, 0)];
    list.extend([("array", u32::MAX, 0); 5]);
    list.push(("uint", 64, 0));
    assert_eq!(Plan::parse(&tokens(&list)).unwrap().root.min_bits, u64::MAX);
}
