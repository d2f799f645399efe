"""`tailbyte live` on SocketCAN for a long time: files that follow each other, the end by force, a full bus."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import ExitStack
from typing import TYPE_CHECKING, Self

from kit.command import wait_until
from kit.judged import registry
from kit.live import frames_in, stored
from kit.rows import EXTENDED, Frame
from socketcan.sessions import (
    NAMES,
    Paced,
    Sender,
    Witness,
    dropped,
    findings,
    frames_of,
    judged,
    numbered,
    numbers,
    quiet,
    word,
)

from analyzer.simulate import Simulation, SimulationSettings

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

SECOND = 10**9
# Status messages a second of each ESC that make 7,600 frames a second or more, which fill a bus of 1 Mbit/s; they are
# sent in small groups. How long can be told from outside.
FULL, GROUP = 255, 38
ENOUGH = 300  # frames, which are not the first ones any more
LASTING = float(os.environ.get("TAILBYTE_FULL_BUS_SECONDS", "10"))


class Traffic:
    """Numbered frames at a steady pace, from the beginning of `with` to its end."""

    def __init__(self, name: str, rate: float) -> None:
        self._sender, self._pace = Sender(name), Paced(rate, 10)
        self._thread = threading.Thread(target=self._run)
        self._ended = threading.Event()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def sent(self) -> int:
        return self._sender.sent

    def stop(self) -> None:
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        with self._sender as sender:
            while not self._ended.is_set():
                sender.send(*numbered(10, first=sender.sent))
                self._pace.wait()


def test_files_that_follow_each_other(tmp_path: Path) -> None:
    """By size and by time, all of them and the last few: no frame is lost between two."""
    rings = {
        "x.log": ("-b", "filesize:40"),
        "x.mcap": ("-b", "packets:700"),
        "x.pcapng": ("-b", "duration:1", "-b", "files:3"),
    }
    with ExitStack() as stack:
        made = [quiet(tmp_path, ["vcan0"], name, *ring) for name, ring in rings.items()]
        sessions = [stack.enter_context(one) for one in made]
        with Traffic("vcan0", 1500) as traffic:
            for name in rings:
                wait_until(lambda form=name[1:]: any(tmp_path.glob(f"x_00004_*{form}")))
        for session in sessions:
            session.end()
            assert session.counts("vcan0") == (traffic.sent, 0)
    for name in rings:
        files = sorted(tmp_path.glob(f"x_*{name[1:]}"))
        parts = [numbers(stored(file)) for file in files]
        found = [number for part in parts for number in part]
        last = list(range(traffic.sent))
        if name == "x.pcapng":
            assert len(files) == 3
            assert 0 < len(found) < len(last)
            assert found == last[-len(found) :]
        else:
            assert len(files) > 3
            assert found == last
        assert all(parts)
        if name == "x.mcap":
            assert {len(part) for part in parts[:-1]} == {700}


def test_a_file_that_is_moved_away(tmp_path: Path) -> None:
    """SIGHUP begins the recording anew under its name; no frame is lost between the two files."""
    path, moved = tmp_path / "x.mcap", tmp_path / "moved.mcap"
    with quiet(tmp_path, ["vcan0"], path.name) as session, Traffic("vcan0", 1500) as traffic:
        wait_until(lambda: len(frames_in(path)) > 100)
        path.rename(moved)
        session.tell(signal.SIGHUP)
        wait_until(lambda: len(frames_in(path)) > 100)
        traffic.stop()
        session.end()
        assert session.counts("vcan0") == (traffic.sent, 0)
    assert numbers([*stored(moved), *stored(path)]) == list(range(traffic.sent))


def test_killed(tmp_path: Path) -> None:
    """What could be read while it was written is still there, and no frame of it is wrong."""
    with ExitStack() as stack, Witness("vcan0") as witness:
        made = [quiet(tmp_path, ["vcan0"], name) for name in NAMES]
        sessions = [stack.enter_context(one) for one in made]
        with Traffic("vcan0", 1000):
            for name in NAMES:
                wait_until(lambda name=name: readable(tmp_path / name) > ENOUGH)
            before = [readable(tmp_path / name) for name in NAMES]
            for session in sessions:
                session.tell(signal.SIGKILL)
        assert [session.wait() for session in sessions] == [-signal.SIGKILL] * 3
        heard = witness.take()
    for name, count in zip(NAMES, before, strict=True):
        found = frames_of(stored(tmp_path / name, sound=False))
        assert found == heard[: len(found)]
        assert len(found) >= count > ENOUGH, name


def readable(path: Path) -> int:
    """Return how many frames a recording holds that is being written."""
    return len(frames_of(frames_in(path)))


def test_a_full_bus(command: Command, tmp_path: Path) -> None:
    """A clean flight of eight ESCs; what the session does not have, the kernel has counted."""
    flight = Simulation(SimulationSettings(escs=8, rate=FULL, duration=round(LASTING * SECOND)), registry())
    sent = [(frame.t, word(Frame(id=frame.id, flags=EXTENDED, data=frame.data))) for frame in flight.frames()]
    recording = tmp_path / "x.mcap"
    with quiet(tmp_path, ["vcan0"], recording.name) as session, Sender("vcan0") as sender:
        start, first = time.monotonic_ns(), sent[0][0]
        for t, data in sent:
            early = t - first - (time.monotonic_ns() - start)
            if early > 0 and sender.sent % GROUP == 0:
                time.sleep(early / SECOND)
            sender.raw(data)
        status = session.end()
    received, lost = session.counts("vcan0")
    assert received + lost == len(sent)
    rows = stored(recording)
    assert (len(frames_of(rows)), dropped(rows)) == (received, lost)
    assert (status, findings(tmp_path / "x.mcap.json")) == judged(command, recording)
