"""pcapng as others read it: a walk of the blocks written here from the specification, and tshark where it is there."""

from __future__ import annotations

import shutil
import struct
import subprocess
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from kit.command import LIMIT
from kit.rows import BRS, CAPTURES, ESI, EXTENDED, FD, REMOTE, RX, TX, Fault, Frame, Record, piece, text, written

if TYPE_CHECKING:
    from pathlib import Path

NS = 1_700_000_000_123_456_789


def blocks(data: bytes) -> list[tuple[int, bytes]]:
    """Type and body of every block; each is whole words long and says its length at both ends."""
    found, at = [], 0
    while at < len(data):
        kind, length = struct.unpack_from("<II", data, at)
        assert length % 4 == 0
        assert struct.unpack_from("<I", data, at + length - 4) == (length,)
        found.append((kind, data[at + 8 : at + length - 4]))
        at += length
    assert at == len(data)
    return found


def options(body: bytes) -> dict[int, bytes]:
    """Options by code; the end mark closes them."""
    found, at = {}, 0
    while at < len(body):
        code, length = struct.unpack_from("<HH", body, at)
        if code == 0:
            assert (length, at + 4) == (0, len(body))
            return found
        found[code] = body[at + 4 : at + 4 + length]
        at += 4 + length + -length % 4
    assert not found, "no end mark"
    return found


def packet(body: bytes) -> tuple[int, int, bytes, dict[int, bytes]]:
    """Interface, time, bytes and options of an enhanced packet."""
    interface, high, low, captured, original = struct.unpack_from("<IIIII", body)
    assert captured == original
    end = 20 + captured + -captured % 4
    return interface, high << 32 | low, body[20 : 20 + captured], options(body[end:])


def test_the_blocks() -> None:
    capture: list[Record] = [
        Frame(NS, "can0", 0x123, RX, b"\x01\x02"),
        Frame(NS + 1, "can1", 0x1234567, EXTENDED | TX, bytes(range(8))),
        Frame(NS + 2, "can0", 0x7FF, FD | BRS | ESI, bytes(range(12))),
        Frame(NS + 3, "can0", 0, REMOTE, b"", 5),
        Frame(NS + 4, "can0", 0, REMOTE | EXTENDED, b"", 11),
        Frame(NS + 5, "can0", 0, 0, bytes(8), 15),
        Fault(NS + 6, "can0", 0x204, b"\x00\x0c", TX),
    ]
    (section, head), *rest = blocks(written("pcapng", [piece(capture)])[0])
    assert (section, head[:16]) == (0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))
    assert options(head[16:]) == {4: b"tailbyte"}
    assert [kind for kind, _ in rest] == [1, 6, 1, 6, 6, 6, 6, 6, 6]
    for (_, body), name in zip((rest[0], rest[2]), (b"can0", b"can1"), strict=True):
        assert body[:8] == struct.pack("<HHI", 227, 0, 0)
        assert options(body[8:]) == {2: name, 9: b"\x09"}
    packets = [packet(body) for kind, body in rest if kind == 6]
    assert [t for _, t, _, _ in packets] == [NS + k for k in range(7)]
    assert [interface for interface, *_ in packets] == [0, 1, 0, 0, 0, 0, 0]
    assert [found.get(2, b"\0")[0] for *_, found in packets] == [1, 2, 0, 0, 0, 0, 2]
    heads = [(0x123, 2, 0, 0), (0x81234567, 8, 0, 0), (0x7FF, 12, 7, 0), (0x40000000, 5, 0, 0), (0xC0000000, 8, 0, 11),
             (0, 8, 0, 15), (0x20000204, 2, 0, 0)]  # fmt: skip
    assert [struct.unpack(">IBBxB", data[:8]) for _, _, data, _ in packets] == heads
    bodies = [b"\x01\x02", bytes(range(8)), bytes(range(12)), b"", b"", bytes(8), b"\x00\x0c"]
    assert [data[8:] for _, _, data, _ in packets] == [
        body.ljust(64 if row == 2 else 8, b"\0") for row, body in enumerate(bodies)
    ]


@given(capture=CAPTURES)
def test_the_structure_of_any_capture(capture: list[Record]) -> None:
    found = blocks(written("pcapng", [piece(capture)])[0])
    kinds = [kind for kind, _ in found]
    assert (kinds[0], kinds.count(6)) == (0x0A0D0D0A, len(capture))
    names = [options(body[8:])[2].decode() for kind, body in found if kind == 1]
    described = 0
    for kind, body in found:
        described += kind == 1
        assert kind != 6 or packet(body)[0] < described
    packets = [packet(body) for kind, body in found if kind == 6]
    assert [names[interface] for interface, *_ in packets] == [record.bus for record in capture]


def test_packets_without_a_time_are_those_of_an_interface_that_says_so() -> None:
    """Their stamps are none of theirs: the first one that there is, or the last one before them."""
    capture = [Fault(None), Frame(NS), Frame(None, flags=RX), Frame(NS + 9), Frame(None)]
    _, *rest = blocks(written("pcapng", [piece(capture)])[0])
    assert [kind for kind, _ in rest] == [1, 6, 1, 6, 6, 6, 6]
    assert [options(body[8:]) for kind, body in rest if kind == 1] == [
        {2: b"can0", 3: b"tailbyte: no time stamps", 9: b"\x09"}, {2: b"can0", 9: b"\x09"},
    ]  # fmt: skip
    packets = [packet(body) for kind, body in rest if kind == 6]
    assert [(interface, t) for interface, t, *_ in packets] == [(0, NS), (1, NS), (0, NS), (1, NS + 9), (0, NS + 9)]


def test_drop_counts_are_sums_of_an_interface() -> None:
    log = (
        "DROPCOUNT: dropped 3 CAN frames on 'can1' socket (total drops 3)\n(7.5) can0 123#\n"
        "DROPCOUNT: dropped 4 CAN frames on 'can1' socket (total drops 7)\n"
        "DROPCOUNT: dropped 1 CAN frame on 'any' socket (total drops 8)\n"
    )
    found = blocks(written("pcapng", text(log))[0])
    assert [kind for kind, _ in found[1:]] == [1, 5, 1, 6, 5, 5]
    statistics = [(struct.unpack_from("<III", body), options(body[12:])) for kind, body in found if kind == 5]
    late = divmod(7_500_000_000, 2**32)
    assert statistics == [
        ((0, *late), {5: struct.pack("<Q", 3)}),
        ((0, *late), {5: struct.pack("<Q", 7)}),
        ((0, *late), {5: struct.pack("<Q", 8)}),
    ]


def test_an_empty_capture_is_a_section() -> None:
    assert [kind for kind, _ in blocks(written("pcapng", [])[0])] == [0x0A0D0D0A]


FIELDS = {
    "t": "frame.time_epoch", "bus": "frame.interface_name", "about": "frame.interface_description",
    "direction": "frame.packet_flags_direction", "id": "can.id",
    "extended": "can.flags.xtd", "remote": "can.flags.rtr", "error": "can.flags.err", "length": "can.len",
    "brs": "canfd.flags.brs", "esi": "canfd.flags.esi", "data": "data.data",
}  # fmt: skip


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_reads_it(tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    capture = [
        Frame(NS, "can0", 0x123, RX, b"\x01\x02"),
        Frame(NS + 1, "vcan-1", 0x1234567, EXTENDED | TX, bytes(range(8))),
        Frame(NS + 2, "can0", 0x7FF, FD | BRS, bytes(range(12))),
        Frame(NS + 3, "can0", 0x7FF, FD | ESI, bytes(range(64))),
        Frame(NS + 4, "can0", 0x55, REMOTE, b"", 5),
        Fault(NS + 5, "can0", 4, bytes(8), RX),
        Frame(None, "vcan-1", 0x123, TX, b"\x01"),
    ]
    path.write_bytes(written("pcapng", [piece(capture)])[0])
    asked = [word for field in FIELDS.values() for word in ("-e", field)]
    done = subprocess.run(
        ["tshark", "-r", path, "-T", "fields", "-E", "separator=;", *asked],
        capture_output=True, timeout=LIMIT, check=True, text=True,
    )  # fmt: skip
    shown: list[dict[str, Any]] = [dict(zip(FIELDS, row.split(";"), strict=True)) for row in done.stdout.splitlines()]
    assert [row["t"] for row in shown] == [f"1700000000.{123456789 + row}" for row in (*range(6), 5)]
    assert [row["bus"] for row in shown] == [record.bus for record in capture]
    assert [int(row["direction"] or "0", 16) for row in shown] == [1, 2, 0, 0, 0, 1, 2]
    assert [row["about"] for row in shown] == [""] * 6 + ["tailbyte: no time stamps"]
    frames = list(zip(shown, capture, strict=True))[:5]
    for row, frame in frames:
        assert isinstance(frame, Frame)
        assert int(row["id"], 0) == frame.id
        assert int(row["extended"]) == bool(frame.flags & EXTENDED)
        assert int(row["length"]) == (5 if frame.flags & REMOTE else len(frame.data))
        if not frame.flags & REMOTE:
            assert bytes.fromhex(row["data"]) == frame.data
    assert [(row["brs"], row["esi"]) for row in shown[2:4]] == [("1", "0"), ("0", "1")]
    assert [shown[row]["remote"] for row in (0, 4)] == ["0", "1"]
    assert [shown[row]["error"] for row in (0, 4, 5)] == ["0", "0", "1"]


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_lists_comments_among_the_packets(tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    frame = "(1700000000.000001000) can0 123#11\n"
    path.write_bytes(written("pcapng", text(f"{frame}# (1700000000.000002000) mark 3\n{frame}"))[0])
    done = subprocess.run(
        ["tshark", "-r", path, "-T", "fields", "-e", "frame.time_epoch", "-e", "_ws.col.Info"],
        capture_output=True, timeout=LIMIT, check=True, text=True,
    )  # fmt: skip
    rows = [line.split("\t") for line in done.stdout.splitlines()]
    assert rows[1] == ["1700000000.000002000", "# mark 3"]
    assert len(rows) == 3
