"""Every format gives back what was written, frame by frame; what it cannot hold is counted."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import can
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from kit.rows import (
    BRS,
    CAPTURES,
    ESI,
    FD,
    REMOTE,
    RX,
    TX,
    Fault,
    Frame,
    Record,
    events,
    piece,
    plain,
    records,
    sound,
    text,
    written,
)

from analyzer.sinks import FORMS, form_of
from analyzer.tables import EVENT_ROWS, STAMPS, wrap
from analyzer.window.cut import RECORDED

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("form", FORMS)
@given(capture=CAPTURES, cuts=st.lists(st.integers(0, 30), max_size=3))
@example(capture=[Frame(flags=RX, data=bytes(8)), Fault(), Frame(flags=FD | BRS | TX, data=bytes(64))], cuts=[1])
@example(capture=[Frame(t=2**31 * 10**9), Frame(t=2**63 - 1), Frame(t=0), Frame(t=1)], cuts=[])
@example(capture=[Frame(None), Frame(7), Fault(None), Frame(None, flags=FD | TX), Frame(0), Fault(8)], cuts=[1, 3])
@example(capture=[Fault(flags=TX), Fault(None, flags=RX), Fault(), Frame(flags=TX)], cuts=[])
def test_what_is_written_is_read(form: str, capture: list[Record], cuts: list[int]) -> None:
    edges = [0, *sorted(min(cut, len(capture)) for cut in cuts), len(capture)]
    whole = piece(capture)
    lines = range(len(capture))
    parts = [whole.pick(*chosen(capture, lines[a:b])) for a, b in pairwise(edges)]
    data, sink = written(form, parts)
    assert records(sound(form, data)) == capture
    assert sink.lost == {}
    assert sink.frames == sum(isinstance(record, Frame) for record in capture)


def chosen(capture: list[Record], lines: range) -> tuple[bytes, bytes]:
    """Row numbers of these records among the frames and among the error frames."""
    out = []
    for kind in (Frame, Fault):
        places = [at for at, record in enumerate(capture) if isinstance(record, kind)]
        out.append(b"".join(row.to_bytes(4, "little") for row, at in enumerate(places) if at in lines))
    return out[0], out[1]


@given(capture=CAPTURES)
def test_through_all_formats_and_back(capture: list[Record]) -> None:
    """Candump text to each format and back is the same text."""
    first, _ = written("candump", [piece(capture)])
    for form in FORMS:
        through, _ = written(form, text(first))
        assert written("candump", sound(form, through))[0] == first


ODD = """\
# a comment
; another
(1700000000.000180) can0 05040601#A63500000000009C R
DROPCOUNT: dropped 5 CAN frames on 'can0' socket (total drops 12)
(1700000000.000200) can0 20000004#000C000000006087
(1700000000.000210) can0 20000004#0100000000000000 T
can1 20000080# R
DROPCOUNT: dropped 1 CAN frame on 'can1' socket (total drops 1)
DROPCOUNT: dropped 7 CAN frames on 'any' socket (total drops 7)
(1700000000.000300) can1 123#1122 T
nonsense
(1700000000.000400) can1 123#112233445566778899 T

(1700000000.000500) can0 123##311
can0 123#11
"""


def test_candump_keeps_everything_that_is_legible() -> None:
    data, sink = written("candump", text(ODD))
    assert data.decode() == ODD.replace("nonsense\n", "").replace("\n\n", "\n")
    assert sink.lost == {}
    assert sink.frames == 5


def test_pcapng_counts_what_it_cannot_hold() -> None:
    data, sink = written("pcapng", text(ODD))
    assert sink.lost == {
        "classic frames of more than 8 bytes": 1, "interfaces of drop counts": 1,
    }  # fmt: skip
    assert sink.frames == 4
    drops = events(sound("pcapng", data), "drop")
    assert [(bus, count) for bus, count, _ in drops] == [("can0", 5), ("can1", 1), ("can0", 7)]


def test_mcap_counts_what_it_cannot_hold() -> None:
    data, sink = written("mcap", text(ODD))
    assert sink.lost == {"classic frames of more than 8 bytes": 1, "interfaces of drop counts": 1}
    pieces = sound("mcap", data)
    faults = [record for record in records(pieces) if isinstance(record, Fault)]
    assert [(fault.bus, fault.error) for fault in faults] == [("can0", 4), ("can0", 4), ("can1", 128)]
    assert [(bus, count) for bus, count, _ in events(pieces, "drop")] == [("can0", 5), ("can1", 1), ("can1", 7)]


REMARKS = """\
(1700000000.000180000) can0 123#11
# (1700000000.000190001) mark 3
;no time
DROPCOUNT: dropped 5 CAN frames on 'can0' socket (total drops 5) (1700000000.000190002)
DROPCOUNT: dropped 4294967295 CAN frames on 'can1' socket (total drops 4294967300) (1700000000.000190003)
(1700000000.000200000) can1 123#11
; (0000000000.000000000)at 1970
"""


@pytest.mark.parametrize("form", FORMS)
def test_comments_and_drop_counts_keep_their_places_and_times(form: str) -> None:
    through, sink = written(form, text(REMARKS))
    assert sink.lost == {}
    assert written("candump", sound(form, through))[0].decode() == REMARKS


def test_long_error_frames() -> None:
    capture = [Fault(data=bytes(9))]
    data, sink = written("candump", [piece(capture)])
    assert (records(text(data)), sink.lost) == (capture, {})
    for form in ("pcapng", "mcap"):
        assert written(form, [piece(capture)])[1].lost == {"error frames of more than 8 bytes": 1}


def test_times_before_1970() -> None:
    capture = [Frame(t=-1), Fault(t=-(2**62))]
    for form in FORMS:
        data, sink = written(form, [piece(capture)])
        assert sink.lost == {"times before 1970": 2}
        assert [record.t for record in records(sound(form, data))] == [None, None]


@pytest.mark.parametrize("form", FORMS)
def test_a_capture_without_times_has_none_afterwards(form: str) -> None:
    log = "DROPCOUNT: dropped 1 CAN frame on 'can0' socket (total drops 1)\ncan0 123#11\ncan1 20000004# T\n"
    data, sink = written(form, text(log))
    assert all("time" not in what for what in sink.lost)
    pieces = sound(form, data)
    assert {STAMPS[bit] for part in pieces for bit in range(8) if part.stamps >> bit & 1} == {"none"}
    rows = [row for part in pieces for form, cells in zip((RECORDED, EVENT_ROWS), part.columns(), strict=True)
            for row in plain(wrap(form, cells))]  # fmt: skip
    assert [row["t"] for row in rows] == [None] * 3


@pytest.mark.parametrize("form", FORMS)
def test_only_the_frames_without_a_time_have_none(form: str) -> None:
    """A drop count has that of its neighbour, in all formats that know times of drop counts."""
    drop = "DROPCOUNT: dropped 1 CAN frame on 'can0' socket (total drops 1)"
    log = f"can0 1#\n{drop}\n(0.0) can0 2#\ncan0 3#\n(2.0) can0 4#\n"
    pieces = sound(form, written(form, text(log))[0])
    frames = [record for record in records(pieces) if isinstance(record, Frame)]
    assert [(frame.id, frame.t) for frame in frames] == [(1, None), (2, 0), (3, None), (4, 2 * 10**9)]
    assert {part.stamps & 17 for part in pieces if part.frames} == {17}  # absolute and none
    drops = [row["t"] for part in pieces for row in plain(wrap(EVENT_ROWS, part.columns()[1]))]
    assert drops == [None if form == "candump" else 0]


@pytest.mark.parametrize("form", FORMS)
def test_a_bus_without_a_name_is_one_bus(form: str) -> None:
    """With times or without."""
    data, _ = written(form, [piece([Frame(1, ""), Frame(None, ""), Frame(2)])])
    assert [record.bus for record in records(sound(form, data))] == ["can", "can", "can0"]


def test_the_flag_digit_of_candump_has_two_bits_with_a_meaning() -> None:
    for digit in range(16):
        (frame,) = records(text(f"can0 123##{digit:X}AB\n"))
        assert frame == Frame(None, flags=FD | BRS * (digit & 1) | ESI * (digit >> 1 & 1), data=b"\xab")
        assert written("candump", [piece([frame])])[0] == f"can0 123##{digit & 3}AB\n".encode()


def lines(*times: int) -> list[str]:
    data, _ = written("candump", [piece([Frame(t=t, data=b"\x01")]) for t in times])
    return data.decode().splitlines()


def test_digits_of_the_fraction() -> None:
    assert lines(0, 1_000, 10**18) == [
        "(0000000000.000000) can0 123#01", "(0000000000.000001) can0 123#01", "(1000000000.000000) can0 123#01",
    ]  # fmt: skip
    assert lines(1_000, 1, 2_000) == [
        "(0000000000.000001) can0 123#01", "(0000000000.000000001) can0 123#01", "(0000000000.000002000) can0 123#01",
    ]  # fmt: skip


@given(names=st.lists(st.text(max_size=80), max_size=12, unique=True))
@example(
    names=[
        "",
        "can",
        "can_2",
        "(x",
        "_x",
        ";x",
        "#",
        "a b",
        "a#b",
        "a_b",
        "DROPCOUNT:",
        "\x1b" * 20,
        "é" * 32,
        "é" * 33,
    ]
)
def test_any_name_remains_one_word_and_one_bus(names: list[str]) -> None:
    made = piece([Frame(t=t, bus=name, id=number) for number, name in enumerate(names) for t in (None, 0)])
    data, sink = written("candump", [made])
    got = records(text(data))
    assert [record.id for record in got if isinstance(record, Frame)] == [n for n in range(len(names)) for _ in "ab"]
    assert len({record.bus for record in got}) == len(made.buses)
    changed = sum(name != kept for name, kept in zip(made.buses, text(data)[0].buses if names else [], strict=True))
    assert sink.lost.get("interface names, changed to fit", 0) == changed


@given(names=st.lists(st.from_regex(r"[!$-'*-:<-~][!$-~]{0,61}", fullmatch=True), max_size=12, unique=True))
def test_good_names_stay(names: list[str]) -> None:
    data, sink = written("candump", [piece([Frame(bus=name) for name in names])])
    assert [record.bus for record in records(text(data))] == names
    assert sink.lost == {}


def test_python_can_reads_plain_lines(tmp_path: Path) -> None:
    """A reader that nobody here wrote."""
    capture = [
        Frame(flags=RX, data=b"\x01\x02"), Frame(flags=1 | TX, id=0x1234567, data=bytes(8)),
        Frame(flags=REMOTE, code=4),
        Frame(flags=FD | BRS, data=bytes(12)), Frame(flags=FD | ESI, data=b""), Frame(id=0, flags=1),
    ]  # fmt: skip
    path = tmp_path / "plain.log"
    path.write_bytes(written("candump", [piece(capture)])[0])
    for message, frame in zip(can.LogReader(path), capture, strict=True):
        assert isinstance(frame, Frame)
        flags = (message.is_extended_id, message.is_remote_frame, message.is_fd, message.bitrate_switch)
        assert flags == tuple(bool(frame.flags & bit) for bit in (1, REMOTE, FD, BRS))
        assert message.error_state_indicator == bool(frame.flags & ESI)
        assert (message.arbitration_id, message.channel) == (frame.id, "can0")
        assert bytes(message.data) == (b"" if frame.flags & REMOTE else frame.data)
        assert message.is_rx == (not frame.flags & TX)
        assert message.timestamp == pytest.approx(1_700_000_000.00018, abs=1e-6)


@pytest.mark.parametrize(
    ("path", "form"),
    [("a.log", ("candump", "")), ("a.LOG.gz", ("candump", "gzip")), ("a.txt.zst", ("candump", "zstd")),
     ("x/a.b.mcap", ("mcap", "")), ("a.pcapng", ("pcapng", "")), ("-", ("", "")), ("a", ("", "")), (".log", ("", "")),
     ("a.gz", ("", "gzip")), ("a.pcap", ("", "")), ("a.candump", ("candump", ""))],
)  # fmt: skip
def test_names_say_the_format(path: str, form: tuple[str, str]) -> None:
    assert form_of(path) == form
