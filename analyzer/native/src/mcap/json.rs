//! JSON messages: one pass, which keeps the fields that were announced and only checks the rest.
#![forbid(unsafe_code)]

mod text;

use super::decimal::Decimal;
use super::found::Found;
use super::role::Role;
use super::tree::{Target, Tree};
use super::value::Value;
use crate::line::Reason;
use text::unescape;

/// Objects and lists inside each other.
const MAX_DEPTH: usize = 64;
const ENDS_EARLY: Reason = Reason::Borrowed("JSON ends early");
/// More digits than this are read the slow way.
const FAST_DIGITS: usize = 18;

pub(super) type Fields = Tree<Vec<u8>, Role>;

/// # Errors
/// The reason why `data` is no JSON object, or a field is not what was announced.
pub(super) fn read(fields: &Fields, data: &[u8], found: &mut Found) -> Result<(), Reason> {
    let mut scanner = Scanner {
        fields,
        found,
        data,
        at: 0,
        text: vec![],
    };
    if scanner.token()? != b'{' {
        return Err("not a JSON object".into());
    }
    scanner.object(Some(0), 1)?;
    scanner.blanks();
    if scanner.at < data.len() {
        return Err("text after the JSON object".into());
    }
    Ok(())
}

struct Scanner<'a> {
    fields: &'a Fields,
    found: &'a mut Found,
    data: &'a [u8],
    at: usize,
    /// A string without its escapes.
    text: Vec<u8>,
}

impl Scanner<'_> {
    /// The members behind the opening brace. `node`: where the tree of fields goes on, if it does.
    fn object(&mut self, node: Option<usize>, depth: usize) -> Result<(), Reason> {
        let mut first = true;
        loop {
            match self.token()? {
                b'}' if first => return Ok(()),
                b'"' => {}
                _ => return Err("no key in a JSON object".into()),
            }
            first = false;
            let key = self.string()?;
            let target = node.and_then(|node| self.target(node, key));
            if self.token()? != b':' {
                return Err("no colon in a JSON object".into());
            }
            let start = self.token()?;
            match target {
                Some(Target::Leaf(role)) if start == b'[' && role.is_data() => self.data_list()?,
                Some(Target::Leaf(role)) => self.leaf(role, start)?,
                Some(Target::Inner(inner)) if start == b'{' => {
                    self.nested(depth, |scanner, depth| scanner.object(Some(inner), depth))?;
                }
                Some(Target::Inner(_)) | None => self.skip(start, depth)?,
            }
            match self.token()? {
                b',' => {}
                b'}' => return Ok(()),
                _ => return Err("no comma in a JSON object".into()),
            }
        }
    }

    fn nested(
        &mut self,
        depth: usize,
        read: impl FnOnce(&mut Self, usize) -> Result<(), Reason>,
    ) -> Result<(), Reason> {
        if depth == MAX_DEPTH {
            return Err("JSON nested too deep".into());
        }
        read(self, depth + 1)
    }

    fn target(&mut self, node: usize, (start, end, escaped): Span) -> Option<Target<Role>> {
        let key = &self.data[start..end];
        if escaped {
            self.text.clear();
            unescape(key, &mut self.text).ok()?;
            return self.fields.find(node, |known| *known == self.text);
        }
        self.fields.find(node, |known| *known == key)
    }

    fn leaf(&mut self, role: Role, start: u8) -> Result<(), Reason> {
        let value = match start {
            b'"' => {
                let (start, end, escaped) = self.string()?;
                let text = &self.data[start..end];
                if escaped {
                    self.text.clear();
                    unescape(text, &mut self.text)?;
                    Value::Text(&self.text)
                } else {
                    Value::Text(text)
                }
            }
            b'{' | b'[' => return Err("field is not a single value".into()),
            _ => self.scalar(start)?,
        };
        self.found.set(role, value)
    }

    /// The numbers behind the opening bracket.
    fn data_list(&mut self) -> Result<(), Reason> {
        let mut first = true;
        self.found.new_data();
        loop {
            let start = self.token()?;
            if first && start == b']' {
                return Ok(());
            }
            first = false;
            let Value::Number(number) = self.scalar(start)? else {
                return Err("data byte is not a number".into());
            };
            self.found.more_data().push_number(number)?;
            match self.token()? {
                b',' => {}
                b']' => return Ok(()),
                _ => return Err("no comma in a JSON list".into()),
            }
        }
    }

    /// A value that nobody asked for; `start` is its first byte.
    fn skip(&mut self, start: u8, depth: usize) -> Result<(), Reason> {
        match start {
            b'"' => self.string().map(drop),
            b'{' => self.nested(depth, |scanner, depth| scanner.object(None, depth)),
            b'[' => self.nested(depth, Self::list),
            _ => self.scalar(start).map(drop),
        }
    }

    fn list(&mut self, depth: usize) -> Result<(), Reason> {
        let mut first = true;
        loop {
            let start = self.token()?;
            if first && start == b']' {
                return Ok(());
            }
            first = false;
            self.skip(start, depth)?;
            match self.token()? {
                b',' => {}
                b']' => return Ok(()),
                _ => return Err("no comma in a JSON list".into()),
            }
        }
    }

    /// A number or a literal; `start` is its first byte.
    fn scalar(&mut self, start: u8) -> Result<Value<'static>, Reason> {
        self.at -= 1;
        let rest = &self.data[self.at..];
        let (value, used) = match start {
            b'0'..=b'9' | b'-' => {
                let (number, used) = number(rest).ok_or("not a JSON number")?;
                (Value::Number(number), used)
            }
            b't' if rest.starts_with(b"true") => (Value::Bool(true), 4),
            b'f' if rest.starts_with(b"false") => (Value::Bool(false), 5),
            b'n' if rest.starts_with(b"null") => (Value::Null, 4),
            _ => return Err("not a JSON value".into()),
        };
        self.at += used;
        Ok(value)
    }

    /// The string behind the opening quote: where it stands, and whether there are escapes in it.
    fn string(&mut self) -> Result<Span, Reason> {
        let start = self.at;
        let mut escaped = false;
        loop {
            match self.data.get(self.at) {
                Some(b'"') => break,
                Some(b'\\') => {
                    escaped = true;
                    self.at += 2;
                }
                Some(0..=0x1F) => return Err("control byte in a JSON string".into()),
                Some(_) => self.at += 1,
                None => return Err(ENDS_EARLY),
            }
        }
        self.at += 1;
        Ok((start, self.at - 1, escaped))
    }

    fn blanks(&mut self) {
        while let Some(b' ' | b'\n' | b'\r' | b'\t') = self.data.get(self.at) {
            self.at += 1;
        }
    }

    /// The next byte that is not blank, and a step past it.
    fn token(&mut self) -> Result<u8, Reason> {
        self.blanks();
        let token = *self.data.get(self.at).ok_or(ENDS_EARLY)?;
        self.at += 1;
        Ok(token)
    }
}

/// Start, end, and whether there are escapes.
type Span = (usize, usize, bool);

fn number(text: &[u8]) -> Option<(Decimal, usize)> {
    let mut value = 0_u64;
    let mut at = 0;
    while let Some(digit @ b'0'..=b'9') = text.get(at) {
        value = value.wrapping_mul(10).wrapping_add(u64::from(digit - b'0'));
        at += 1;
    }
    let plain = at > 0 && at <= FAST_DIGITS && !matches!(text.get(at), Some(b'.' | b'e' | b'E'));
    if plain && (text[0] != b'0' || at == 1) {
        return Some((i128::from(value).into(), at));
    }
    Decimal::read(text)
}
