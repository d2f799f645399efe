"""Proofs of TYP-001 to TYP-012: payloads against the layout of their type."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from kit import encode

from witness.views import Finder, Float, Found, Message, by_node, everything, messages, prefixed, where

if TYPE_CHECKING:
    from collections.abc import Iterator

    from witness.reader import Log

# 14 bits a channel, 0 to 20 channels, filled up to whole bytes.
RAW_COMMAND_LENGTHS = {(14 * channels + 7) // 8 for channels in range(21)}


@cache
def bits(layout: str, tail: bool, most: bool) -> int:
    """The fewest or the most bits of a record; `tail`: its last array may stand without its length."""
    union, fields = encode.parse(layout)
    sizes = []
    for at, (_, base, size, how) in enumerate(fields):
        last = tail and (union or at == len(fields) - 1)
        bare = last and how == "dynamic" and encode.min_bits(base) >= 8
        items = (size if most or how == "static" else 0) if how else 1
        length = size.bit_length() if how == "dynamic" and not bare else 0
        ends = [last and not bare and item == items - 1 for item in range(items)]
        sizes.append(length + sum(_bits(base, end, most) for end in ends))
    if union:
        return (len(fields) - 1).bit_length() + (max if most else min)(sizes)
    return sum(sizes)


def _bits(base: str, tail: bool, most: bool) -> int:
    return bits(encode.RECORDS[base], tail, most) if base in encode.RECORDS else int(base[1:])


def _limit(one: Message, most: bool) -> int:
    """Bytes that its type has at least or at most."""
    return (bits(encode.TYPES[one.name].layout, not one.transfer.first.fd, most) + 7) // 8


def _all(log: Log, wrong: Any) -> Found:
    return [one.numbers for one in everything(log) if wrong(one)]


def shorter(log: Log) -> Found:
    """TYP-001: fewer bytes than the fewest of the type."""
    return _all(log, lambda one: len(one.payload) < _limit(one, most=False))


def longer(log: Log) -> Found:
    """TYP-002: on classic CAN, more bytes than the most of the type."""
    return _all(log, lambda one: not one.transfer.first.fd and len(one.payload) > _limit(one, most=True))


def padding(log: Log) -> Found:
    """TYP-003: a bit behind the last field, in its byte, is set."""
    return _all(log, lambda one: len(one.fields.rest) < 8 and "1" in one.fields.rest)


def leftover(log: Log) -> Found:
    """TYP-004: the bytes are no whole number of elements."""

    def wrong(one: Message) -> bool:
        if one.transfer.first.fd or one.fields.tag is not None or prefixed(one):
            return False
        if one.name == "RawCommand":
            return len(one.payload) not in RAW_COMMAND_LENGTHS
        _, base, _, how = (encode.parse(encode.TYPES[one.name].layout)[1] or [("", "", 0, "")])[-1]
        return how == "dynamic" and encode.min_bits(base) >= 8 and len(one.fields.rest) >= 8

    return _all(log, wrong)


def too_many(log: Log) -> Found:
    """TYP-005: an array has more elements than its type allows."""

    def wrong(one: Message) -> bool:
        fields = encode.parse(encode.TYPES[one.name].layout)[1]
        return not prefixed(one) and any(
            how == "dynamic" and len(one.values.get(name, ())) > size for name, _, size, how in fields
        )

    return _all(log, wrong)


def prefix(log: Log) -> Found:
    """TYP-006: the length of the last array stands before it."""
    return _all(log, prefixed)


def floats(value: Any) -> Iterator[Float]:
    """All floating point numbers in a value."""
    if isinstance(value, Float):
        yield value
    elif isinstance(value, (dict, list)):
        for part in value.values() if isinstance(value, dict) else value:
            yield from floats(part)


def special(number: Float) -> str:
    """nan, inf or nothing, from the bits: an exponent of ones with or without a mantissa."""
    mantissa = {16: 10, 32: 23, 64: 52}[number.width]
    top = (1 << number.width - 1 - mantissa) - 1
    if number.code >> mantissa & top != top:
        return ""
    return "nan" if number.code & (1 << mantissa) - 1 else "inf"


def not_a_number(log: Log) -> Found:
    """TYP-007: a float field holds a NaN."""
    return _all(log, lambda one: any(special(number) == "nan" for number in floats(one.values)))


def infinity(log: Log) -> Found:
    """TYP-008: a float field holds an infinity."""
    return _all(log, lambda one: any(special(number) == "inf" for number in floats(one.values)))


def coarse(log: Log) -> Found:
    """TYP-009: no float16 of a node in 50 transfers or more has one of its low 3 bits set."""
    found = []
    for sent in by_node(log, "ESCStatus").values():
        codes = [number.code for one in sent for number in floats(one.values)]
        if len(sent) >= 50 and any(codes) and not any(code & 7 for code in codes):
            found.append(set().union(*(one.numbers for one in sent)))
    return found


def low_bits_first(log: Log) -> Found:
    """TYP-010: the padding of 1034 is not zero, but is when its last 32 bits are read as a little-endian word."""

    def wrong(one: Message) -> bool:
        word = int.from_bytes(one.payload[10:14], "little")
        rpm = (word & 0x3FFFF) - (word << 1 & 0x40000)
        plausible = abs(rpm) <= 100_000 and word >> 18 & 0x7F <= 100 and word >> 25 & 0x1F <= 19
        return bool(one.payload[13] & 3) and not word >> 30 and plausible

    return where(log, ("ESCStatus",), wrong)


def union_tag(log: Log) -> Found:
    """TYP-011: a union's tag names no member."""
    return _all(log, lambda one: one.fields.tag is not None)


def void_bits(log: Log) -> Found:
    """TYP-012: a void field is not zero."""
    return _all(log, lambda one: any(one.fields.voids))


def negative(log: Log) -> Found:
    """TYP-101: a channel asks for negative throttle."""
    return where(log, ("RawCommand",), lambda one: any(value < 0 for value in one["cmd"]))


def beyond(log: Log) -> Found:
    """TYP-102: a channel has the one value that 14 bits hold and the document does not."""
    return where(log, ("RawCommand",), lambda one: -8192 in one["cmd"])


def channels(log: Log) -> Found:
    """TYP-103: the channels are not as many as the highest index that reports, plus one."""
    indices = [one["esc_index"] for one in messages(log, "ESCStatus")]
    if not indices:
        return []
    return where(log, ("RawCommand",), lambda one: len(one["cmd"]) != max(indices) + 1)


def no_channels(log: Log) -> Found:
    """TYP-104: a RawCommand without a byte of payload."""
    return where(log, ("RawCommand",), lambda one: not one.payload)


def words(log: Log) -> Found:
    """TYP-105: one 16-bit word with its top 2 bits cut off and 5 zeros, where 4 channels of 14 bits belong.

    Read as 14 bits, the low 2 bits of the word's high byte come out times 64 in the second channel.
    """

    def wrong(one: Message) -> bool:
        word = int.from_bytes(one.payload[:2], "little")
        return (
            not one.transfer.many
            and len(one.payload) == 7
            and not any(one.payload[2:])
            and 0 < word <= 8191
            and one["cmd"][1] == (word >> 8 & 3) * 64 != 0
        )

    return where(log, ("RawCommand",), wrong) + _arrays(log)


def _arrays(log: Log) -> Found:
    """Eight commands of a sender in a row that are 16-bit throttles, and that 14 bits do not explain."""
    found: Found = []
    rows: dict[int, list[Message]] = {}
    for one in messages(log, "RawCommand"):
        row = rows.setdefault(one.src, [])
        size = len(one.payload)
        fits = size and not size % 2 and all(abs(value) <= 8191 for value in memoryview(one.payload).cast("h"))
        row[:] = [*row, one] if fits and (size in {8, 10, 12} and one.payload[-1]) else []
        if len(row) >= 8:
            found += [each.numbers for each in (row if len(row) == 8 else row[-1:])]
    return found


FINDERS: dict[str, Finder] = {
    "TYP-001": shorter,
    "TYP-002": longer,
    "TYP-003": padding,
    "TYP-004": leftover,
    "TYP-005": too_many,
    "TYP-006": prefix,
    "TYP-007": not_a_number,
    "TYP-008": infinity,
    "TYP-009": coarse,
    "TYP-010": low_bits_first,
    "TYP-011": union_tag,
    "TYP-012": void_bits,
    "TYP-101": negative,
    "TYP-102": beyond,
    "TYP-103": channels,
    "TYP-104": no_channels,
    "TYP-105": words,
}
