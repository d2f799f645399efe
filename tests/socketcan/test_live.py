"""`tailbyte live` on SocketCAN: what it records is what was sent, and judged as `check` does."""

from __future__ import annotations

import json
import signal
import subprocess
from contextlib import ExitStack
from itertools import chain
from typing import TYPE_CHECKING

from kit.command import CAPTURES, HOVER, Reader, wait_until
from kit.live import stored
from kit.rows import EXTENDED, FD, REMOTE, RX, TX, Frame
from socketcan.kernel import SlcanAdapter, ip
from socketcan.sessions import (
    NAMES,
    Sender,
    Session,
    Witness,
    findings,
    frames_of,
    judged,
    note,
    notes,
    numbered,
    quiet,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

FAULTY = CAPTURES / "mission-8-faults.log"
NOTHING_TO_JUDGE = 4
ENDS = (signal.SIGTERM, signal.SIGINT, signal.SIGTERM)
BRS, ESI = 16, 32
# What an interface without CAN FD takes, and what else there is.
PLAIN = (
    Frame(id=0x123, data=b"abc"),
    Frame(id=0),
    Frame(id=0x7FF, data=bytes(range(8))),
    Frame(id=0x123, flags=EXTENDED, data=b"\xff"),
    Frame(id=0x1FFF_FFFF, flags=EXTENDED, data=bytes(8)),
    Frame(id=0x321, flags=REMOTE, code=0),
    Frame(id=0x321, flags=REMOTE | EXTENDED, code=4),
    Frame(id=0x40, data=b"12345678", code=13),
)
FLEXIBLE = (
    Frame(id=0x100, flags=FD, data=b"12345678"),
    Frame(id=0x18DA_F110, flags=FD | EXTENDED | BRS, data=bytes(range(64))),
    Frame(id=0x101, flags=FD | BRS | ESI, data=bytes(12)),
    Frame(id=0x102, flags=FD),
)


def test_what_is_recorded_is_what_was_sent_and_judged_as_check_does(command: Command, tmp_path: Path) -> None:
    """Two interfaces, all kinds of frames and a flight with faults, marks among them; in every format."""
    names = ("vcan0", "vcan1")
    with ExitStack() as stack:
        witnesses = [stack.enter_context(Witness(name)) for name in names]
        made = [quiet(tmp_path, names, name) for name in NAMES]
        sessions = [stack.enter_context(one) for one in made]
        one, other = (stack.enter_context(Sender(name)) for name in names)
        for frame in (*PLAIN, *FLEXIBLE, *numbered(200)):
            one.send(frame)
            other.send(frame if not frame.flags & FD else PLAIN[0])
        for session in sessions:
            session.tell(signal.SIGUSR1)
            session.until("-- mark 1\n")
        assert command("replay", FAULTY, "vcan0", "--speed", "max")[0] == 0
        status = [session.end(number) for session, number in zip(sessions, ENDS, strict=True)]
        heard = [witness.take() for witness in witnesses]
    counts = [212 + len(frames_of(stored(FAULTY))), 212]
    assert [len(each) for each in heard] == counts
    assert {frame.flags & (TX | RX) for frame in heard[0]} == {TX}
    expected = sorted(chain(*heard), key=lambda frame: frame.t)
    for name, session, ended in zip(NAMES, sessions, status, strict=True):
        rows = stored(tmp_path / name)
        assert [session.counts(each) for each in names] == [(count, 0) for count in counts]
        assert frames_of(rows) == expected, name
        assert [text for text in notes(rows) if "mark" in text] == ["mark 1"]
        live = findings(tmp_path / f"{name}.json")
        assert (ended, live) == judged(command, tmp_path / name)
        assert len(live) > 5
        assert ended == 1


def test_direction(tmp_path: Path) -> None:
    """What came from the other end is received, what this machine sent here is not; three are enough."""
    recording = tmp_path / "x.log"
    with (
        quiet(tmp_path, ["vxcan0"], recording.name, "-c", "3") as session,
        Sender("vxcan0") as here,
        Sender("vxcan1") as there,
    ):
        here.send(PLAIN[0])
        there.send(PLAIN[1])
        here.send(PLAIN[3], *numbered(100))
        session.wait()
        assert "-- enough: 3 " in session.said
    found = frames_of(stored(recording))
    assert [(frame.id, frame.flags) for frame in found] == [(0x123, TX), (0, RX), (0x123, TX | EXTENDED)]
    lines = [line for line in recording.read_text().splitlines() if line.startswith("(")]
    assert [line[-2:] for line in lines[-3:]] == [" T", " R", " T"]


def test_the_kernel_filters(tmp_path: Path) -> None:
    """What is filtered away takes no room, not even when nobody empties the socket."""
    wanted = Frame(id=0x456, flags=EXTENDED, data=b"b"), Frame(id=0x123, data=b"a")
    recording, filters = tmp_path / "x.log", ("-f", "123:7FF", "-f", "00000456:1FFFFFFF")
    with quiet(tmp_path, ["vcan0"], recording.name, *filters) as session:
        with session.stopped(), Sender("vcan0") as sender:
            sender.send(wanted[0])
            for _ in range(12_000):  # more than there is room for
                sender.send(Frame(id=0x124))
            sender.send(wanted[1])
        assert session.end() == NOTHING_TO_JUDGE
        assert session.counts("vcan0") == (2, 0)
    found = frames_of(stored(recording))
    assert [(frame.id, frame.data) for frame in found] == [(frame.id, frame.data) for frame in wanted]


def test_the_time_limit_ends_it(tmp_path: Path) -> None:
    with quiet(tmp_path, ["vcan0"], "x.log", "-a", "duration:1") as session:
        assert session.wait() == NOTHING_TO_JUDGE
        assert "-- enough: 1 s are over\n" in session.said


def test_a_list_into_a_pipe_while_it_goes_on(tmp_path: Path) -> None:
    """Transfers come out at once, a mark stands between them, and it ends when nobody reads any more."""
    recording, hover = tmp_path / "x.mcap", frames_of(stored(HOVER))
    options = ("-T", "jsonl", "-w", recording)
    with Session(tmp_path, ["vcan0"], *options, output=subprocess.PIPE) as session, Sender("vcan0") as sender:
        assert session.process.stdout is not None
        reader = Reader(session.process.stdout.fileno())
        sender.send(*hover[:200])
        reader.until(b'{"frame":197,')  # with the last of them
        session.tell(signal.SIGUSR1)
        session.until("-- mark 1\n")
        sender.send(*hover[200:400])
        lines = reader.until(b'{"frame":400,').splitlines()[:-1]
        assert len([json.loads(line) for line in lines]) > 100
        session.process.stdout.close()
        sender.send(*hover[400:600])
        session.wait()
    rows = stored(recording)
    assert [row.data for row in frames_of(rows)] == [frame.data for frame in hover[:600]]
    assert len(frames_of(rows[: [*map(note, rows)].index("mark 1")])) == 200


def test_the_interfaces_that_there_are(command: Command) -> None:
    adapter = SlcanAdapter(250_000)
    try:
        ip("set", adapter.channel, "down")
        ip("set", adapter.channel, "type", "can", "listen-only", "on")
        ip("set", adapter.channel, "up")
        ip("set", "vcan1", "down")
        adapter.state("w", 100, 97)
        wait_until(lambda: "error warning" in command("live", "-D")[1])
        status, out, err = command("live", "-D")
    finally:
        ip("set", "vcan1", "up")
        adapter.unplug()
    lines = [line.split() for line in out.splitlines()]
    assert (status, err) == (0, "")
    assert ["vcan0", "vcan", "up", "-", "-", "-", "FD"] in lines
    assert ["vcan1", "vcan", "down", "-", "-", "-", "classic"] in lines
    assert [adapter.channel, "can", "error", "warning", "250k", "-", "never", "classic"] in lines
    assert ["modes:", "listen", "only"] in lines
