//! Laws that hold for any text: every way to cut it gives the same rows, the fast path reads what
//! the readable one reads, every line is accounted for, and nothing panics. Texts are valid ones, then damaged.

use _native::candump::Candump;
use _native::counts::Counts;
use _native::events::Events;
use _native::frames::Frames;
use _native::simd::{scan, scan_scalar, Block, Template};
use _native::stamp::Stamps;

/// A small xorshift generator: the same cases in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 16
    }

    fn below(&mut self, limit: usize) -> usize {
        self.next() as usize % limit
    }

    fn pick<'a>(&mut self, choices: &[&'a str]) -> &'a str {
        choices[self.below(choices.len())]
    }

    fn hex(&mut self, bytes: usize) -> String {
        (0..bytes).map(|_| format!("{:02X}", self.next() as u8)).collect()
    }
}

#[derive(Debug, PartialEq, Eq)]
struct Outcome {
    frames: Frames,
    events: Events,
    buses: Vec<String>,
    counts: Counts,
    stamps: Stamps,
}

fn run<'a>(mut candump: Candump, chunks: impl Iterator<Item = &'a [u8]>) -> Outcome {
    let (mut frames, mut events) = (Frames::default(), Events::default());
    chunks.for_each(|chunk| candump.feed(chunk, &mut frames, &mut events));
    candump.finish(&mut frames, &mut events);
    let (counts, stamps) = (candump.counts(), candump.stamps());
    Outcome {
        frames,
        events,
        buses: candump.buses().to_vec(),
        counts,
        stamps,
    }
}

fn readable(text: &[u8]) -> Outcome {
    let outcome = run(Candump::readable(), std::iter::once(text));
    let Counts {
        lines,
        frames,
        error_frames,
        drops,
        comments,
        blank,
        unreadable,
        ..
    } = outcome.counts;
    assert_eq!(lines, text.split_inclusive(|&b| b == b'\n').count() as u64);
    assert_eq!(lines, frames + error_frames + drops + comments + blank + unreadable);
    assert_eq!(outcome.frames.len() as u64, frames);
    assert_eq!(
        outcome.events.len() as u64,
        error_frames + drops + comments + unreadable
    );
    assert!(outcome.events.text.iter().all(|b| (b' '..=b'~').contains(b)));
    outcome
}

/// A log as candump -l writes it, with everything the fast path takes and some neighbours that it does not.
fn log(random: &mut Random, lines: usize) -> Vec<u8> {
    let names = ["can0", "can0", "vcan0", "can1", "c", "a-name-of-15-ch", "can0:1"];
    let end = random.pick(&["\n", " R\n", " T\n", "\r\n"]);
    let digits = if random.below(2) == 0 { 6 } else { 9 };
    let mut second = random.below(2_000_000_000);
    let mut text = String::new();
    for _ in 0..lines {
        second += usize::from(random.below(20) == 0);
        let fraction = random.next() % 10_u64.pow(digits as u32);
        let name = names[random.below(names.len())];
        let (id, length) = (random.next() as u32 >> 3, random.below(9));
        let data = random.hex(length);
        let frame = match random.below(40) {
            0 => format!("{:03X}#{data}", id & 0x7FF),
            1 => format!("{id:08X}##{:X}{}", id & 15, random.hex(12)),
            2 => format!("{:08X}#{data}", id | 1 << 29),
            3 => format!("{id:08X}#R{}", random.pick(&["", "8"])),
            4 => format!("{id:08x}#{}", data.to_lowercase()),
            _ => format!("{id:08X}#{data}"),
        };
        let end = if random.below(30) == 0 { " R\n" } else { end };
        text += &format!("({second:010}.{fraction:0digits$}) {name} {frame}{end}");
    }
    text.into_bytes()
}

/// Every dialect in one text, shaped like captures found in the field.
const MIXED: &[u8] = b"  vcan0  0C8   [8]  F1 00 00 00 00 00 00 02\n  vcan0  064   [10]  F0 01 02 03 04 05 06 07 08 09\n\
 (000.000000)  vcan0  0C8   [2]  F1 00\n (002.047817)  vcan0  064   [0] \n# between\n (001.000001)  vcan0  1F4   [4]  01 02 03 04\n\
  vcan0  ERROR\n (2020-12-19 12:04:45.485261)  vcan0  0C8   [8]  F0 00 00 00 00 00 00 00\n\
 (2020-12-19 12:04:45.485261)  vcan0  20000004   [8]  \nvcan0  0C8   [1]  F0\n\
  vcan0  20000204   [8]  00 08 00 00 00 00 60 00   ERRORFRAME\n\tcontroller-problem{tx-error-warning}\n\terror-counter-tx-rx{{96}{0}}\n\
(1594172461.968006) vcan0 0C8#F000000000000000\n(1594172462.968006) vcan0 0C8#F000000000000000 T\r\n\
(1613656104.501098) can3 14C##155B5AA\n(1780715436.846782) vcan-0 123#0001020304050607\n(1752923603.673608) vcan0 00000123#R\n\
(1700000000.000000) can0 05040601#A63500000000009C R\n(1700000000.000180) can0 05040601#0000000000007C R\n\n\
Normal (000.002787)  can0  05040601   [8]  A6 35 00 00 00 00 00 9D\ncan2 00000904 [8] 00 00 00 00 00 00 00 29\n\
 (2024-12-11 09:27:19.445269)  can0  TX B -  077  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B\n\
(1613749650.388103)  can1       0AD  [08]  A6 55 3B CF 3F 1A F5 2A\nDROPCOUNT: dropped 5 CAN frames on 'can0' socket (total drops 12)\n\
\x1b[34m  can1  123   [8]  31 30 30 2E 35 20 46 4D   '100.5 FM'\x1b[0m\n  vcan0  00000123   [0]  remote request\n\
(1437593666.591990) can0 1001557A#21000000000000C1\n(1437593666.647853) can0 10015501#C5000000000000C5\n\
\0\xFF\xFE garbage\n(1752624000.000139) vcan0 0CFBFFDB#1B3120EBB3FFD9FF R\n  can0  123   [8]  01 02 0";

#[test]
fn every_way_to_cut_gives_the_same_rows() {
    let expected = readable(MIXED);
    let Counts {
        frames,
        error_frames,
        drops,
        comments,
        blank,
        unreadable,
        ..
    } = expected.counts;
    assert_eq!(
        (frames, error_frames, drops, comments, blank, unreadable),
        (23, 1, 1, 3, 1, 4)
    );
    assert!(expected.stamps.contains(Stamps::DELTA) && expected.stamps.contains(Stamps::DATE));
    for size in 1..=MIXED.len() {
        assert_eq!(run(Candump::new(), MIXED.chunks(size)), expected, "chunks of {size}");
    }
    let log = log(&mut Random(7), 60);
    let expected = readable(&log);
    for size in 1..=log.len() {
        assert_eq!(run(Candump::new(), log.chunks(size)), expected, "chunks of {size}");
    }
}

#[test]
fn a_line_too_long_is_the_same_however_it_is_cut() {
    for start in ["# comment ", "\t\x1b[1m", ""] {
        let text = [
            start.as_bytes(),
            &vec![b' '; 70_000],
            b"\n(1.000000) can0 123#\n",
            &vec![b'y'; 80_000],
        ]
        .concat();
        let expected = readable(&text);
        assert_eq!((expected.counts.unreadable, expected.counts.frames), (2, 1));
        for size in [1, 79, 80, 81, 82, 4096, 65_535, 65_536, 65_537, 69_999] {
            assert_eq!(run(Candump::new(), text.chunks(size)), expected, "chunks of {size}");
        }
    }
}

#[test]
fn the_fast_path_reads_valid_logs_like_the_readable_one() {
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    for _ in 0..100 {
        let text = log(&mut random, 1500);
        let expected = readable(&text);
        assert_eq!(expected.counts.unreadable, 0);
        let size = 1 + random.below(100_000);
        assert_eq!(run(Candump::new(), text.chunks(size)), expected);
    }
}

#[test]
fn the_fast_path_does_not_fall_for_lines_that_only_look_plain() {
    // Freed of one colour escape the first name is another one; text below an error frame ends with the next frame.
    let odd = b"(1.0) \x1b\x1b[1m[1mX 123#\n(1.0) can0 20000040#\n";
    let coloured = b"(1700000000.000000) \x1b[1mX 00000123#00\n".repeat(9);
    let error = b"(1.0) can0 20000040#\n";
    let plain = b"(1700000000.000000) can0 00000123#00\n".repeat(9);
    let text = [
        odd,
        &coloured[..],
        error,
        &plain,
        b"\tnot below an error frame\n# ",
        &[b'x'; 96],
        b"\n",
    ]
    .concat();
    let expected = readable(&text);
    assert_eq!(
        (expected.buses.as_slice(), expected.counts.unreadable),
        (&["\\x1b[1mX", "can0", "X"].map(String::from)[..], 1)
    );
    assert_eq!(run(Candump::new(), std::iter::once(&text[..])), expected);
}

#[test]
fn the_fast_path_reads_damaged_logs_like_the_readable_one() {
    let mut random = Random(0xDEAD_BEEF_CAFE_F00D);
    for case in 0..5000 {
        let mut text = if case % 4 == 0 {
            MIXED.to_vec()
        } else {
            log(&mut random, 30)
        };
        for _ in 0..=random.below(8) {
            let at = random.below(text.len());
            let byte = if random.below(2) == 0 {
                random.next() as u8
            } else {
                b"09aFgG#_. \r\n\t()[]RT\x1b"[random.below(20)]
            };
            match random.below(4) {
                0 => text[at] ^= 1 << random.below(8),
                1 => text[at] = byte,
                2 => text.insert(at, byte),
                _ => {
                    let end = text.len().min(at + 1 + random.below(4));
                    text.drain(at..end);
                }
            }
        }
        let expected = readable(&text);
        assert_eq!(run(Candump::new(), std::iter::once(&text[..])), expected, "case {case}");
        let size = 1 + random.below(text.len());
        assert_eq!(
            run(Candump::new(), text.chunks(size)),
            expected,
            "case {case}, chunks of {size}"
        );
    }
}

#[test]
fn nothing_panics_on_noise() {
    let mut random = Random(42);
    for _ in 0..2000 {
        let length = 1 + random.below(600);
        let alphabet = 2 + random.below(255);
        let noise: Vec<u8> = (0..length)
            .map(|_| (random.below(alphabet) as u8).wrapping_add(9))
            .collect();
        assert_eq!(run(Candump::new(), noise.chunks(97)), readable(&noise));
    }
}

/// What a scan gave: bytes used and rows.
fn scanned(scan: impl Fn(&[u8], &mut Template, &mut Block) -> usize, text: &[u8]) -> Vec<(usize, Frames)> {
    let mut template = Template::default();
    for (bus, name) in ["a#c", "can0", "vcan0", "can1", "c", "a-name-of-15-ch", "can0:1"]
        .iter()
        .enumerate()
    {
        template.learn(name.as_bytes(), bus as u8);
    }
    let (mut block, mut at, mut found) = (Block::default(), 0, vec![]);
    while at < text.len() {
        let used = scan(&text[at..], &mut template, &mut block);
        let mut frames = Frames::default();
        block.append_to(&mut frames, 1);
        found.push((used, frames));
        // Whatever stopped it, go on with the next line.
        let next = text[at + used..].iter().position(|&b| b == b'\n');
        at += used + next.map_or(text.len(), |end| end + 1);
    }
    found
}

#[test]
fn the_vector_code_does_what_its_scalar_twin_does() {
    let mut random = Random(0x0123_4567_89AB_CDEF);
    for case in 0..1500 {
        let mut text = log(&mut random, 40);
        for _ in 0..case % 5 {
            let at = random.below(text.len());
            text[at] = b"0fG#_. \r\n)RT\0\xFF/:@`"[random.below(18)];
        }
        assert_eq!(scanned(scan, &text), scanned(scan_scalar, &text), "case {case}");
    }
    let text = log(&mut random, 2000);
    let rows: usize = scanned(scan, &text).iter().map(|(_, frames)| frames.len()).sum();
    assert!(rows > 1500, "the fast path took {rows} of 2000 lines");
    assert_eq!(scanned(scan, &text), scanned(scan_scalar, &text));
    let text = b"(1700000000.000000) a#c 12345678#00\n".repeat(9);
    assert_eq!(scanned(scan, &text), scanned(scan_scalar, &text));
}
