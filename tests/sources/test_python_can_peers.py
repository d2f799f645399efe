"""What python-can reads of the logs that other programs write, recreated line by line and object by object, is read."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import can
import pytest
from kit.libraries import (
    FD_64,
    FD_MESSAGE,
    blf_container,
    blf_file,
    blf_frame,
    blf_message,
    blf_object,
    message,
    pieces_of,
    total,
)
from kit.rows import FD, REMOTE, RX, TX, Frame, records

from analyzer.cli import main
from analyzer.sources.python_can import requests

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

ASC_HEAD = (
    "date Sat Sep 30 15:06:13.191 2017\nbase hex  timestamps absolute\ninternal events logged\n// version 9.0.0\n"
    "Begin Triggerblock Sat Sep 30 15:06:13.191 2017\n   0.000000 Start of measurement\n"
)
TAIL = "  Length = 1704000 BitCount = 145 ID = 77777777x"
FLAGS = "140000 73 200050 7a60 46500250 460a0250 20011736 20010205"
ASC = {
    "remote": "   2.5 2 100 Rx r",
    "remote with statistics": f"   2.6 3 200 Tx r{TAIL}",
    "remote with a length": f"   2.7 4 300 Rx r 8{TAIL}",
    "remote, extended": "   2.8 1 18EBFF00x Rx r 3",
    "data with statistics": f"   2.9 1  18EBFF00x       Rx d 8 01 A0 0F A6 60 3B D1 40  {TAIL}",
    "raw length": f"  13.258671 1  3FF             Tx   d D 55 AA 01 02 03 04 05 06{TAIL}",
    "long length": "   3.0 1  123x            Rx   d 40 00 01 02 03 04 05 06 07 08 09 0A",
    "FD": f"  30.0 CANFD   2 Rx        300  A_name   1 0 8  8 01 02 03 04 05 06 07 08  {FLAGS}",
    "FD without data": f"  30.1 CANFD   3 Tx     50005x        0 0 5 0 {FLAGS}",
    "FD without data, error state": f"  30.2 CANFD   3 Rx     505     0 1 5 0 {FLAGS}",
    "FD of 64 bytes": f"  30.3 CANFD   4 Rx        4EE         0 1 f 64 {'A1 ' * 64} {FLAGS}",
    "error frames": f"   4.5 2 ErrorFrame Flags = 0xe CodeExt = 0x20a2 Code = 0x82 ID = 0 DLC = 0{TAIL}",
    "FD error frame": "  30.8 CANFD   5 Tx ErrorFrame Not Acknowledge error, fffe c7 31ca Arb. 556 44 0 0 f 64 00",
    "events": "   0.1 CAN 1 Status:chip status error passive - TxErr: 132 RxErr: 0\n   1.0 1  Statistic: D 0 R 0 XD 0",
}


def comparable(found: Iterable[can.Message], first: int = 0) -> list[tuple[object, ...]]:
    """What of messages must be equal, times to the microsecond that floats hold; channels count from `first`."""
    return [
        ("error", round(one.timestamp * 10**6), one.channel - first) if one.is_error_frame else
        (round(one.timestamp * 10**6), one.channel - first, one.arbitration_id, one.is_extended_id, one.is_remote_frame,
         one.is_fd, one.bitrate_switch, one.error_state_indicator, one.is_rx, bytes(one.data))
        for one in found
    ]  # fmt: skip


def ours(suffix: str, data: bytes) -> list[tuple[object, ...]]:
    pieces, source = pieces_of(suffix, data)
    assert (total(pieces, "unreadable"), source.damage) == (0, None)
    return comparable(map(message, records(pieces)))


def theirs(path: Path, data: bytes) -> list[tuple[object, ...]]:
    path.write_bytes(data)
    with can.LogReader(path) as log:
        return comparable(log, int(path.suffix == ".trc"))


@pytest.mark.parametrize("case", ASC)
def test_lines_of_asc(tmp_path: Path, case: str) -> None:
    data = f"{ASC_HEAD}{ASC[case]}\n".encode()
    expected = theirs(tmp_path / "x.asc", data)
    assert ours(".asc", data) == expected
    assert bool(expected) == (case != "events")


def test_lengths_of_remote_frames() -> None:
    lines = [ASC[case] for case in ("remote", "remote with a length", "remote, extended", "FD without data")]
    pieces, _ = pieces_of(".asc", f"{ASC_HEAD}{chr(10).join(lines)}\n".encode())
    found = [(one.flags & (REMOTE | FD), one.code) for one in records(pieces) if isinstance(one, Frame)]
    assert found == [(REMOTE, 0), (REMOTE, 8), (REMOTE, 3), (REMOTE | FD, 5)]


def dummy(kind: int, number: int = 0x4444_4444) -> bytes:
    """An object whose fields are filled with patterns: no bus has such an identifier, length or channel."""
    body = {
        1: struct.pack("<HBBL8s", 0x1111, 0x22, 0x33, number, bytes(range(0x55, 0x5D))),
        86: struct.pack("<HBBL8sLHH", 0x1111, 0x22, 0x33, number, bytes(range(0x55, 0x5D)), 0xDDDD_DDDD, 0xEE, 0xFF),
        FD_MESSAGE: struct.pack("<HBBLLBBB5x64s", 0x1111, 0x22, 0x33, number, 0x5555, 0x66, 0x77, 64, bytes(range(64))),
        FD_64: struct.pack("<BBBBLLLLLLLHBBL", 0x11, 0x22, 64, 0x44, number, 6, 0x7777_7777, 8, 9, 10, 11, 0xCCCC, 0xDD,
                           0, 15) + bytes(range(64)),
    }  # fmt: skip
    return blf_object(kind, body[kind], 0x2222_2222_2222)


@pytest.mark.parametrize("kind", [1, 86, FD_MESSAGE, FD_64])
def test_objects_of_blf(tmp_path: Path, kind: int) -> None:
    for number in (0x4444_4444, 0x8000_0123, 0x123):
        data = blf_file(blf_container(dummy(kind, number) * 2, 0))
        expected = theirs(tmp_path / "x.blf", data)
        assert ours(".blf", data) == expected
        assert len(expected) == 2


def test_requests_count_where_nothing_is_said_to_be_sent() -> None:
    pieces, source = pieces_of(".blf", blf_file(blf_container(blf_message(1) + blf_message(2, way=2) + blf_message(3))))
    assert records(pieces) == [blf_frame(1), blf_frame(2, flags=0), blf_frame(3)]
    assert source.notes[-1] == "frames that were asked for, none is said to be sent (TxRq): 1"


@pytest.mark.parametrize("first", [1, 2])
@pytest.mark.parametrize("size", [1, 50, 1 << 20])
def test_requests_of_frames_that_were_sent_are_left_out(first: int, size: int) -> None:
    ways = [0, first, 3 - first, 2, 0]
    data = b"".join(blf_message(k, way=way) for k, way in enumerate(ways))
    pieces, source = pieces_of(".blf", blf_file(blf_container(data)), size)
    flags = {0: RX, 1: TX}
    assert records(pieces) == [blf_frame(k, flags=flags[way]) for k, way in enumerate(ways) if way in flags]
    assert (total(pieces, "other"), source.notes[-1]) == (2, "requests of frames left out (TxRq): 2")


def test_the_wait_for_a_frame_that_was_sent_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(requests, "MOST_HELD", 300)
    data = b"".join(blf_message(k, way=2) for k in range(9)) + blf_message(9, way=1)
    pieces, _ = pieces_of(".blf", blf_file(blf_container(data)))
    assert len(records(pieces)) == 10


def test_requests_of_asc_are_told() -> None:
    _, source = pieces_of(".asc", f"{ASC_HEAD}  0.1 1 123 TxRq d 1 FF\n  0.2 1 123 Tx d 1 FF\n".encode())
    assert source.notes[-1] == "requests of frames left out (TxRq): 1"


TRC_HEADS = {
    "1.0": ("", "{n})  {n}00  00000100  8  00 00 00 00 00 00 00 00", "{n})  {n}00      0704  1  RTR"),
    "2.1": (
        ";$FILEVERSION=2.1\n;$STARTTIME=44548.6028595139\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n",
        "{n}   {n}00.500 DT 1  00000100 Tx -  8    00 00 00 00 00 00 00 00",
        "{n}   {n}00.600 RR 1      0704 Rx -  1",
    ),
}


@pytest.mark.parametrize("version", TRC_HEADS)
@pytest.mark.parametrize("last", [1, 2])
def test_trc_without_a_last_line_end(tmp_path: Path, version: str, last: int) -> None:
    """The line says how many bytes it has: with all of them it is whole, with less it is cut."""
    head, *kinds = TRC_HEADS[version]
    head = head or ";##########################################################################\n"
    lines = [kinds[0].format(n=1), kinds[last - 1].format(n=2)]
    whole = (head + "\n".join(lines)).encode()
    expected = theirs(tmp_path / "x.trc", whole + b"\n")
    assert len(expected) == 2
    if version != "1.0":  # has no directions, which python-can makes up
        assert ours(".trc", whole) == expected
    path = tmp_path / "whole.trc"
    path.write_bytes(whole)
    assert main(["convert", str(path), str(tmp_path / "x.log")]) == 0
    path.write_bytes(whole[:-1])
    if last == 1:
        assert main(["convert", str(path), str(tmp_path / "x.log")]) == 3


@pytest.mark.parametrize("to", ["x.log", "x.pcapng", "x.mcap"])
def test_what_no_bus_carries_is_converted_and_told(tmp_path: Path, to: str, capfd: pytest.CaptureFixture[str]) -> None:
    """An 11-bit frame with a larger identifier, and a remote frame of CAN FD."""
    path = tmp_path / "x.blf"
    path.write_bytes(blf_file(blf_container(dummy(1) + dummy(FD_64, 5), 0)))
    assert main(["convert", str(path), str(tmp_path / to)]) == 0
    err = capfd.readouterr().err
    assert "11-bit identifiers that need more bits, written as 29-bit ones" in err
    assert "remote frames of CAN FD, written as data frames" in err
    assert main(["convert", str(tmp_path / to), str(tmp_path / "again.log")]) == 0
    assert b"04444444#5556" in (tmp_path / "again.log").read_bytes()
