"""ASC, TRC and CSV as other programs write them, and lines that are damaged: each is told, and the next one counts."""

from __future__ import annotations

import pytest
from kit.libraries import frames, library_file, pieces_of, total
from kit.rows import BRS, ESI, EXTENDED, FD, REMOTE, RX, TX, Fault, Frame, events, records

from analyzer.sources import CaptureError

MS = 10**6
BUS_ERROR = 0x80
ASC_HEAD = "date Tue Nov 14 10:13:20 pm 2023\nbase hex  timestamps absolute\n"
TRC_21 = ";$FILEVERSION=2.1\n;$STARTTIME=45244.92592592593\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n;\n"
START = 1_700_000_000_000_000_000
CSV_HEAD = "timestamp,arbitration_id,extended,remote,error,dlc,data\n"


def asc(*lines: str, head: str = ASC_HEAD) -> bytes:
    return (head + "\n".join(lines) + "\n").encode()


def trc(*lines: str, head: str = TRC_21) -> bytes:
    return (head + "\n".join(lines) + "\n").encode()


def test_asc_of_other_programs() -> None:
    """No "internal events logged", so that a first frame stands where python-can expects the header to end."""
    data = asc(
        "   0.015991 2  36x             Rx   d 8 64 27 B3 00 0A 41 00 00  Length = 0 BitCount = 64 ID = 54x",
        "   0.020000 1  123             TxRq d 1 FF",
        "   0.020100 1  123             Tx   d 1 FF",
        "   0.0203   1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.0%",
        "   0.0204 CAN 1 Status:chip status error active",
        "   0.0205 SV: 1 0 1 ::Env::Speed = 3",
        "   0.0206 1 J1939TP FEE3p 6 0 0 - Rx d 10 00",
        "   0.030000 1  7F              Rx   r",
        "   0.030001 2  ErrorFrame",
        "   0.030002 CANFD   2 Tx   ErrorFrame",
        "   0.040000123 CANFD   1 Rx         2A  speed 1 1 9 12 00 01 02 03 04 05 06 07 08 09 0A 0B  1 1 0 0 0 0 0 0",
    )
    pieces, source = pieces_of(".asc", data)
    assert records(pieces) == [
        Frame(15_991_000, "can1", 0x36, EXTENDED | RX, bytes.fromhex("6427B3000A410000")),
        Frame(20_100_000, "can0", 0x123, TX, b"\xff"),
        Frame(30 * MS, "can0", 0x7F, RX | REMOTE),
        Fault(30_001_000, "can1", BUS_ERROR, b""),
        Fault(30_002_000, "can1", BUS_ERROR, b"", TX),
        Frame(40_000_123, "can0", 0x2A, FD | BRS | ESI | RX, bytes(range(12))),
    ]
    assert total(pieces, "comments") == 2
    assert (total(pieces, "other"), total(pieces, "unreadable")) == (5, 0)
    assert source.notes[0].startswith("ASC keeps no bus names")


def test_asc_in_decimal_with_differences() -> None:
    head = "base dec  timestamps relative\nno internal events logged\n"
    pieces, _ = pieces_of(
        ".asc", asc("0.5 1 Start of measurement", "1.000 1 291 Rx d 2 5 255", "0.25 1 18x Tx d 0", head=head)
    )
    assert records(pieces) == [
        Frame(1500 * MS, "can0", 291, RX, b"\x05\xff"),
        Frame(1750 * MS, "can0", 18, EXTENDED | TX),
    ]
    assert all(piece.stamps & 8 for piece in pieces)


def test_asc_says_when_it_began() -> None:
    _, source = pieces_of(
        ".asc", asc("Begin Triggerblock Tue Nov 14 22:13:20.0 2023", "0.1 1 1 Rx d 0", "End TriggerBlock")
    )
    assert "times count from the start of the recording (Tue Nov 14 22:13:20.0 2023, zone unknown)" in source.notes


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("0.1 1 12 Rx d 8 00 11", "2 data bytes, 8 expected"),
        ("0.1 1 12 Rx d 2 00 1", "a data byte is not two digits"),
        ("0.1 1 800 Rx d 0", "identifier beyond 11 bits"),
        ("0.1 1 20000000x Rx d 0", "identifier beyond 29 bits"),
        ("0.1 1 12 Rx d zz", "invalid literal for int() with base 16: 'zz'"),
        ("0.1 1 12 Rx d 2 00 GG", "invalid literal for int() with base 16: 'GG'"),
        ("0.1 1 12 Rx d", "not enough values to unpack (expected 2, got 1)"),
        ("0.1 one 12 Rx d 0", "not a frame of a known form"),
        ("1 12 Rx d 0", "no time in front"),
        ("99999999999999999999.1 1 12 Rx d 0", "time out of range"),
        ("0.1 CANFD 1 Rx 12 1 0 9 12 00", "1 data bytes, 12 expected"),
        ("x" * 20_000, "line longer than 16384 bytes"),
    ],
)
def test_a_bad_line_of_asc_is_told_and_the_next_one_counts(line: str, reason: str) -> None:
    good = Frame(200 * MS, "can0", 1, RX, b"\x01")
    pieces, _ = pieces_of(".asc", asc(line, "0.2 1 1 Rx d 1 01", line, "0.2 1 1 Rx d 1 01"))
    assert records(pieces) == [good, good]
    assert [text.startswith(f"{reason}: {line[:40]}") for _, _, text in events(pieces, "unreadable")] == [True, True]


def test_unreadable_text_is_printable_and_short() -> None:
    pieces, _ = pieces_of(".asc", asc("0.1 1 \x1b[31m" + "\N{SNOWMAN}" * 500))
    ((_, _, text),) = events(pieces, "unreadable")
    assert text.isprintable()
    assert len(text) < 150


@pytest.mark.parametrize(
    ("head", "lines", "start", "way"),
    [
        (";######\n", ["1) 1.5 0123 2 AB CD", "2) 2 00000123 8 RTR", "3) 3 FFFFFFFF 4 00 00 00 08 BUSHEAVY"], 0, 0),
        (
            ";$FILEVERSION=1.1\n;$STARTTIME=45244.92592592593\n",
            ["1) 1.5 Rx 0123 2 AB CD", "2) 2.0 Rx 00000123 8 RTR", "3) 3.0 Warng FFFFFFFF 4 00 00 00 08 BUSHEAVY"],
            START,
            RX,
        ),
        (
            ";$FILEVERSION=1.2\n;$STARTTIME=45244.92592592593\n",
            [
                "1) 1.5 1 Rx 0123 2 AB CD",
                "2) 2.0 1 Rx 00000123 8 RTR",
                "3) 3.0 1 Warng FFFFFFFF 4 00 00 00 08 BUSLIGHT",
            ],
            START,
            RX,
        ),
        (
            ";$FILEVERSION=1.3\n;$STARTTIME=45244.92592592593\n",
            ["1) 1.5 1 Rx 0123 - 2 AB CD", "2) 2.0 1 Rx 00000123 - 8 RTR", "3) 3.0 1 Warng 0 - 4 00 00 00 08"],
            START,
            RX,
        ),
        (
            ";$FILEVERSION=2.0\n;$STARTTIME=45244.92592592593\n;$COLUMNS=N,O,T,I,d,l,D\n",
            ["1 1.5 DT 0123 Rx 2 AB CD", "2 2.0 RR 00000123 Rx 8", "3 3.0 ST Rx 00 00 00 08"],
            START,
            RX,
        ),
        (
            TRC_21,
            ["1 1.5 DT 1 0123 Rx - 2 AB CD", "2 2.0 RR 1 00000123 Rx - 8", "3 3.0 ST 1 - Rx - 4 00 00 00 08"],
            START,
            RX,
        ),
    ],
)
def test_trc_of_every_version(head: str, lines: list[str], start: int, way: int) -> None:
    pieces, _ = pieces_of(".trc", trc(*lines, head=head))
    assert records(pieces) == [
        Frame(start + 1_500_000, "can0", 0x123, way, b"\xab\xcd"),
        Frame(start + 2_000_000, "can0", 0x123, way | EXTENDED | REMOTE, b"", 8),
    ]
    assert (total(pieces, "other"), total(pieces, "unreadable")) == (1, 0)


def test_trc_with_can_fd_and_error_frames() -> None:
    data = trc(
        "1 1.0 FD 2 0123 Rx - 9 000102030405060708090A0B".replace(
            "000102030405060708090A0B", bytes(range(12)).hex(" ")
        ),
        "2 2.0 FE 2 0123 Tx - 1 FF",
        "3 3.0 ER 2 - Rx - 5 04 00 02 00 00",
        "4 4.0 ER 2 - Tx - 5 04 00 02 00 00",
        "5 5.0 FD 2 0123 Tx - 12 01 02 03 04 05 06 07 08 09 0A 0B 0C",
        "6 6.0 FD 2 0123 Tx - 16 " + bytes(range(16)).hex(" "),
    )
    assert frames(".trc", data) == [
        Frame(START + MS, "can1", 0x123, FD | RX, bytes(range(12))),
        Frame(START + 2 * MS, "can1", 0x123, FD | BRS | ESI | TX, b"\xff"),
        Fault(START + 3 * MS, "can1", BUS_ERROR, b"", RX),
        Fault(START + 4 * MS, "can1", BUS_ERROR, b"", TX),
        Frame(START + 5 * MS, "can1", 0x123, FD | TX, bytes(range(1, 13))),
        Frame(START + 6 * MS, "can1", 0x123, FD | TX, bytes(range(16))),
    ]


def test_an_error_frame_of_the_first_trc() -> None:
    data = trc("1) 1.0 0123 1 AB", "2) 2.0 0008 4 ERROR 00 19 08 08", head=";######\n")
    assert frames(".trc", data) == [Frame(MS, "can0", 0x123, 0, b"\xab"), Fault(2 * MS, "can0", BUS_ERROR, b"", 0)]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("1 1.5 DT 1 0123 Rx - 2 AB", "1 data bytes, 2 expected"),
        ("1 1.5 DT 1 0123 Rx - 2 AB C", "non-hexadecimal number found in fromhex() arg at position 4"),
        ("1 1.5 DT 1 0123 Rx - 2", "python-can skips it"),
        ("1 1.5 XX 1 0123 Rx - 2 AB CD", "unknown type of message"),
        ("1 1.5", "cells are missing"),
        ("1 now DT 1 0123 Rx - 2 AB CD", "time is not a number"),
        ("1 1e999999999 DT 1 0123 Rx - 2 AB CD", "time out of range"),
        ("1 1.5 DT 1 0123 Rx - 16 AB CD", "length code beyond 15"),
        ("1 1.5 FD 1 0123 Rx - 12 AB CD", "2 data bytes, 24 expected"),
        ("1 1.5 FD 1 0123 Rx - 99 AB CD", "length code beyond 15"),
    ],
)
def test_a_bad_line_of_trc_is_told_and_the_next_one_counts(line: str, reason: str) -> None:
    good = "2 2.0 DT 1 0001 Rx - 1 01"
    pieces, _ = pieces_of(".trc", trc(line, good, line, good))
    assert records(pieces) == [Frame(START + 2 * MS, "can0", 1, RX, b"\x01")] * 2
    assert [text for _, _, text in events(pieces, "unreadable")] == [f"{reason}: {line}"] * 2


def test_trc_that_cannot_be_read_at_all() -> None:
    with pytest.raises(
        CaptureError, match=r"^capture.trc: TRC of version 1.4, only 1.0, 1.1, 1.2, 1.3, 2.0, 2.1 can be read$"
    ):
        pieces_of(".trc", b";$FILEVERSION=1.4\n1) 1.5 1 Rx 0123 2 AB CD\n")
    pieces, _ = pieces_of(".trc", b";$FILEVERSION=2.1\n1 1.5 DT 1 0123 Rx - 2 AB CD\n")
    assert [text for _, _, text in events(pieces, "unreadable")] == [
        "the columns are not stated: 1 1.5 DT 1 0123 Rx - 2 AB CD"
    ]


@pytest.mark.parametrize(
    ("time", "ns"),
    [
        ("1700000000.1234567", 1_700_000_000_123_457_000),
        ("1700000000.00018", 1_700_000_000_000_180_000),
        ("0.123456789", 123_456_789),
        ("1.8e-05", 18_000),
        ("0.0", 0),
    ],
)
def test_times_of_csv_have_no_noise(time: str, ns: int) -> None:
    assert frames(".csv", f"{CSV_HEAD}{time},0x123,0,0,0,0,\n".encode()) == [Frame(ns, "can0", 0x123)]


@pytest.mark.parametrize(
    "line",
    [
        "1.0,0x123,0,0,0,2,AA==",
        "1.0,0x123,0,0,0,1,A",
        "1.0,0x123,0,0,2,1,AA==",
        "1.0,123,0,0,0,1,AA==",
        "1.0,0x123,0,0,0,1",
        "nan,0x123,0,0,0,1,AA==",
        "1.0,0x800,0,0,0,1,AA==",
        "1.0,0x123,0,0,0,65," + "A" * 87 + "=",
        "1e99999,0x123,0,0,0,1,AA==",
    ],
)
def test_a_bad_line_of_csv_is_told_and_the_next_one_counts(line: str) -> None:
    good = "2.0,0x1,1,0,0,1,AQ=="
    pieces, _ = pieces_of(".csv", f"{CSV_HEAD}{line}\n{good}\n{line}\n{good}\n".encode())
    assert records(pieces) == [Frame(2000 * MS, "can0", 1, EXTENDED, b"\x01")] * 2
    assert total(pieces, "unreadable") == 2


def test_error_frames_of_csv_have_their_class() -> None:
    found = [Fault(START, "can0", 4, bytes([0, 4, 0, 0, 0, 0, 0, 0])), Fault(START, "can0", BUS_ERROR, b"")]
    assert frames(".csv", library_file(".csv", found)) == found


def test_many_buses_are_too_many() -> None:
    pieces, _ = pieces_of(".asc", asc(*(f"0.1 {number} 12 Rx d 0" for number in range(1, 400))))
    assert total(pieces, "frames") + total(pieces, "unreadable") == 399
    assert total(pieces, "unreadable") > 0
    assert all(text.startswith("more than ") for _, _, text in events(pieces, "unreadable"))
