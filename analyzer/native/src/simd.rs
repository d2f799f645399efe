//! The fast path: plain log lines of classic frames with 29-bit identifiers, as `candump -l` writes them.
//!
//! `(1436509052.249713) vcan0 1F040A05#2A366C2BBA` with 6 or 9 digits of fraction, ending in `\n`, `\r\n`, ` R\n` or
//! ` T\n`. It takes lines as long as they look like this and says how far it came; every other line is the readable
//! path's. Beside `receive/system.rs` it is the only file of the core with `unsafe`: unaligned loads from arrays, and the
//! call of code for processor features that were checked. Advice to those who change it: `twin.rs` must change in the
//! same way.
#![deny(unsafe_op_in_unsafe_fn)]

mod block;
mod template;
mod twin;

pub use block::Block;
pub use template::Template;

/// Bytes that must follow the start of a line: more than the longest plain line, so that no load looks past the text.
const ROOM: usize = 96;

/// Fills `block` with the plain lines that `text` starts with and returns how many bytes they take.
pub fn scan(text: &[u8], template: &mut Template, block: &mut Block) -> usize {
    let digits = digits(text);
    block.clear(digits);
    #[cfg(target_arch = "x86_64")]
    if std::is_x86_feature_detected!("avx2")
        && std::is_x86_feature_detected!("bmi1")
        && std::is_x86_feature_detected!("bmi2")
    {
        // SAFETY: the processor has the three features that the functions are compiled for.
        return unsafe {
            match digits {
                6 => avx2::lines::<6>(text, template, block),
                9 => avx2::lines::<9>(text, template, block),
                _ => 0,
            }
        };
    }
    scan_scalar(text, template, block)
}

/// [`scan`] without vector instructions: the same lines, the same result.
pub fn scan_scalar(text: &[u8], template: &mut Template, block: &mut Block) -> usize {
    let digits = digits(text);
    block.clear(digits);
    if digits == 0 {
        0
    } else {
        twin::lines(text, digits, template, block)
    }
}

/// Digits of the fraction in the first line: 6, 9, or 0 for a line of another shape.
fn digits(text: &[u8]) -> usize {
    match text.first_chunk::<ROOM>() {
        Some(line) if line[0] == b'(' && line[template::HEAD + 6] == b')' => 6,
        Some(line) if line[0] == b'(' && line[template::HEAD + 9] == b')' => 9,
        _ => 0,
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{
        __m128i, __m256i, _mm256_blendv_epi8, _mm256_castsi256_si128, _mm256_cmpeq_epi8, _mm256_extracti128_si256,
        _mm256_loadu_si256, _mm256_maddubs_epi16, _mm256_max_epu8, _mm256_min_epu8, _mm256_movemask_epi8,
        _mm256_or_si256, _mm256_packus_epi16, _mm256_set1_epi16, _mm256_set1_epi8, _mm256_set_m128i, _mm256_sub_epi8,
        _mm_cmpeq_epi8, _mm_cvtsi128_si32, _mm_cvtsi128_si64, _mm_loadu_si128, _mm_movemask_epi8,
    };

    use super::block::{Block, Row};
    use super::template::{Template, HEAD, MAX_WIDTH, MIN_WIDTH};
    use super::ROOM;
    use crate::frames::{EXTENDED, RX, TX};

    /// Any width fits, so that no load has to be checked.
    const WIDTHS: usize = 31;
    const _: () = assert!(MAX_WIDTH <= WIDTHS && HEAD + 9 + 8 + WIDTHS + 1 + 32 <= ROOM);
    const SUFFIX_RX: u16 = u16::from_le_bytes(*b" R");
    const SUFFIX_TX: u16 = u16::from_le_bytes(*b" T");

    #[target_feature(enable = "avx2,bmi1,bmi2")]
    pub(super) fn lines<const DIGITS: usize>(text: &[u8], template: &mut Template, block: &mut Block) -> usize {
        let mut start = 0;
        let (mut head, mut width) = (load16(&template.head), template.likely_width());
        while let Some(line) = text[start..].first_chunk() {
            if block.is_full() {
                break;
            }
            let same = _mm_movemask_epi8(_mm_cmpeq_epi8(load16(part(line, 0)), head));
            if same & 0xFFF != 0xFFF {
                if !template.next_second(line) {
                    break;
                }
                head = load16(&template.head);
            }
            let Some((row, length)) = decode::<DIGITS>(line, template, &mut width) else {
                break;
            };
            block.push(&row);
            start += length;
        }
        start
    }

    /// One line and its length with the line end. The length depends on one search only, so that the processor can
    /// begin the next line while this one is decoded. `width` is that of the line before, and becomes that of this one.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2")]
    fn decode<const DIGITS: usize>(line: &[u8; ROOM], template: &Template, width: &mut usize) -> Option<(Row, usize)> {
        let close = HEAD + DIGITS;
        if line[close + 8 + (*width & WIDTHS)] != b'#' {
            *width = measure(line, close)?;
        }
        let width = *width & WIDTHS;
        let hash = close + 8 + width;
        let behind = load32(part(line, hash + 1));
        let newline = _mm256_cmpeq_epi8(behind, _mm256_set1_epi8(b'\n' as i8));
        let newline = hash + 1 + (_mm256_movemask_epi8(newline) as u32).trailing_zeros() as usize;

        let mut shape = template.guess(width, line[hash - 10]);
        let prefix = _mm256_cmpeq_epi8(load32(part(line, close)), load32(&shape.text));
        let unlike = !(_mm256_movemask_epi8(prefix) as u32) & ((1 << width) - 1);
        if unlike != 0 || shape.width != width {
            shape = template.find(&line[close..], width)?;
        }

        // The identifier in the low half, the data in the high half.
        let text = _mm256_set_m128i(_mm256_castsi256_si128(behind), load16(part(line, hash - 8)));
        let (nibbles, is_hex) = nibbles(text);
        let pairs = _mm256_maddubs_epi16(nibbles, _mm256_set1_epi16(0x0110));
        let packed = _mm256_packus_epi16(pairs, pairs);
        let id = (_mm_cvtsi128_si32(_mm256_castsi256_si128(packed)) as u32).swap_bytes();
        let data = _mm_cvtsi128_si64(_mm256_extracti128_si256::<1>(packed)) as u64;
        let hex = (!(is_hex >> 16)).trailing_zeros() as usize;

        let end = hash + 1 + hex;
        let suffix = u16::from_le_bytes(*part(line, end));
        let direction = match newline.wrapping_sub(end) {
            0 => 0,
            1 if suffix as u8 == b'\r' => 0,
            2 if suffix == SUFFIX_RX => RX,
            2 if suffix == SUFFIX_TX => TX,
            _ => return None,
        };
        let (fraction, damage) = fraction::<DIGITS>(line);
        if damage | u64::from(!is_hex & 0xFF) | u64::from(id >> 29) | (hex as u64 & 1) != 0 {
            return None;
        }
        let (ns, flags) = (template.second_ns + fraction, EXTENDED | direction);
        Some((
            Row {
                ns,
                bus: shape.bus,
                id,
                flags,
                data,
                len: hex / 2,
            },
            newline + 1,
        ))
    }

    /// Nanoseconds of the fraction, and 0 when it was nothing but digits.
    #[inline]
    fn fraction<const DIGITS: usize>(line: &[u8; ROOM]) -> (i64, u64) {
        // Six digits are read as eight with two leading zeros.
        let word = u64::from_le_bytes(*part(line, HEAD - if DIGITS == 6 { 2 } else { 0 }));
        let word = if DIGITS == 6 { word >> 16 << 16 | 0x3030 } else { word };
        let digits = word.wrapping_sub(0x3030_3030_3030_3030);
        let damage = (digits.wrapping_add(0x7676_7676_7676_7676) | digits) & 0x8080_8080_8080_8080;
        let pairs = digits.wrapping_mul(10).wrapping_add(digits >> 8);
        let even = (pairs & 0x0000_00FF_0000_00FF).wrapping_mul(100 + (1_000_000 << 32));
        let odd = (pairs >> 16 & 0x0000_00FF_0000_00FF).wrapping_mul(1 + (10_000 << 32));
        let value = i64::from((even.wrapping_add(odd) >> 32) as u32);
        if DIGITS == 6 {
            return (value * 1000, damage);
        }
        let last = line[HEAD + 8].wrapping_sub(b'0');
        (value * 10 + i64::from(last), damage | u64::from(last > 9))
    }

    /// The value of each hex digit, and a bit for each byte that is one.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn nibbles(text: __m256i) -> (__m256i, u32) {
        let digit = _mm256_sub_epi8(text, _mm256_set1_epi8(b'0' as i8));
        let is_digit = _mm256_cmpeq_epi8(_mm256_min_epu8(digit, _mm256_set1_epi8(9)), digit);
        let lower = _mm256_or_si256(text, _mm256_set1_epi8(0x20));
        let letter = _mm256_sub_epi8(lower, _mm256_set1_epi8((b'a' - 10) as i8));
        let in_range = _mm256_max_epu8(_mm256_min_epu8(letter, _mm256_set1_epi8(15)), _mm256_set1_epi8(10));
        let is_letter = _mm256_cmpeq_epi8(in_range, letter);
        let is_hex = _mm256_movemask_epi8(_mm256_or_si256(is_digit, is_letter)) as u32;
        (_mm256_blendv_epi8(letter, digit, is_digit), is_hex)
    }

    /// Bytes between time stamp and identifier, by the first `#`.
    #[cold]
    #[inline(never)]
    fn measure(line: &[u8; ROOM], close: usize) -> Option<usize> {
        let hash = line.iter().position(|&b| b == b'#')?;
        hash.checked_sub(close + 8)
            .filter(|width| (MIN_WIDTH..=MAX_WIDTH).contains(width))
    }

    #[inline]
    fn part<const N: usize>(line: &[u8; ROOM], at: usize) -> &[u8; N] {
        line[at..]
            .first_chunk()
            .expect("the parts of a line end before its room does")
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn load16(bytes: &[u8; 16]) -> __m128i {
        // SAFETY: 16 bytes can be read, and the load needs no alignment.
        unsafe { _mm_loadu_si128(bytes.as_ptr().cast()) }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn load32(bytes: &[u8; 32]) -> __m256i {
        // SAFETY: 32 bytes can be read, and the load needs no alignment.
        unsafe { _mm256_loadu_si256(bytes.as_ptr().cast()) }
    }
}
