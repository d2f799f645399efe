"""`tailbyte live` as a process of its own, what is sent to it, and an independent look at what the kernel has."""

from __future__ import annotations

import json
import signal
import socket
import struct
import subprocess
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Self

from kit.command import LAUNCH, LIMIT, environment, wait_until
from kit.live import Lost, Note, Row
from kit.rows import EXTENDED, FD, REMOTE, RX, TX, Frame

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from types import TracebackType

    Command = Callable[..., tuple[int, str, str]]

# A recording in each format.
NAMES = ("x.log", "x.mcap", "x.pcapng")
# As a user without CAP_NET_ADMIN, whose receive buffer cannot be larger than net.core.rmem_max.
UNPRIVILEGED = ("setpriv", "--bounding-set", "-net_admin")
LONG, ASKS = 1 << 31, 1 << 30
_HEAD = struct.Struct("=IBBxB")
_CLASSIC, _LONGEST = 16, 72
_STAMPS, _RCVBUFFORCE, _MEMINFO = 35, 33, 55
_BUFFER = 64 << 20


class Session:
    """One session, which listens when this has been made; killed at the end of `with` if it still runs.

    Args:
        folder: for what it says.
        names: its interfaces.
        args: its options.
        prefix: what runs the command.
        output: where standard output goes if not to a file.
    """

    def __init__(
        self, folder: Path, names: Sequence[str], *args: object, prefix: Sequence[str] = (), output: int | None = None
    ) -> None:
        number = len(list(folder.glob("*.err")))
        self._out, self._err = folder / f"{number}.out", folder / f"{number}.err"
        command = [*prefix, *LAUNCH, "live", *names, *map(str, args)]
        with self._out.open("wb") as out, self._err.open("wb") as err:
            self.process = subprocess.Popen(command, env=environment(), stdout=output or out, stderr=err)
        self._names = names

    def ready(self) -> Self:
        """All interfaces are open."""
        for name in self._names:
            self.until(f"-- {name}: receive buffer of ")
        return self

    def __enter__(self) -> Self:
        return self.ready()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(LIMIT)

    @property
    def said(self) -> str:
        """On standard error, so far."""
        return self._err.read_text()

    def until(self, text: str) -> None:
        """Waits until it has said so."""

        def found() -> bool:
            ended = self.process.poll() is not None
            if text not in self.said:
                assert not ended, self.said
                return False
            return True

        wait_until(found)

    def tell(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    @contextmanager
    def stopped(self) -> Iterator[None]:
        """None of its threads runs."""
        self.tell(signal.SIGSTOP)
        tasks = Path(f"/proc/{self.process.pid}/task")
        wait_until(lambda: all(state(task) == "T" for task in tasks.iterdir()))
        try:
            yield
        finally:
            self.tell(signal.SIGCONT)

    def wait(self) -> int:
        """It ends by itself: its exit status."""
        return self.process.wait(LIMIT)

    def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        """Its exit status."""
        self.tell(number)
        return self.wait()

    @property
    def shown(self) -> str:
        """On standard output."""
        return self._out.read_text()

    def counts(self, name: str) -> tuple[int, int]:
        """Frames received and dropped, as it says at its end."""
        head = f"-- {name}: "
        (line,) = (line for line in self.said.splitlines() if line.startswith(head) and " received + " in line)
        total, _, parts = line.partition("; ")[0].removeprefix(head).replace(",", "").partition(" frames = ")
        received, _, dropped = parts.removesuffix(" dropped").partition(" received + ")
        assert int(total) == int(received) + int(dropped)
        return int(received), int(dropped)


def state(task: Path) -> str:
    """Of a thread, as ps has it."""
    return (task / "stat").read_text().rpartition(")")[2].split()[0]


class Sender:
    """Sends to one interface, whatever becomes of it."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._socket: socket.socket | None = None
        self.sent = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._socket is not None:
            self._socket.close()

    def send(self, *frames: Frame) -> None:
        for frame in frames:
            self.raw(word(frame))

    def raw(self, data: bytes) -> None:
        if self._socket is None:
            self._open()
        try:
            self._socket.send(data)
        except OSError:  # it has been removed, or was, or is down
            self._open()
            self._socket.send(data)
        self.sent += 1

    def _open(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        self._socket.bind((self._name,))


def word(frame: Frame) -> bytes:
    """A frame as the kernel takes it."""
    number = frame.id | (LONG if frame.flags & EXTENDED else 0) | (ASKS if frame.flags & REMOTE else 0)
    if frame.flags & FD:
        return (_HEAD.pack(number, len(frame.data), frame.flags >> 4 & 3, 0) + frame.data).ljust(_LONGEST, b"\0")
    length, code = (min(frame.code, 8), 0) if frame.flags & REMOTE else (len(frame.data), frame.code)
    return (_HEAD.pack(number, length, 0, code) + frame.data).ljust(_CLASSIC, b"\0")


def frame(name: str, t: int, data: bytes, *, own: bool) -> Frame:
    """A frame as the kernel gives it."""
    number, length, bits, code = _HEAD.unpack_from(data)
    flags = (EXTENDED if number & LONG else 0) | (TX if own else RX)
    id_, body = number & (0x1FFF_FFFF if number & LONG else 0x7FF), data[_HEAD.size : _HEAD.size + length]
    if len(data) == _LONGEST:
        return Frame(t, name, id_, flags | FD | (bits & 3) << 4, body)
    if number & ASKS:
        return Frame(t, name, id_, flags | REMOTE, b"", length)
    return Frame(t, name, id_, flags, body, code if code > 8 else 0)


class Witness:
    """Hears what an interface has from now on, with the kernel's times, and reads it later."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        for level, option, value in (
            (socket.SOL_SOCKET, _RCVBUFFORCE, _BUFFER),
            (socket.SOL_SOCKET, _STAMPS, 1),
            (socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1),
        ):
            self._socket.setsockopt(level, option, value)
        self._socket.bind((name,))
        self.heard: list[Frame] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def take(self) -> list[Frame]:
        """All so far."""
        with suppress(BlockingIOError):
            while True:
                data, extra, flags, _ = self._socket.recvmsg(_LONGEST, 64, socket.MSG_DONTWAIT)
                seconds, ns = struct.unpack("=qq", extra[0][2])
                own = bool(flags & socket.MSG_DONTROUTE)
                self.heard.append(frame(self._name, seconds * 10**9 + ns, data, own=own))
        (lost,) = struct.unpack_from("=I", self._socket.getsockopt(socket.SOL_SOCKET, _MEMINFO, 36), 32)
        assert lost == 0
        return self.heard

    def until(self, count: int) -> None:
        """Waits until it has heard so many."""
        wait_until(lambda: len(self.take()) >= count)


class Paced:
    """So many frames a second, no faster; on a machine that is late fewer."""

    def __init__(self, rate: float, step: int = 1) -> None:
        self._start, self._rate, self._step, self._count = time.monotonic(), rate, step, 0

    def wait(self) -> None:
        """Wait until the next `step` frames are due."""
        self._count += self._step
        time.sleep(max(0.0, self._start + self._count / self._rate - time.monotonic()))


def frames_of(rows: Iterable[Row]) -> list[Frame]:
    return [row for row in rows if isinstance(row, Frame)]


def dropped(rows: Iterable[Row]) -> int:
    return sum(row.frames for row in rows if isinstance(row, Lost))


def note(row: Row) -> str | None:
    """What a comment says."""
    return row.text.removeprefix("# ") if isinstance(row, Note) else None


def notes(rows: Iterable[Row]) -> list[str]:
    return [text for text in map(note, rows) if text is not None]


def numbered(count: int, name: str = "vcan0", first: int = 0) -> list[Frame]:
    """Frames that tell their numbers; with few identifiers, since each is a finding."""
    return [Frame(0, name, n & 0xFF, 0, n.to_bytes(8, "big")) for n in range(first, first + count)]


def numbers(rows: Iterable[Row]) -> list[int]:
    """Of `numbered` frames."""
    return [int.from_bytes(row.data, "big") for row in frames_of(rows)]


def findings(path: Path) -> list[str]:
    """What a report in JSON found, to the byte; one each, so that those which differ are seen."""
    return list(map(json.dumps, json.loads(path.read_bytes())["findings"]))


def quiet(folder: Path, names: Sequence[str], recording: str, *args: object, prefix: Sequence[str] = ()) -> Session:
    """A session that records to a file in a folder, and reports beside it."""
    path = folder / recording
    return Session(folder, names, "-q", "-w", path, "--json", f"{path}.json", *args, prefix=prefix)


def judged(command: Command, recording: Path, *args: object) -> tuple[int, list[str]]:
    """What `check` says of a recording: its exit status and the findings."""
    report = recording.with_name(f"{recording.name}.check.json")
    status = command("check", recording, "--json", report, *args)[0]
    return status, findings(report)
