"""MCAP files of every shape that the format allows, those of the public conformance suite, made anew, are valid."""

from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING
from zlib import crc32

import pytest
from kit.mcaps import cut, from_file, from_pieces
from mcap.opcode import Opcode

from analyzer.sources import Source
from analyzer.sources.mcap import summary
from analyzer.sources.mcap.records import MAGIC

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

PADDING = b"\x01\xff\xff"  # behind the fields, of whatever may become longer
TIMES = (0, 2, 1, 3, 3, 5, 4, 7, 8, 9)
# Parts of a file, as the suite's names have them: attachment index, chunk, chunk index, metadata index, message index,
# padding, repeated channels, repeated schemas, statistics, summary offsets.
PARTS = ("ax", "ch", "chx", "mdx", "mx", "pad", "rch", "rsh", "st", "sum")
_GROUPS = {"rsh": 3, "rch": 4, "st": 11, "mdx": 13, "ax": 10, "chx": 8}

Record = tuple[int, bytes]


def number(size: int, *values: int) -> bytes:
    return b"".join(value.to_bytes(size, "little") for value in values)


def string(text: bytes) -> bytes:
    return number(4, len(text)) + text


def pairs(**values: str) -> bytes:
    return string(b"".join(string(one.encode()) for pair in values.items() for one in pair))


def message(sequence: int, log_time: int, publish_time: int) -> Record:
    return Opcode.MESSAGE, number(2, 1) + number(4, sequence) + number(8, log_time, publish_time) + b"\1\2\3"


SCHEMA: Record = Opcode.SCHEMA, number(2, 1) + string(b"Example") + string(b"c") + string(b"\4\5\6")
CHANNEL: Record = Opcode.CHANNEL, number(2, 1, 1) + string(b"example") + string(b"a") + pairs(foo="bar")
BARE: Record = Opcode.CHANNEL, number(2, 1, 0) + string(b"example") + string(b"text") + pairs()
ATTACHED = number(8, 2, 1) + string(b"myFile") + string(b"application/octet-stream") + number(8, 3) + b"\1\2\3"
INPUTS: dict[str, tuple[Record, ...]] = {
    "NoData": (),
    "OneSchemalessMessage": (BARE, message(10, 2, 1)),
    "OneMessage": (SCHEMA, CHANNEL, message(10, 2, 1)),
    "OneAttachment": ((Opcode.ATTACHMENT, ATTACHED + number(4, crc32(ATTACHED))),),
    "OneMetadata": ((Opcode.METADATA, string(b"myMetadata") + pairs(foo="bar")),),
    "TenMessages": (SCHEMA, CHANNEL, *(message(k, t, t) for k, t in enumerate(TIMES))),
}
_FIXED = frozenset({Opcode.FOOTER, Opcode.MESSAGE, Opcode.CHUNK, Opcode.DATA_END})  # never padded


@dataclass(frozen=True)
class Variant:
    """A file of the suite; `messages` are in it."""

    name: str
    records: tuple[Record, ...]
    parts: frozenset[str]

    @property
    def messages(self) -> int:
        return sum(opcode == Opcode.MESSAGE for opcode, _ in self.records)

    def data(self, padding: bytes = PADDING, footer: bytes = b"") -> bytes:
        """The file; `footer` stands behind the fields of the footer."""
        return _File(self, padding if "pad" in self.parts else b"").data(footer)


def variants() -> Iterator[Variant]:
    """All 416."""
    for name, records in INPUTS.items():
        for count in range(len(PARTS) + 1):
            for parts in combinations(PARTS, count):
                if _sensible(frozenset(parts), {opcode for opcode, _ in records}):
                    yield Variant("-".join([name, *parts]), records, frozenset(parts))


def _sensible(parts: frozenset[str], kinds: set[int]) -> bool:
    needs: dict[str, Callable[[], bool]] = {
        "ax": lambda: Opcode.ATTACHMENT in kinds,
        "mdx": lambda: Opcode.METADATA in kinds,
        "rsh": lambda: Opcode.SCHEMA in kinds,
        "rch": lambda: Opcode.CHANNEL in kinds,
        "ch": lambda: bool(kinds & {Opcode.MESSAGE, Opcode.CHANNEL, Opcode.SCHEMA}),
        "chx": lambda: "ch" in parts,
        "mx": lambda: "ch" in parts,
        "sum": lambda: bool(parts & _GROUPS.keys()),
    }
    return all(needs[part]() for part in parts if part in needs)


class _File:
    """One file under way."""

    def __init__(self, variant: Variant, padding: bytes) -> None:
        self._parts, self._records, self._padding = variant.parts, variant.records, padding
        self._out = bytearray(MAGIC)

    def data(self, footer: bytes) -> bytes:
        self._write(Opcode.HEADER, string(b"") + string(b""))
        indexes: dict[str, list[Record]] = {part: [] for part in _GROUPS}
        chunked = [one for one in self._records if one[0] not in {Opcode.ATTACHMENT, Opcode.METADATA}]
        for one in self._records:
            if "ch" in self._parts and one in chunked:
                continue
            at = len(self._out)
            self._write(*one)
            where = number(8, at, len(self._out) - at)
            if one[0] == Opcode.ATTACHMENT:
                body = where + number(8, 2, 1, 3) + string(b"myFile") + string(b"application/octet-stream")
                indexes["ax"].append((Opcode.ATTACHMENT_INDEX, body))
            elif one[0] == Opcode.METADATA:
                indexes["mdx"].append((Opcode.METADATA_INDEX, where + string(b"myMetadata")))
        if "ch" in self._parts:
            indexes["chx"].append(self._chunk(chunked))
        self._write(Opcode.DATA_END, number(4, crc32(self._out)))
        indexes["rsh"] = [one for one in self._records if one[0] == Opcode.SCHEMA]
        indexes["rch"] = [one for one in self._records if one[0] == Opcode.CHANNEL]
        indexes["st"] = [self._statistics()]
        self._summary(indexes, footer)
        return bytes(self._out)

    def _write(self, opcode: int, body: bytes) -> None:
        body += b"" if opcode in _FIXED else self._padding
        self._out += struct.pack("<BQ", opcode, len(body)) + body

    def _times(self) -> tuple[int, int]:
        times = [struct.unpack_from("<Q", body, 6)[0] for opcode, body in self._records if opcode == Opcode.MESSAGE]
        return min(times, default=0), max(times, default=0)

    def _chunk(self, records: Sequence[Record]) -> Record:
        """Write it, and return its index."""
        inside, offsets, at = bytearray(), bytearray(), len(self._out)
        for opcode, body in records:
            if opcode == Opcode.MESSAGE:
                offsets += body[6:14] + number(8, len(inside))
            inside += struct.pack("<BQ", opcode, len(body)) + body
        start, end = self._times()
        sizes = number(8, len(inside))
        fields = number(8, start, end) + sizes + number(4, crc32(inside))
        self._write(Opcode.CHUNK, fields + string(b"") + sizes + inside)
        behind = len(self._out)
        if "mx" in self._parts:
            self._write(Opcode.MESSAGE_INDEX, number(2, 1) + string(bytes(offsets)))
        indexed = string((number(2, 1) + number(8, behind)) if "mx" in self._parts else b"")
        length = number(8, len(self._out) - behind)
        fields = number(8, start, end, at, behind - at) + indexed + length + string(b"") + sizes + sizes
        return Opcode.CHUNK_INDEX, fields

    def _statistics(self) -> Record:
        kinds = [opcode for opcode, _ in self._records]
        counts = [kinds.count(one) for one in (Opcode.CHANNEL, Opcode.ATTACHMENT, Opcode.METADATA)] + [
            int("ch" in self._parts)
        ]
        messages = kinds.count(Opcode.MESSAGE)
        of_channel = number(2, 1) + number(8, messages) if messages else b""
        fields = number(8, messages) + number(2, kinds.count(Opcode.SCHEMA)) + number(4, *counts)
        return Opcode.STATISTICS, fields + number(8, *self._times()) + string(of_channel)

    def _summary(self, groups: dict[str, list[Record]], footer: bytes) -> None:
        begin, offsets = len(self._out), []
        for part, opcode in _GROUPS.items():
            at = len(self._out)
            for one in groups[part] if part in self._parts else ():
                self._write(*one)
            if len(self._out) > at:
                offsets.append(number(1, opcode) + number(8, at, len(self._out) - at))
        behind = len(self._out)
        for body in offsets if "sum" in self._parts else ():
            self._write(Opcode.SUMMARY_OFFSET, body)
        start = begin if behind > begin else 0
        fields = number(8, start, behind if "sum" in self._parts else 0)
        # The checksum of the summary takes in the footer up to itself.
        head = struct.pack("<BQ", Opcode.FOOTER, 20 + len(footer)) + fields
        self._out += head + number(4, crc32(self._out[begin:] + head)) + footer + MAGIC


# Of files of the suite, as its repository states them.
DIGESTS = {
    "NoData": "f720b819f6ca7330",
    "OneAttachment-ax-pad-st-sum": "37faf0439dcf55de",
    "OneMetadata-mdx-pad-sum": "443c8f2490bd07cc",
    "TenMessages-ch-chx-mx-pad-rch-rsh-st-sum": "358413d53e6fb275",
}
# Behind the fields of a footer, and of whatever else may have more.
FOOTERS, PADDINGS = (b"", b"\1\xff\xff", b"y" * 300), (b"\1\xff\xff", b"\0" * 200, bytes(range(1, 16)) * 300)


def test_they_are_those_of_the_suite() -> None:
    made = {one.name: one for one in variants()}
    assert len(made) == 416
    for name, digest in DIGESTS.items():
        assert hashlib.sha256(made[name].data()).hexdigest().startswith(digest), name


def test_all_of_them_are_valid() -> None:
    for one in variants():
        got = from_pieces([one.data()])
        assert (got.told, got.lines["other"]) == (False, one.messages), one.name


@pytest.mark.slow
@pytest.mark.parametrize("footer", FOOTERS, ids=len)
def test_all_of_them_are_valid_however_they_come(footer: bytes) -> None:
    for one in variants():
        data = one.data(footer=footer)
        got = from_pieces([data])
        assert (got.told, got.lines["other"]) == (False, one.messages), one.name
        if "pad" in one.parts:
            assert from_pieces(cut(data, 1)) == got, one.name


@pytest.mark.slow
@pytest.mark.parametrize("padding", PADDINGS, ids=len)
def test_however_much_stands_behind_the_fields(padding: bytes) -> None:
    for one in variants():
        if "pad" in one.parts and "st" in one.parts:
            got = from_pieces(cut(one.data(padding, padding), 999))
            assert (got.told, got.lines["other"]) == (False, one.messages), one.name


@pytest.mark.slow
def test_padded_definitions_in_a_row_and_large_ones() -> None:
    channels = [(Opcode.CHANNEL, number(2, k) + CHANNEL[1][2:]) for k in range(2, 30)]
    attached = b"x" * 20_000_000
    body = number(8, 0, 0) + number(4, 0, 0) + number(8, len(attached)) + attached + number(4, 0)
    records = (*INPUTS["OneMessage"], *channels, (Opcode.ATTACHMENT, body), message(11, 3, 3))
    for parts in ({"pad", "rch", "sum"}, {"pad", "ch", "st"}):
        one = Variant("many", records, frozenset(parts))
        got = from_pieces(cut(one.data(), 1 << 20))
        assert (got.told, got.lines["other"]) == (False, 2)


def test_a_longer_footer_leads_to_the_definitions(tmp_path: Path) -> None:
    (one,) = (one for one in variants() if one.name == "OneMessage-pad-rch-rsh")
    for footer in FOOTERS:
        got = from_file(tmp_path / "x.mcap", one.data(footer=footer))
        assert not got.told
        assert len(summary.read(Source(str(tmp_path / "x.mcap")), lambda: True)) == 2


def test_a_wrong_length_is_no_padding() -> None:
    """One changed byte in the length of a channel: it ends where a later message begins, and swallows none."""
    (one,) = (one for one in variants() if one.name == "TenMessages-st")
    data = bytearray(one.data())
    at = data.index(bytes([Opcode.CHANNEL]) + number(8, len(CHANNEL[1]))) + 1
    step = len(message(0, 0, 0)[1]) + 9
    data[at : at + 8] = number(8, len(CHANNEL[1]) + 3 * step)
    assert from_pieces([bytes(data)]).told


def test_a_padded_file_that_is_cut_says_so() -> None:
    (one,) = (one for one in variants() if one.name == "TenMessages-pad-rch-rsh-st-sum")
    data = one.data()
    for size in range(8, len(data)):
        got = from_pieces([data[:size]])
        assert got.damage.startswith(f"byte {size}: MCAP data ends early"), size
        assert not got.texts, size
