"""The native receiver of a socket, for which a local one stands in: a datagram is a row, a wait can be ended."""

from __future__ import annotations

import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from contextlib import suppress
from typing import TYPE_CHECKING

import pytest
from kit.command import LIMIT, environment, wait_until
from kit.rows import batch
from kit.waiting import FOREVER, Pair, classic, columns, fd, local_pair, longs, words

from analyzer._native import SocketReceiver
from analyzer.tables import RX

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

EXTENDED, REMOTE, ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000
TIMESTAMPNS = 35
SECOND = 1_000_000_000


# What the kernel hands over, and what candump writes for it.
KINDS = [
    (classic(0x123, b"abc"), "123#616263"),
    (classic(0x7FF), "7FF#"),
    (classic(EXTENDED | 0x1F040A0B, bytes(range(8))), "1F040A0B#0001020304050607"),
    (classic(EXTENDED | 5), "00000005#"),
    (classic(1, b"12345678", code=14), "001#3132333435363738_E"),
    (classic(REMOTE | 0x123), "123#R"),
    (classic(REMOTE | EXTENDED | 0x123, length=5), "00000123#R5"),
    (classic(REMOTE | 1, length=8, code=9), "001#R8_9"),
    (fd(0x123, 0, b""), "123##0"),
    (fd(EXTENDED | 5, 5, bytes(64)), "00000005##1" + "00" * 64),
    (fd(5, 6, b"12"), "005##23132"),
    (fd(5, 7, bytes(9)), "005##3" + "00" * 9),
    (classic(ERROR | 0x40, bytes(8)), "20000040#0000000000000000"),
    (classic(ERROR | 0x204, bytes([0, 0x20, 0, 0, 0, 0, 130, 7])), "20000204#0020000000008207"),
    (classic(ERROR | 0x8C, bytes([0, 0, 0x84, 0x19, 0, 0, 0, 0])), "2000008C#0000841900000000"),
]
NO_FRAMES = [
    b"",
    b"1234567",
    bytes(17),
    bytes(73),
    bytes(2000),
    classic(0x800),
    classic(1, length=9),
    struct.pack("=IBBxx64s", 1, 65, 0, b""),
    fd(REMOTE | 1, 0, b""),
    b"\xff" * 16,
    b"\xff" * 72,
]


@pytest.fixture
def pair() -> Iterator[Pair]:
    with local_pair() as made:
        yield made


def text(t: int, body: str) -> str:
    return f"({t // SECOND:010}.{t % SECOND:09}) can0 {body} R\n"


def aside(work: Callable[[], object]) -> threading.Thread:
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


def ends(thread: threading.Thread) -> None:
    wait_until(lambda: not thread.is_alive())


def test_frames_are_what_the_reader_of_a_recording_makes_of_them(pair: Pair) -> None:
    ours, theirs = pair
    receiver = SocketReceiver(ours.fileno(), "can0")
    before = time.time_ns()
    for datagram, _ in KINDS:
        theirs.send(datagram)
    assert receiver.receive(FOREVER) == receiver.waiting == len(KINDS)
    piece = receiver.take()
    frames, events = piece.columns()
    times = dict(
        zip(words(frames["line"]) + words(events["line"]), longs(frames["t"]) + longs(events["t"]), strict=True)
    )
    assert sorted(times) == list(range(1, len(KINDS) + 1))
    ordered = [times[line] for line in sorted(times)]
    assert before <= ordered[0] <= ordered[-1] <= time.time_ns()
    assert ordered == sorted(ordered)
    same = batch("".join(text(t, body) for t, (_, body) in zip(ordered, KINDS, strict=True)))
    assert columns(piece) == columns(same)
    assert (piece.lines, piece.buses, piece.stamps) == (same.lines, same.buses, same.stamps)
    assert piece.lines["error_frames"] == 3
    assert receiver.stamped == {"kernel": len(KINDS), "hardware": 0, "read": 0}


def test_rows_are_numbered_through_all_pieces(pair: Pair) -> None:
    ours, theirs = pair
    receiver = SocketReceiver(ours.fileno(), "can0")
    for number in (1, 2, 3):
        theirs.send(classic(number))
        assert receiver.receive(FOREVER) == 1
        piece = receiver.take()
        assert words(piece.columns()[0]["line"]) == [number]
        assert (piece.lines["lines"], piece.buses, receiver.waiting) == (1, ["can0"], 0)


@pytest.mark.parametrize("datagram", NO_FRAMES, ids=lambda datagram: f"{len(datagram)} bytes")
def test_what_is_no_frame_is_counted(datagram: bytes, pair: Pair) -> None:
    ours, theirs = pair
    receiver = SocketReceiver(ours.fileno(), "can0")
    for one in (classic(1), datagram, classic(2)):
        theirs.send(one)
    assert receiver.receive(FOREVER) == 3
    piece = receiver.take()
    assert (piece.frames, piece.lines["unreadable"], piece.lines["lines"]) == (2, 1, 3)
    frames, events = piece.columns()
    assert (words(frames["line"]), words(events["line"])) == ([1, 3], [2])
    assert events["text"].isascii()
    assert events["text"].decode().isprintable()
    assert events["t_valid"] is None


@pytest.mark.slow
def test_everything_that_is_sent_arrives_in_order(pair: Pair) -> None:
    ours, theirs = pair
    receiver = SocketReceiver(ours.fileno(), "can0")
    count, got, bodies = 100_000, 0, b""

    def send() -> None:
        for number in range(count):
            theirs.send(classic(EXTENDED | number, struct.pack("=I", number)))

    sender = aside(send)
    while got < count:
        rows = receiver.receive(LIMIT * 1000)
        assert rows, f"only {got}"
        got += rows
        piece = receiver.take()
        assert piece.frames == rows
        bodies += piece.columns()[0]["data"]
    ends(sender)
    assert words(bodies) == list(range(count))
    assert (receiver.receive(0), receiver.finish(), receiver.drops_now()) == (0, 0, 0)


def test_rows_that_nobody_takes_are_bounded(pair: Pair) -> None:
    ours, theirs = pair
    receiver = SocketReceiver(ours.fileno(), "can0")
    bound, count = 1 << 16, 70_000
    sender = aside(lambda: [theirs.send(classic(1)) for _ in range(count)])
    while receiver.waiting < bound:
        assert receiver.receive(LIMIT * 1000)
    assert receiver.waiting < bound + 256
    assert receiver.receive(FOREVER) == 0
    got = receiver.take().frames
    while got < count:
        assert receiver.receive(LIMIT * 1000)
        got += receiver.take().frames
    ends(sender)


def test_a_wait_can_be_ended(pair: Pair) -> None:
    ours, theirs = pair
    receiver = SocketReceiver(ours.fileno(), "can0")
    receiver.wake()  # before the wait: ends the next one, and only that
    got: list[int] = []

    def receive() -> None:
        got.append(receiver.receive(FOREVER))

    ends(aside(receive))
    second = aside(receive)
    assert (receiver.waiting, receiver.dropped, receiver.drops_now(), receiver.take().frames) == (
        0,
        0,
        0,
        0,
    )  # while it waits
    theirs.send(classic(1))
    ends(second)
    assert got == [0, 1]
    third = aside(receive)
    receiver.wake()
    ends(third)
    assert got == [0, 1, 0]


WAITING = r"""
import os, signal, sys
from analyzer._native import SocketReceiver
receiver = SocketReceiver(int(sys.argv[1]), "can0")
def mark(*_):
    receiver.wake()
    os.write(1, b"marked\n")
if sys.argv[2] == "handled":
    signal.signal(signal.SIGINT, mark)
try:
    print("waiting", flush=True)
    print(receiver.receive(int(sys.argv[3])), flush=True)
except KeyboardInterrupt:
    print("interrupted", receiver.waiting, flush=True)
"""


@pytest.mark.parametrize(("how", "said"), [("default", b"interrupted 0\n"), ("handled", b"marked\n0\n")])
def test_a_signal_reaches_python(how: str, said: bytes, pair: Pair) -> None:
    ours, _ = pair
    command = [sys.executable, "-c", WAITING, str(ours.fileno()), how, str(FOREVER)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, pass_fds=[ours.fileno()], env=environment()) as child:
        assert child.stdout
        assert child.stdout.readline() == b"waiting\n"

        for _ in range(LIMIT):  # once more as a person would who sees no effect: it may come just before the wait
            child.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                child.wait(1)
                break
        else:
            child.kill()
        assert said in child.stdout.read()


def test_a_peer_that_is_gone_leaves_its_frames(pair: Pair) -> None:
    ours, theirs = pair
    receiver = SocketReceiver(ours.fileno(), "can0")
    theirs.send(classic(1))
    theirs.close()
    assert (receiver.receive(FOREVER), receiver.receive(0), receiver.finish()) == (1, 0, 0)
    ours.shutdown(socket.SHUT_RDWR)
    with pytest.raises(ConnectionResetError):
        receiver.receive(FOREVER)
    ours.close()
    for _ in range(2):
        with pytest.raises(OSError, match="Bad file descriptor"):
            receiver.receive(FOREVER)
    assert (receiver.finish(), receiver.drops_now(), receiver.take().frames) == (0, 0, 1)


def test_no_socket_is_refused() -> None:
    with pytest.raises(OSError, match="Bad file descriptor"):
        SocketReceiver(-1, "can0")
    with open("/dev/null", "rb") as file, pytest.raises(OSError, match="non-socket"):  # noqa: PTH123
        SocketReceiver(file.fileno(), "can0")


def test_where_a_time_comes_from_is_said(pair: Pair) -> None:
    ours, theirs = pair
    receiver = SocketReceiver(ours.fileno(), "can0", hardware=True)
    theirs.send(classic(1))
    assert receiver.receive(FOREVER) == 1
    assert receiver.stamped == {"kernel": 1, "hardware": 0, "read": 0}  # no controller, so no clock of one
    ours.setsockopt(socket.SOL_SOCKET, TIMESTAMPNS, 0)
    before = time.time_ns()
    theirs.send(classic(2))
    assert receiver.receive(FOREVER) == 1
    assert receiver.stamped == {"kernel": 1, "hardware": 0, "read": 1}
    frames = receiver.take().columns()[0]
    assert before <= longs(frames["t"])[1] <= time.time_ns()
    assert memoryview(frames["flags"]).cast("H").tolist() == [RX, RX]
