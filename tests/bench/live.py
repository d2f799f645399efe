"""Measure receiving in one run: python tests/bench/live.py [LOG | --faults] [--seconds N] [--flushes N] [--runs N]

Another process plays a full bus of 1 Mbit/s, each frame at its time, into a pair of datagram sockets that stands in for
the kernel's CAN. The table shows which share of one core the receiving process takes: its own processor time, of all
threads, once it is warm. Without LOG eight ESCs that send as much as the bus carries are simulated. Every row is run
`--runs` times, in turn; the table shows medians. What is received and what is counted as dropped must be what was sent.

With --faults the frames are those of the logs of `make_faults`, and all rules judge them. Its log whose times jump is
left out: whoever receives stamps frames himself.
"""

from __future__ import annotations

import argparse
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench import make_faults

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from analyzer._native import FrameBatch

    Feed = Callable[[list[FrameBatch]], object]
    Over = Callable[[], bool]

BUS = "can0"
QUEUE = 8 << 20  # bytes
WARM = 2.0  # seconds
LONGEST = 4.0  # seconds between two batches, as live -q
TIMESTAMPNS = 35
RATE = 252  # status messages a second of each ESC: 7,600 frames
FULL = 7_600  # frames a second of a bus that is full of faults
FRAME = struct.Struct("=IB3x8s")
EXTENDED = 0x8000_0000
SHORT = 3  # digits of an identifier of 11 bits


def frames(path: Path) -> list[tuple[float, bytes]]:
    """Each frame of a log as the kernel lays it out, with its seconds from the first."""
    out = []
    for line in path.read_text().splitlines():
        stamp, _, frame = line.split()[:3]
        number, _, text = frame.partition("#")
        data = bytes.fromhex(text)
        flags = 0 if len(number) == SHORT else EXTENDED
        out.append((float(stamp[1:-1]), FRAME.pack(int(number, 16) | flags, len(data), data)))
    return [(t - out[0][0], frame) for t, frame in out]


def play(descriptor: int, path: Path) -> None:
    """The other process."""
    bus, log = socket.socket(fileno=descriptor), frames(path)
    start = time.perf_counter()
    for t, frame in log:
        early = start + t - time.perf_counter()
        if early > 0:
            time.sleep(early)
        bus.send(frame)
    sys.stdout.write(f"{len(log)}\n")


class Meter:
    """Processor time of this process from the end of the warm-up on, as a share of the time that passed."""

    def __init__(self) -> None:
        self._begin = time.monotonic() + WARM
        self._start: tuple[float, float] | None = None

    def tick(self) -> None:
        if self._start is None and time.monotonic() >= self._begin:
            self._start = time.monotonic(), time.process_time()

    @property
    def share(self) -> float:
        if self._start is None:
            raise ValueError(f"shorter than the {WARM} s that it takes to be warm")
        wall, own = self._start
        return (time.process_time() - own) / (time.monotonic() - wall)


def received(bus: socket.socket, pause: float, over: Over) -> Iterator[list[FrameBatch]]:
    """What has come, after each pause (s), and what is left when it is over. Pauses grow where a batch takes long."""
    from analyzer._native import SocketReceiver  # noqa: PLC0415 - the sending process does without
    from analyzer.app.live.batch_interval import BatchInterval  # noqa: PLC0415

    receiver, interval = SocketReceiver(bus.fileno(), BUS), BatchInterval(pause, max(pause, LONGEST))
    while not over():
        end = time.monotonic() + interval.seconds
        while (left := end - time.monotonic()) > 0:
            receiver.receive(round(left * 1000))
        start = time.monotonic()
        yield [receiver.take()]
        interval.took(time.monotonic() - start)
    receiver.finish()
    yield [receiver.take()]


def one_by_one(bus: socket.socket, pause: float, over: Over) -> Iterator[list[FrameBatch]]:
    """The same from an interface that has nothing better than python-can's way to receive."""
    from can.interfaces.socketcan import SocketcanBus  # noqa: PLC0415

    from analyzer.live.interfaces import drivers as buses  # noqa: PLC0415
    from analyzer.live.interfaces.filters import Filters  # noqa: PLC0415
    from analyzer.live.interfaces.naming import Interface  # noqa: PLC0415

    class Standing(SocketcanBus):
        """On a socket that is open already."""

        def __init__(self) -> None:
            self.socket, self.channel, self._is_filtered, self._filters = bus, BUS, False, None
            self._is_shutdown = True

    bus.setsockopt(socket.SOL_SOCKET, TIMESTAMPNS, 1)
    buses.open_bus = lambda _: Standing()
    receiver = buses.DriverReceiver(Interface("socketcan", BUS), Filters())
    while not over():
        end, pieces = time.monotonic() + pause, []
        while (left := end - time.monotonic()) > 0:
            if (piece := receiver.receive(left)) is not None:
                pieces.append(piece)
        yield pieces
    yield [*iter(lambda: receiver.receive(0), None), *receiver.finish()]


def nothing() -> Feed:
    return lambda _: None


def engine() -> Feed:
    from analyzer.decode.engine import Engine  # noqa: PLC0415

    running = Engine()

    def feed(pieces: list[FrameBatch]) -> None:
        for piece in pieces:
            for _ in running.feed(piece):
                pass
        running.flush()

    return feed


def rules() -> Feed:
    """Rules, and looks at what they have found."""
    from analyzer.app.process.start import end_start  # noqa: PLC0415
    from analyzer.decode.engine import Engine  # noqa: PLC0415
    from analyzer.report.newest import Newest  # noqa: PLC0415
    from analyzer.rules.checking import Check  # noqa: PLC0415
    from analyzer.rules.settings import Settings  # noqa: PLC0415

    running = Engine()
    check = Check(running.registry, Settings())
    newest = Newest(check.judge, Settings())
    end_start()

    def feed(pieces: list[FrameBatch]) -> None:
        early = [batch for piece in pieces for batch in running.feed(piece)]
        for measured in check.measured([*early, running.flush()]):
            check.feed(measured)
        newest.look(running.buses)

    return feed


@dataclass
class Row:
    """One line of the table."""

    name: str
    log: Path
    receive: Callable[[socket.socket, float, Over], Iterator[list[FrameBatch]]]
    use: Callable[[], Feed]
    shares: list[float] = field(default_factory=list)

    def measure(self, pause: float) -> int:
        """Runs it once; how many frames were dropped."""
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        theirs.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, QUEUE)
        feed, received, dropped = self.use(), 0, 0
        command = [sys.executable, __file__, str(self.log), "--play", str(theirs.fileno())]
        with subprocess.Popen(command, stdout=subprocess.PIPE, pass_fds=[theirs.fileno()]) as player, ours, theirs:
            meter = Meter()
            for pieces in self.receive(ours, pause, lambda: player.poll() is not None):
                feed(pieces)
                received += sum(piece.frames for piece in pieces)
                dropped += sum(piece.lines["dropped_frames"] for piece in pieces)
                meter.tick()
            self.shares.append(meter.share)
            sent = int(player.communicate()[0])
        if received + dropped != sent:
            raise AssertionError(f"{self.name}: {sent:,} sent, {received:,} received, {dropped:,} dropped")
        return dropped


def simulated(path: Path, seconds: float) -> Path:
    program = "import sys; from analyzer.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", program, "simulate", "-o", str(path), "--esc", "8", "--rate", str(RATE)]
    subprocess.run([*command, "--duration", f"{seconds:g}"], check=True, stderr=subprocess.DEVNULL)
    return path


def faulty(path: Path, kind: str, seconds: float) -> Path:
    """A log that is full of faults, evenly as a full bus brings them."""
    make_faults.write(path, kind, round(seconds * FULL))
    parts = [make_faults.parts_of(text) for text in path.read_bytes().splitlines()]
    path.write_text("".join(make_faults.line(k / FULL, *rest) for k, (_, *rest) in enumerate(parts)))
    return path


def healthy(path: Path) -> list[Row]:
    return [
        Row("receive", path, received, nothing),
        Row("receive, engine", path, received, engine),
        Row("receive, engine, rules", path, received, rules),
        Row("python-can", path, one_by_one, nothing),
        Row("python-can, engine", path, one_by_one, engine),
    ]


def measure(rows: list[Row], flushes: float, runs: int) -> str:
    """The rows, whose logs take as long as each other."""
    log = frames(rows[0].log)
    dropped = sum(row.measure(1 / flushes) for _ in range(runs) for row in rows)
    seconds = log[-1][0]
    out = [f"{len(log):,} frames in {seconds:.0f} s ({len(log) / seconds:,.0f}/s), {dropped:,} dropped in all runs"]
    out += [f"{'':24}{'of one core':>12}{'us/frame':>10}"]
    for row in rows:
        share = statistics.median(row.shares)
        out.append(f"{row.name:24}{share:12.1%}{share * seconds / len(log) * 1e6:10.2f}")
    return "\n".join(out) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path, nargs="?", help="candump -l text of classic CAN; simulated when not given")
    parser.add_argument("--faults", action="store_true", help="what all rules cost on a bus full of faults")
    parser.add_argument("--seconds", type=float, default=20.0, help="of the logs that are made")
    parser.add_argument(
        "--flushes", type=float, default=2.0, help="a second, as live -q; each makes tables of what has come"
    )
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--play", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.play is not None:
        play(options.play, options.log)
        return
    from analyzer.app.process.start import alone, return_memory  # noqa: PLC0415 - as a live session does

    alone()
    return_memory()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.faults:
            kinds = [kind for kind in make_faults.KINDS if kind != "jumps"]
            logs = {kind: faulty(folder / f"{kind}.log", kind, options.seconds) for kind in kinds}
            rows = [Row(kind, log, received, rules) for kind, log in logs.items()]
        else:
            rows = healthy(options.log or simulated(folder / "flight.log", options.seconds))
        sys.stdout.write(measure(rows, options.flushes, options.runs))


if __name__ == "__main__":
    main()
