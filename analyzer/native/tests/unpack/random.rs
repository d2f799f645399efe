//! Random plans and payloads. Own generator, so that every run sees the same ones.

use _native::plan::Token;

pub struct Random(pub u64);

impl Random {
    /// xorshift64*
    pub fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    pub fn below(&mut self, bound: u32) -> u32 {
        (((self.next() >> 32) * u64::from(bound)) >> 32) as u32
    }

    pub fn bytes(&mut self, len: u32) -> Vec<u8> {
        // Zeros now and then, so that clean padding and small counts occur.
        let mask = [0xFF, 0xFF, 0x0F, 0x00][self.below(4) as usize];
        (0..len).map(|_| (self.next() >> 56) as u8 & mask).collect()
    }

    pub fn plan(&mut self) -> Vec<Token> {
        let mut out = vec![];
        self.compound(&mut out, 0);
        out
    }

    fn compound(&mut self, out: &mut Vec<Token>, depth: u32) {
        if self.below(5) == 0 {
            let members = 1 + self.below(5);
            // A bit more than is needed leaves tags without a member.
            let tag = (32 - (members - 1).leading_zeros()).max(1) + self.below(2);
            out.push(("union".into(), members, tag));
            (0..members).for_each(|_| self.field(out, depth + 1, false));
        } else {
            // An element must not be empty.
            let fields = self.below(6).max(u32::from(depth > 0));
            out.push(("struct".into(), fields, 0));
            (0..fields).for_each(|_| self.field(out, depth + 1, true));
        }
    }

    fn field(&mut self, out: &mut Vec<Token>, depth: u32, void: bool) {
        let kinds = if depth > 4 { 5 } else { 9 };
        match self.below(kinds) {
            0 if void => out.push(("void".into(), 1 + self.below(20), 0)),
            0 | 1 => out.push(("bool".into(), 1, 0)),
            2 => out.push(("float".into(), 16 << self.below(3), 0)),
            kind @ (3 | 4) => {
                let bits = match self.below(3) {
                    0 => 8 << self.below(4),
                    1 => 1 + self.below(8),
                    _ => 1 + self.below(64),
                };
                out.push((["uint", "int"][kind as usize - 3].into(), bits, 0));
            }
            5 => {
                out.push(("array".into(), 1 + self.below(4), 0));
                self.field(out, depth + 1, false);
            }
            6 | 7 => {
                let max = 1 + self.below(9);
                out.push(("list".into(), max, 32 - max.leading_zeros()));
                self.field(out, depth + 1, false);
            }
            _ => self.compound(out, depth + 1),
        }
    }
}
