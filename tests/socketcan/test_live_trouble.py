"""`tailbyte live` on SocketCAN when the bus is ill, the interface goes away, or more comes than can be taken."""

from __future__ import annotations

import json
import subprocess
import threading
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from kit.command import wait_until
from kit.judged import registry
from kit.live import Lost, frames_in, stored
from kit.monitor import batches
from kit.rows import Fault, Frame
from socketcan.kernel import SlcanAdapter, ip
from socketcan.sessions import (
    NAMES,
    UNPRIVILEGED,
    Sender,
    Witness,
    dropped,
    findings,
    frames_of,
    judged,
    note,
    numbered,
    numbers,
    quiet,
)

from analyzer.board.board import Board

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    Command = Callable[..., tuple[int, str, str]]

# linux/can/error.h
CONTROLLER, PROTOCOL, ACK, BUS_OFF, BUS_ERROR, COUNTERS = 0x4, 0x8, 0x20, 0x40, 0x80, 0x200
BIT = PROTOCOL | BUS_ERROR
SAID = [
    (BIT | ACK, "0000001900000000"),  # no acknowledge
    (BIT, "0000080000000000"),  # a dominant bit, a recessive one
    (BIT, "0000100000000000"),
    (BIT, "0000010800000000"),  # checksum
    (BIT, "0000020000000000"),  # form
    (BIT, "0000040000000000"),  # stuffing
    (BIT | CONTROLLER, "0001000000000000"),  # overrun of the receiver, of the transmitter
    (BIT | CONTROLLER, "0002000000000000"),
    (CONTROLLER | COUNTERS, "0004000000001464"),  # warning, with the counters of both sides
    (CONTROLLER | COUNTERS, "0010000000006182"),  # passive
    (BUS_OFF, "0000000000000000"),
]
ROOM = Path("/proc/sys/net/core/rmem_max")


@pytest.fixture
def vcan7() -> Iterator[str]:
    """An interface that may come and go."""
    add()
    yield "vcan7"
    subprocess.run(["ip", "link", "del", "vcan7"], check=False, capture_output=True)


@pytest.fixture
def little_room() -> Iterator[int]:
    """Frames that fit into the receive buffer of somebody without privileges, about."""
    before = ROOM.read_text()
    ROOM.write_text("49152")
    yield 2 * 49152 // 768
    ROOM.write_text(before)


def add() -> None:
    ip("add", "vcan7", "type", "vcan")
    ip("set", "vcan7", "up")


def test_error_frames(command: Command, tmp_path: Path) -> None:
    """Each bus error, the states of the controller with its counters, up to bus off; the board has them, too."""
    adapter = SlcanAdapter(500_000)
    recording = tmp_path / "x.log"
    try:
        with quiet(tmp_path, [adapter.channel], recording.name) as session:
            for kind in "abBcfsoO":
                adapter.errors(kind)
            adapter.state("w", 100, 20)
            adapter.state("p", 130, 97)
            adapter.frame(0x1234, b"ab")
            adapter.state("b", 0, 255)
            wait_until(lambda: "bus-off" in said(adapter.channel))
            status = session.end()
        rows = stored(recording)
        faults = [row for row in rows if isinstance(row, Fault)]
        assert session.counts(adapter.channel) == (1, 0)
        errors = f"{len(faults)} error frames"
        assert f"-- {adapter.channel}: 1 frames = 1 received + 0 dropped; {errors} received\n" in session.said
        assert f"-- recorded: 1 frames and {errors}, " in session.said
    finally:
        adapter.unplug()

    assert [(fault.error, fault.data.hex()) for fault in faults] == SAID
    board = Board(registry(), {adapter.channel: 500_000})
    states = []
    for batch in batches(recording.read_bytes(), 1):
        board.feed(batch, 0)
        (bus,) = board.snapshot(0).buses
        states.append((bus.controller, bus.tx_errors, bus.rx_errors))
    assert list(dict.fromkeys(states)) == [
        ("", None, None), ("error-warning", 20, 100), ("error-passive", 97, 130), ("bus-off", 97, 130),
    ]  # fmt: skip
    for text in ("no acknowledge", "stuffing error", "receive passive, error counters tx 97 rx 130", "bus-off"):
        assert text in session.said
    assert (status, findings(tmp_path / "x.log.json")) == judged(command, recording, "--bitrate", "500000")


def said(name: str) -> str:
    """What the kernel says of it."""
    return subprocess.run(["ip", "-d", "link", "show", name], check=True, capture_output=True, text=True).stdout.lower()


def test_more_than_can_be_taken(command: Command, little_room: int, tmp_path: Path) -> None:
    """At full speed into a small buffer, in every format: what is lost is counted, and where it was lost."""
    count, pause = 20_000, 1000
    with ExitStack() as stack:
        made = [quiet(tmp_path, ["vcan0"], name, prefix=UNPRIVILEGED) for name in NAMES]
        sessions = [stack.enter_context(one) for one in made]
        sender = stack.enter_context(Sender("vcan0"))
        sender.send(*numbered(pause))
        with ExitStack() as still:
            for session in sessions:
                still.enter_context(session.stopped())
            sender.send(*numbered(pause, first=pause))
        sender.send(*numbered(count - 2 * pause, first=2 * pause))
        status = [session.end() for session in sessions]
    for name, session, ended in zip(NAMES, sessions, status, strict=True):
        assert ", less than asked for: that takes CAP_NET_ADMIN or net.core.rmem_max\n" in session.said
        received, lost = session.counts("vcan0")
        rows = stored(tmp_path / name)
        assert received + lost == count
        assert lost >= pause - 2 * little_room
        assert (len(frames_of(rows)), dropped(rows)) == (received, lost)
        expected = 0
        for row in rows:  # each loss stands in front of the first frame after it
            if isinstance(row, Lost):
                expected += row.frames
            elif isinstance(row, Frame):
                assert numbers([row]) == [expected]
                expected += 1
        live = findings(tmp_path / f"{name}.json")
        assert (ended, live) == judged(command, tmp_path / name)
        assert "CAP-004" in {json.loads(one)["rule"] for one in live}


@pytest.mark.usefixtures("little_room")
def test_losses_are_no_errors_of_the_bus(command: Command, tmp_path: Path) -> None:
    """A flight, while nobody empties the socket now and then: nothing is made out of what is missing.

    Beside it the whole flight is recorded, which shows what comes of a machine that sends late.
    """
    recording, whole = tmp_path / "x.pcapng", tmp_path / "whole.pcapng"
    with (
        Witness("vcan0") as witness,
        quiet(tmp_path, ["vcan0"], whole.name) as other,
        quiet(tmp_path, ["vcan0"], recording.name, prefix=UNPRIVILEGED) as session,
    ):
        landed = threading.Event()

        def disturb() -> None:
            for _ in range(3):
                count = len(witness.heard) + 500
                wait_until(lambda count=count: landed.is_set() or len(witness.take()) >= count)
                with session.stopped():
                    count = len(witness.heard) + 400
                    wait_until(lambda count=count: landed.is_set() or len(witness.take()) >= count)

        disturber = threading.Thread(target=disturb)
        disturber.start()
        assert command("simulate", "vcan0", "--duration", "8")[0] == 0
        landed.set()
        disturber.join()
        status, _ = session.end(), other.end()
        sent = len(witness.take())
    assert other.counts("vcan0") == (sent, 0)
    received, lost = session.counts("vcan0")
    assert received + lost == sent
    assert lost > 0
    assert dropped(stored(recording)) == lost
    live = findings(tmp_path / "x.pcapng.json")
    ended, later = judged(command, recording)
    assert [one for one in live if one not in later] == [one for one in later if one not in live]
    assert (status, live) == (ended, later)
    seen, usual = (
        {(one["rule"], one["severity"]) for one in map(json.loads, found) if one["severity"] != "note"}
        for found in (live, findings(tmp_path / "whole.pcapng.json"))
    )
    # A slow machine is stopped for so long that each loss takes the one status of a second: that node was silent.
    assert seen - usual - {("BUS-020", "warning")} == {("CAP-004", "warning")}
    assert "frames were lost or not recorded there: TRF-" in session.shown


def test_an_interface_that_comes_and_goes(tmp_path: Path, vcan7: str) -> None:
    """One session, beside another interface: down at the beginning, up, down, up, removed, and back as another one."""
    said = (
        "is down, waiting (ip link set vcan7 up)", "link up after ", "link down", "link up after ",
        "removed, waiting for it to come back", "back after ",
    )  # fmt: skip
    recording = tmp_path / "x.mcap"

    def recorded(count: int) -> None:
        wait_until(lambda: len(frames_of(frames_in(recording))) == count)

    ip("set", vcan7, "down")
    with quiet(tmp_path, [vcan7, "vcan0"], recording.name) as session, Sender(vcan7) as sender:
        session.until(f"-- vcan7: {said[0]}")
        ip("set", vcan7, "up")
        session.until(f"-- vcan7: {said[1]}")
        sender.send(*numbered(100))
        recorded(100)
        ip("set", vcan7, "down")
        session.until(f"-- vcan7: {said[2]}")
        ip("set", vcan7, "up")
        wait_until(lambda: session.said.count(f"-- vcan7: {said[3]}") == 2)
        sender.send(*numbered(100, first=100))
        recorded(200)
        ip("del", vcan7)
        session.until(f"-- vcan7: {said[4]}")
        add()
        session.until(f"-- vcan7: {said[5]}")
        sender.send(*numbered(100, first=200))
        session.end()
        assert [session.counts(name) for name in (vcan7, "vcan0")] == [(300, 0), (0, 0)]
    rows = stored(recording)
    told = [(text, len(frames_of(rows[:at]))) for at, text in enumerate(map(note, rows)) if text and "vcan7: " in text]
    assert [count for _, count in told[:6]] == [0, 0, 100, 100, 200, 200]
    assert [text[: len(f"vcan7: {one}")] for (text, _), one in zip(told, said, strict=False)] == [
        f"vcan7: {one}" for one in said
    ]
    # It may have been seen before it was up.
    assert [(text[:20], count) for text, count in told[6:]] in ([], [("vcan7: link up after", 200)])
    assert numbers(rows) == list(range(300))


def test_another_name(tmp_path: Path, vcan7: str) -> None:
    """The session stays with its interface, and says what that is called."""
    recording = tmp_path / "x.log"
    with quiet(tmp_path, [vcan7], recording.name) as session:
        ip("set", vcan7, "down")
        ip("set", vcan7, "name", "vcan9")
        ip("set", "vcan9", "up")
        session.until("-- vcan7: is called vcan9 now")
        with Sender("vcan9") as sender:
            sender.send(*numbered(10))
            wait_until(lambda: len(frames_of(frames_in(recording))) == 10)
        session.end()
        assert session.counts(vcan7) == (10, 0)
    subprocess.run(["ip", "link", "del", "vcan9"], check=True)
    assert any(text and "vcan7: is called vcan9 now" in text for text in map(note, stored(recording)))


def test_missing(command: Command, tmp_path: Path) -> None:
    recording = tmp_path / "x.log"
    said = "tailbyte: vcan8: no such interface (there is vcan0, vcan1, vxcan1, vxcan0)\n"
    assert command("live", "vcan0", "vcan8", "-w", recording) == (3, "", said)
    assert not recording.exists()
