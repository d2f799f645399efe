//! The laws of descriptions: whatever is made of fields has a cell a row, and so has the reading of lengths.

use _native::bits::Span;
use _native::decoder::length::{Length, Limit};
use _native::decoder::make::{Formula, Look, Make, Measure, Piece};
use _native::decoder::number::Linear;
use _native::decoder::Decoder;
use _native::plan::{Form, Kind, Node, Plan};
use _native::unpack::column::Column;
use _native::unpack::TAIL;

/// Everything that can be made of the fields of a layout.
pub fn check(plan: &Plan, spans: &[Span], layouts: &[u8], payload: &[u8]) {
    let (Kind::Struct(fields) | Kind::Union { members: fields, .. }) = &plan.root.kind else {
        unreachable!("the outermost type is one of these")
    };
    let mut decoder = Decoder::new(plan.clone());
    decoder.makes = fields
        .iter()
        .enumerate()
        .flat_map(|(field, node)| makes(field, node, &fields[0]))
        .collect();
    let fd: Vec<u8> = (0..spans.len())
        .map(|row| layouts.get(row).copied().unwrap_or(TAIL) & 1)
        .collect();
    let limit = |field| Limit {
        field,
        low: 0.0,
        high: 9.0,
        special: vec![77],
    };
    let fits = Length::Fits((0..fields.len()).map(limit).collect());
    for length in [
        Length::Never,
        Length::Counted {
            at: 1,
            header: b"<".to_vec(),
        },
        fits,
    ] {
        let (codes, found) = length.unpack(plan, spans, &fd, payload);
        assert_eq!((codes.len(), found.root.len()), (spans.len(), spans.len()));
        let columns = decoder.rows(spans, &codes, payload);
        assert!(columns.iter().all(|column| column.len() == spans.len()));
        columns.into_iter().flat_map(Column::flatten).for_each(drop);
    }
}

/// All that a profile can say of a field; `first` is the first one of its layout.
fn makes(field: usize, node: &Node, first: &Node) -> Vec<Make> {
    let linear = Linear {
        times: 3.0,
        by: 7.0,
        plus: 1.0,
    };
    let formula = Formula {
        linear,
        pieces: vec![Piece {
            start: 1.0,
            stop: 5.0,
            add: 2.0,
        }],
        low: 1.0,
        high: 100.0,
        without: vec![3],
    };
    let scaled = Make::Shown {
        field,
        scales: vec![(vec![], linear), (vec![0, 1], linear)],
    };
    let derived = |element| {
        let formula = formula.clone();
        [
            Make::Derived {
                field,
                element,
                formula,
            },
            Make::Day { field, element },
        ]
    };
    let part = |look| Make::Part {
        field,
        low: 1,
        width: 5,
        look,
        without: vec![7],
    };
    let number = |node: &Node| matches!(node.kind, Kind::Scalar { .. });
    let mut out = vec![];
    match &node.kind {
        Kind::Void { .. } => return out,
        Kind::Scalar { form, .. } => {
            out.extend(derived(None));
            if *form == Form::Uint {
                out.extend([part(Look::Flag), part(Look::Number), part(Look::Physical(linear))]);
            }
            if number(first) {
                let measures = vec![Measure {
                    mode: 1,
                    exact: linear,
                    factor: 0.1,
                    unit: "A".into(),
                }];
                out.push(Make::Measured { field, by: 0, measures });
            }
        }
        Kind::Array { element, .. } | Kind::List { element, .. } if number(element) => {
            out.extend(derived(None).into_iter().chain(derived(Some(1))));
            if element.kind
                == (Kind::Scalar {
                    form: Form::Uint,
                    bits: 8,
                })
            {
                out.push(Make::Text { field });
            }
        }
        _ => {}
    }
    out.push(scaled);
    out
}
