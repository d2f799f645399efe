"""The committed captures against what their senders know: frames, transfers, values, packets, verdicts and events."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from bench import make_captures
from kit.traffic import differing, same
from kit.vendors import physical

from analyzer.app.capture import open_capture
from analyzer.sources import Source
from analyzer.tables import BRS, ESI, EXTENDED, FD, REMOTE, RX, TX

if TYPE_CHECKING:
    from collections.abc import Callable

    from kit.encode import Frame

CASES = make_captures.cases()
# Packet fields that are shown in a unit: raw value times this (document 4.4.5).
SCALES = {"position": 0.01, "pwm": 0.1, "throttle": 0.4, "voltage": 0.01, "current": 0.01, "temperature": 0.01}
ORDERED = sorted(CASES)


@pytest.fixture(scope="module")
def decoded(decode: Callable[..., Any]) -> dict[str, Any]:
    return {name: decode((make_captures.FOLDER / name).read_bytes()) for name in CASES}


@pytest.mark.slow
def test_the_files_are_what_the_script_makes() -> None:
    script = Path(make_captures.__file__)
    done = subprocess.run([sys.executable, str(script), "--check"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def flags(frame: Frame) -> int:
    out = (EXTENDED if frame.extended else 0) | (REMOTE if frame.remote else 0) | (FD if frame.fd else 0)
    if frame.fd:
        out |= (BRS if frame.flags & 1 else 0) | (ESI if frame.flags & 2 else 0)
    out |= {"R": RX, "T": TX, "": 0}[frame.direction]
    return out | (frame.dlc or 0) << 8


@pytest.mark.parametrize("name", ORDERED)
def test_frames(decoded: dict[str, Any], name: str) -> None:
    case, got = CASES[name], decoded[name]
    assert len(got.frames) == len(case.frames)
    lines = [number for number, row in enumerate(case.rows, 1) if row.frame]
    loose = name == "dialects.txt"  # forms that do not state flags, direction or time
    for number, (line, sent, row) in enumerate(zip(lines, case.frames, got.frames, strict=True), 1):
        assert (row["line"], row["id"], row["data"]) == (line, sent.id, sent.data), number
        assert got.engine.buses[row["bus"]] == sent.bus, number
        mask = EXTENDED | REMOTE | FD if loose else 0xFFFF
        assert row["flags"] & mask == flags(sent) & mask, number
        if sent.t:
            assert row["t"] == sent.t, number


@pytest.mark.parametrize("name", ORDERED)
def test_transfers(decoded: dict[str, Any], name: str) -> None:
    case, got = CASES[name], decoded[name]
    lost = set(case.unproven)
    sent = [one for one in case.sent if one not in lost]
    rows = sorted(got.transfers, key=lambda row: row["frame"][0])
    assert [[k + 1 for k in row["frame"]] for row in rows] == [one.frames for one in sent]
    for one, row in zip(sent, rows, strict=True):
        of, where = one.transfer, (one.why or "good", one.frames)
        assert row["status"] == one.status, where
        assert (row["kind"], row["type_id"], row["src"], row["dst"]) == (of.kind, of.type_id, of.src, of.dst), where
        assert (row["priority"], row["transfer_id"], row["fd"]) == (of.priority, of.transfer_id, case_fd(one, got, row))
        assert (row["t"], row["t_end"]) == tuple(got.frames[k]["t"] for k in (row["frame"][0], row["frame"][-1]))
        if one.status in ("ok", "unchecked"):
            assert row["payload"] == (of.padded if row["fd"] else of.payload), where
            assert row["crc_wire"] == of.crc, where
        assert row["crc_here"] == (row["crc_wire"] if one.status == "ok" else row["crc_here"]), where


def case_fd(one: Any, got: Any, row: dict[str, Any]) -> bool:
    """In dialects.txt one classic transfer is written as CAN FD: its frames say which."""
    return one.transfer.fd or any(got.frames[k]["flags"] & FD for k in row["frame"])


@pytest.mark.parametrize("name", ORDERED)
def test_values(decoded: dict[str, Any], name: str) -> None:
    case, got = CASES[name], decoded[name]
    first = {row["frame"][0] + 1: number for number, row in enumerate(got.transfers)}
    packets = {(row["transfer"], table): row for table, rows in got.messages.items() for row in rows}
    seen = 0
    for one in case.sent:
        if one.fields is None or one in case.unproven:
            continue
        number = first[one.frames[0]]
        found = got.message_of(number)
        if one.status not in ("ok", "bad crc"):
            assert found is None, one.why
            continue
        table, row = found
        assert table == one.name
        assert row["trusted"] == (one.status == "ok")
        if one.status == "bad crc":
            continue
        assert differing(physical(one.name, one.fields), row) == {}, (one.name, one.frames)
        assert row["bits_left"] >= 0
        assert not row["pad_nonzero"]
        seen += 1
        if one.packet:
            check_packet(packets[number, one.packet[0]], *one.packet)
    assert seen == sum(one.status == "ok" and one.fields is not None for one in case.sent)


def check_packet(row: dict[str, Any], name: str, values: dict[str, Any]) -> None:
    assert row["packet_ok"], name
    assert row["header_ok"]
    assert row["length_ok"]
    assert row["checksum_ok"]
    motor = name.endswith("MotorStatus")
    for field, raw in values.items():
        shown = row[field]
        if field.endswith("version"):
            assert bytes(shown) == raw.ljust(16, b"\0")
            assert row[f"{field}.text"] == raw.decode()
        elif motor and field in SCALES:
            assert shown == pytest.approx(raw * SCALES[field], abs=1e-9), field
        elif field == "unit_id":
            assert shown == raw
        else:
            assert same(raw, shown), (field, raw, shown)


def test_packets_follow_each_other(decoded: dict[str, Any]) -> None:
    for table in ("PUSHCAN.MotorStatus", "PUSHCAN.FocFeedback"):
        rows = decoded["hover.log"].messages[table]
        assert {row["count_step"] for row in rows} <= {None, 1}
    steps = [row["count_step"] for row in decoded["hover.log"].messages["PUSHCAN.MotorStatus"]]
    assert steps.count(None) == 4  # the first of each node


@pytest.mark.parametrize("name", ORDERED)
def test_verdicts(decoded: dict[str, Any], name: str) -> None:
    case, got = CASES[name], decoded[name]
    stated = {number: verdict for number, verdict in case.verdicts.items() if verdict}
    assert {number: got.verdicts[number - 1] for number in stated} == stated
    free = [got.verdicts[number - 1] for number, verdict in case.verdicts.items() if not verdict]
    assert "used" not in free


@pytest.mark.parametrize("name", ORDERED)
def test_events(decoded: dict[str, Any], name: str) -> None:
    case, got = CASES[name], decoded[name]
    rows = [row for row in got.events if row["kind"] != "gap"]
    assert [(row["line"], row["kind"]) for row in rows] == case.events


def test_what_the_events_say(decoded: dict[str, Any]) -> None:
    by_kind: dict[str, list[dict[str, Any]]] = {}
    for row in decoded["faults.log"].events:
        by_kind.setdefault(row["kind"], []).append(row)
    errors = by_kind["error frame"]
    assert [(row["class"], row["tx_errors"], row["rx_errors"]) for row in errors] == [
        (0x204, 0x60, 0),
        (0x204, 0x80, 0),
    ]
    assert [row["class"] for row in by_kind["drop"]] == [3]
    assert "1773475331.6003 can0 1F0406" in by_kind["unreadable"][0]["text"]


@pytest.mark.parametrize("name", ["hover.log", "fd.log", "services.log"])
def test_a_good_capture_shows_nothing_odd(decoded: dict[str, Any], name: str) -> None:
    got = decoded[name]
    marks = {anomaly for row in [*got.transfers, *got.frames] for anomaly in row["anomaly"]}
    assert marks == ({"can fd"} if name == "fd.log" else set())
    steps = {row["step"] for row in got.transfers if row["kind"] != "anonymous"}
    assert steps <= {None, 1}


@pytest.mark.parametrize("name", ORDERED)
def test_the_public_door_gives_the_same(decoded: dict[str, Any], name: str) -> None:
    capture = open_capture(make_captures.FOLDER / name)
    table = capture.table("transfers")
    assert table.num_rows == len(decoded[name].transfers)
    assert table.column("payload").to_pylist() == [row["payload"] for row in decoded[name].transfers]
    assert capture.totals.balanced
    assert capture.totals == decoded[name].engine.totals
    source = Source(str(make_captures.FOLDER / name))
    assert b"".join(source.chunks()) == CASES[name].text.encode()
