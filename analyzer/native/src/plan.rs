//! The immutable decode plan of one type: what follows what on the wire, checked once, run over many rows.
#![forbid(unsafe_code)]

use std::fmt;

/// A token: kind, then what its row in [`Plan::parse`] says.
pub type Token = (String, u32, u32);

const MAX_DEPTH: usize = 32;
const MAX_NODES: usize = 4096;
/// A union of more members than a plan has nodes needs no wider tag.
const MAX_TAG_BITS: u32 = 16;
const MAX_LENGTH_BITS: u32 = 32;
/// Elements shorter than this keep the length field of their array even at the tail of a type.
const TAIL_ELEMENT_BITS: u64 = 8;

/// Why a token list is not a plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlanError(String);

impl fmt::Display for PlanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "decode plan: {}", self.0)
    }
}

impl std::error::Error for PlanError {}

/// How the bits of a scalar become a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    Uint,
    Int,
    Float,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Padding inside a struct: takes bits, gives no column.
    Void {
        bits: u32,
    },
    Bool,
    Scalar {
        form: Form,
        bits: u32,
    },
    Array {
        count: u32,
        element: Box<Node>,
    },
    List {
        max: u32,
        length_bits: u32,
        element: Box<Node>,
    },
    Struct(Vec<Node>),
    Union {
        tag_bits: u32,
        members: Vec<Node>,
    },
}

/// A type on the wire with what its size is known to be. All sizes are bits and saturate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Node {
    pub kind: Kind,
    /// The shortest form, length fields counted.
    pub min_bits: u64,
    /// Every value takes `min_bits`, so that what follows has a constant place.
    pub fixed: bool,
    /// The shortest form if arrays had no length fields: the measure that decides on tail arrays.
    bare_bits: u64,
}

impl Node {
    fn new(kind: Kind) -> Node {
        let (min_bits, bare_bits, fixed) = match &kind {
            Kind::Void { bits } | Kind::Scalar { bits, .. } => (u64::from(*bits), u64::from(*bits), true),
            Kind::Bool => (1, 1, true),
            Kind::Array { count, element } => (
                element.min_bits.saturating_mul(u64::from(*count)),
                element.bare_bits.saturating_mul(u64::from(*count)),
                element.fixed,
            ),
            Kind::List { length_bits, .. } => (u64::from(*length_bits), 0, false),
            Kind::Struct(fields) => (
                fields.iter().fold(0, |sum, f| f.min_bits.saturating_add(sum)),
                fields.iter().fold(0, |sum, f| f.bare_bits.saturating_add(sum)),
                fields.iter().all(|f| f.fixed),
            ),
            Kind::Union { tag_bits, members } => {
                let tag = u64::from(*tag_bits);
                let shortest = |size: fn(&Node) -> u64| members.iter().map(size).min().unwrap_or(0);
                (
                    tag.saturating_add(shortest(|m| m.min_bits)),
                    tag.saturating_add(shortest(|m| m.bare_bits)),
                    false,
                )
            }
        };
        Node {
            kind,
            min_bits,
            fixed,
            bare_bits,
        }
    }

    /// An unsigned number.
    pub fn unsigned(bits: u32) -> Node {
        Node::new(scalar(Form::Uint, bits))
    }

    /// Whether a dynamic array of this element loses its length field at the tail of a type
    /// (tail array optimisation; `DroneCAN`, classic CAN only).
    pub fn fills_tail(&self) -> bool {
        self.bare_bits >= TAIL_ELEMENT_BITS
    }

    /// Bytes of a scalar's cell: the smallest integer that holds it; float16 widens to float32. 0 for all else.
    pub fn width(&self) -> usize {
        match self.kind {
            Kind::Scalar { form, bits } => match (form, bits) {
                (Form::Uint | Form::Int, ..=8) => 1,
                (Form::Uint | Form::Int, ..=16) => 2,
                (_, ..=32) => 4,
                _ => 8,
            },
            _ => 0,
        }
    }
}

/// A checked plan. The root is a struct or a union.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    pub root: Node,
    /// How many of the root struct's first fields lie at constant bit offsets with constant sizes.
    pub prefix: usize,
}

impl Plan {
    /// Builds a plan from preorder tokens:
    ///
    /// | token | followed by |
    /// |---|---|
    /// | `("struct", n, 0)` | n nodes |
    /// | `("union", n, tag bits)` | n nodes, none of them void |
    /// | `("uint" \| "int" \| "void", bits, 0)` | - ; 1 to 64 bits |
    /// | `("float", bits, 0)` | - ; 16, 32 or 64 bits |
    /// | `("bool", 1, 0)` | - |
    /// | `("array", count, 0)` | the element |
    /// | `("list", max, length bits)` | the element |
    ///
    /// At most 4096 nodes, 32 deep. An element takes at least one bit, so that a row of n bits has at most n.
    ///
    /// # Errors
    /// The first token that breaks a rule, by its place from 0.
    pub fn parse(tokens: &[Token]) -> Result<Plan, PlanError> {
        if tokens.len() > MAX_NODES {
            return Err(PlanError(format!("{} nodes, the most are {MAX_NODES}", tokens.len())));
        }
        let mut parser = Parser { tokens, at: 0 };
        let root = parser.node(1)?;
        if parser.at < tokens.len() {
            return Err(PlanError(format!(
                "token {} stands behind the end of the type",
                parser.at
            )));
        }
        let prefix = match &root.kind {
            Kind::Struct(fields) => fields.iter().take_while(|f| f.fixed).count(),
            Kind::Union { .. } => 0,
            _ => return Err(PlanError("the outermost type must be a struct or a union".into())),
        };
        Ok(Plan { root, prefix })
    }
}

struct Parser<'a> {
    tokens: &'a [Token],
    at: usize,
}

impl Parser<'_> {
    fn node(&mut self, depth: usize) -> Result<Node, PlanError> {
        let at = self.at;
        let fail = |text: String| Err(PlanError(format!("token {at}: {text}")));
        if depth > MAX_DEPTH {
            return fail(format!("nested deeper than {MAX_DEPTH}"));
        }
        let Some((word, number, extra)) = self.tokens.get(at) else {
            return fail("missing, the type is not complete".into());
        };
        let (number, extra) = (*number, *extra);
        self.at += 1;
        let kind = match word.as_str() {
            "uint" | "int" | "void" if !(1..=64).contains(&number) => {
                return fail(format!("{word} of {number} bits, 1 to 64 exist"));
            }
            "float" if ![16, 32, 64].contains(&number) => {
                return fail(format!("float of {number} bits, 16, 32 and 64 exist"));
            }
            "bool" if number != 1 => return fail(format!("bool of {number} bits")),
            "array" | "list" if number == 0 => return fail(format!("{word} of no elements")),
            "list" if extra > MAX_LENGTH_BITS || extra == 0 || u64::from(number) >> extra != 0 => {
                return fail(format!("a length of {extra} bits for up to {number} elements"));
            }
            "union" if number == 0 => return fail("union of no members".into()),
            "union" if extra > MAX_TAG_BITS || u64::from(number - 1) >> extra != 0 => {
                return fail(format!("a tag of {extra} bits for {number} members"));
            }
            "void" => Kind::Void { bits: number },
            "bool" => Kind::Bool,
            "uint" => scalar(Form::Uint, number),
            "int" => scalar(Form::Int, number),
            "float" => scalar(Form::Float, number),
            "struct" => Kind::Struct(self.nodes(number, depth)?),
            "union" => Kind::Union {
                tag_bits: extra,
                members: self.nodes(number, depth)?,
            },
            "array" => Kind::Array {
                count: number,
                element: Box::new(self.node(depth + 1)?),
            },
            "list" => Kind::List {
                max: number,
                length_bits: extra,
                element: Box::new(self.node(depth + 1)?),
            },
            _ => return fail(format!("unknown kind {word:?}")),
        };
        match &kind {
            Kind::Array { element, .. } | Kind::List { element, .. } if element.min_bits == 0 => {
                return fail("an element without bits".into());
            }
            Kind::Array { element, .. } | Kind::List { element, .. } if is_void(element) => {
                return fail("void as element".into());
            }
            Kind::Union { members, .. } if members.iter().any(is_void) => return fail("void as union member".into()),
            _ => {}
        }
        Ok(Node::new(kind))
    }

    fn nodes(&mut self, count: u32, depth: usize) -> Result<Vec<Node>, PlanError> {
        (0..count).map(|_| self.node(depth + 1)).collect()
    }
}

fn scalar(form: Form, bits: u32) -> Kind {
    Kind::Scalar { form, bits }
}

fn is_void(node: &Node) -> bool {
    matches!(node.kind, Kind::Void { .. })
}
