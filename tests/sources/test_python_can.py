"""Formats that python-can reads: what its own writers write comes back, less what each format cannot hold."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st
from kit.encode import DLC_LENGTHS
from kit.libraries import TEXT, WRITERS, frames, library_file, pieces_of, total
from kit.rows import BRS, ESI, EXTENDED, FD, REMOTE, RX, TX, Fault, Frame, Record, events, records
from kit.strategies import examples

from analyzer._native import FrameBatch
from analyzer.sources import Source
from analyzer.sources.formats import detect

if TYPE_CHECKING:
    from pathlib import Path

T0 = 1_700_000_000_000_000_000
US = 1000
BUS_ERROR = 0x80
ALL = tuple(WRITERS)
SAMPLE: list[Record] = [
    Frame(T0, "can0", 0x05040601, EXTENDED | RX, bytes.fromhex("A63500000000009C")),
    Frame(T0 + 180 * US, "can1", 0x123, TX, b""),
    Frame(T0 + 2_787 * US, "can0", 0x7FF, REMOTE | RX, b"", 5),
    Fault(T0 + 3_000 * US, "can1", 4, bytes([0, 4, 0, 0, 0, 0, 0, 0]), TX),
    Frame(T0 + 1_000_000 * US, "can0", 0x1FFFFFFF, EXTENDED | FD | BRS | ESI | TX, bytes(range(64))),
    Frame(T0 + 1_000_001 * US, "can3", 0, FD | RX, b""),
]


def kept(suffix: str, record: Record, start: int) -> Record | None:
    """What is left of it in a format, as the README says."""
    t = record.t if suffix != ".asc" else record.t - start
    if isinstance(record, Fault):
        if suffix == ".trc":
            return None
        known = suffix in (".csv", ".blf")
        bus = "can0" if suffix == ".csv" else record.bus
        way = record.flags if suffix == ".mf4" else 0
        return Fault(t, bus, record.error if known else BUS_ERROR, record.data if known else b"", way)
    if suffix == ".trc" and record.flags & (FD | REMOTE):
        return None
    if suffix == ".csv":
        flags = record.flags & ~(RX | TX | FD | BRS | ESI) | (FD if len(record.data) > 8 else 0)
        return replace(record, t=t, bus="can0", flags=flags)
    return replace(record, t=t)


def left(suffix: str, found: list[Record]) -> list[Record]:
    start = found[0].t if found else 0
    return [record for record in (kept(suffix, one, start) for one in found) if record is not None]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("suffix", ALL)
def test_what_python_can_writes(suffix: str) -> None:
    pieces, source = pieces_of(suffix, library_file(suffix, SAMPLE))
    assert records(pieces) == left(suffix, SAMPLE)
    assert source.damage is None
    assert total(pieces, "unreadable") == 0


@st.composite
def captures(draw: st.DrawFn) -> list[Record]:
    # The first one is of a kind that no writer leaves out: all times count from it.
    found: list[Record] = [Frame(T0, "can0", 0x123, RX, b"first")]
    t = T0
    for _ in range(draw(st.integers(0, 12))):
        t += draw(st.integers(0, 10**7)) * US
        bus = draw(st.sampled_from(["can0", "can1", "can7"]))
        extended = draw(st.sampled_from([0, EXTENDED]))
        number = draw(st.integers(0, 0x1FFFFFFF if extended else 0x7FF))
        way = draw(st.sampled_from([RX, TX]))
        kind = draw(st.sampled_from([0, 0, FD, REMOTE]))
        if kind == FD:
            size = draw(st.sampled_from(DLC_LENGTHS))
            flags = FD | draw(st.sampled_from([0, BRS, ESI, BRS | ESI]))
            found.append(Frame(t, bus, number, extended | way | flags, draw(st.binary(min_size=size, max_size=size))))
        elif kind == REMOTE:
            found.append(Frame(t, bus, number, extended | way | REMOTE, b"", draw(st.integers(0, 8))))
        else:
            found.append(Frame(t, bus, number, extended | way, draw(st.binary(max_size=8))))
    return found


@pytest.mark.sampled(2)
@pytest.mark.parametrize("suffix", [*TEXT, ".blf"])
@given(captures(), st.integers(1, 3000))
def test_any_traffic_in_any_cut(suffix: str, found: list[Record], size: int) -> None:
    assert frames(suffix, library_file(suffix, found), size) == left(suffix, found)


@pytest.mark.slow
@given(captures())
@examples(10)
def test_any_traffic_in_mdf(found: list[Record]) -> None:
    """Its groups are merged by time: frames of the same time may change places."""
    key = lambda record: (record.t, repr(record))  # noqa: E731
    assert sorted(frames(".mf4", library_file(".mf4", found)), key=key) == sorted(left(".mf4", found), key=key)


@pytest.mark.parametrize("suffix", TEXT)
def test_rows_do_not_depend_on_chunks(suffix: str) -> None:
    data = library_file(suffix, SAMPLE) + b"garbage\n\n"
    whole = pieces_of(suffix, data)[0]
    for size in (1, 2, 3, 50, 201):
        pieces = pieces_of(suffix, data, size)[0]
        assert records(pieces) == records(whole)
        assert events(pieces, "unreadable") == events(whole, "unreadable")
        assert total(pieces, "lines") == total(whole, "lines")


@pytest.mark.parametrize("suffix", [*TEXT, ".blf"])
def test_an_empty_chunk_is_passed_on(suffix: str) -> None:
    data = library_file(suffix, SAMPLE)
    source = Source(f"x{suffix}")
    source.format = detect(data, source.name)
    chunks = list(source.reader()(source, iter([data[:300], b"", data[300:], b""])))
    assert [chunk for chunk in chunks if isinstance(chunk, bytes)] == [b"", b""]
    assert records(chunk for chunk in chunks if isinstance(chunk, FrameBatch)) == left(suffix, SAMPLE)


@pytest.mark.slow
def test_formats_are_found_by_content_and_in_zstd(tmp_path: Path) -> None:
    for suffix in ALL:
        path = tmp_path / "capture"
        path.write_bytes(zstandard.compress(library_file(suffix, SAMPLE)))
        source = Source(str(path))
        assert records(piece for piece in source.chunks() if isinstance(piece, FrameBatch)) == left(suffix, SAMPLE)
        assert source.notes
        assert all(len(note) < 120 for note in source.notes)
