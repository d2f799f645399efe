"""Measure the monitor of a full bus: python tests/bench/monitor.py [LOG] [--seconds N] [--size COLUMNSxROWS]

`tailbyte live can0` runs on a terminal of its own that takes everything at once. Another process plays a full bus of
1 Mbit/s into a pair of datagram sockets that stands in for the kernel's CAN. The line says which share of one core the
whole process of the monitor takes, once warm, its peak memory, and how much of it is its own at the end: the rest are
pages of program files, which it shares with whoever has them open. Everything that was sent must be accounted for.
"""

from __future__ import annotations

import argparse
import fcntl
import os
import pty
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import termios
import time
from pathlib import Path
from threading import Thread

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench import live

WARM = 5.0  # seconds, from the first frame on
SIZE = "160x50"


class Receiver:
    """`Receiver` of a socket that is open already."""

    failed = None

    def __init__(self, bus: socket.socket) -> None:
        from analyzer._native import SocketReceiver  # noqa: PLC0415 - the measuring process does without

        self.name = live.BUS
        self._native = SocketReceiver(bus.fileno(), live.BUS)

    def receive(self, seconds: float) -> object:
        self._native.receive(round(seconds * 1000))
        return self._native.take()

    def finish(self) -> list:
        self._native.finish()
        return [self._native.take()]

    def wake(self) -> None:
        self._native.wake()

    def notes(self) -> list[str]:
        return []

    def close(self) -> None:
        pass


def watch(descriptor: int) -> int:
    """The process that is measured."""
    from analyzer.cli import main  # noqa: PLC0415
    from analyzer.live.interfaces import receiver  # noqa: PLC0415

    bus = socket.socket(fileno=descriptor)
    receiver.open_receiver = lambda *_, **__: Receiver(bus)
    sys.argv[1:] = ["live", live.BUS]
    return main()


def used(process: int) -> float:
    """Seconds of processor time of all its threads."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def memory(process: int, what: str) -> int:
    return int(re.search(rf"{what}:\s+(\d+)", Path(f"/proc/{process}/status").read_text())[1]) * 1024


def drain(terminal: int, into: bytearray) -> None:
    try:
        while piece := os.read(terminal, 1 << 16):
            into += piece
    except OSError:  # the other side is closed
        return


def measure(log: Path, size: str) -> str:
    columns, rows = map(int, size.split("x"))
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    theirs.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, live.QUEUE)
    terminal, inner = pty.openpty()
    fcntl.ioctl(inner, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
    screen = bytearray()
    reader = Thread(target=drain, args=(terminal, screen), daemon=True)
    reader.start()
    environment = os.environ | {"TERM": "xterm-256color", "COLORTERM": "truecolor"}
    command = [sys.executable, __file__, "--watch", str(ours.fileno())]
    monitor = subprocess.Popen(
        command, stdin=inner, stdout=inner, stderr=inner, pass_fds=[ours.fileno()], env=environment
    )
    ours.close()
    os.close(inner)
    while len(screen) < columns:  # it is up
        time.sleep(0.1)
    player = [sys.executable, live.__file__, str(log), "--play", str(theirs.fileno())]
    with subprocess.Popen(player, stdout=subprocess.PIPE, pass_fds=[theirs.fileno()], text=True) as playing:
        time.sleep(WARM)
        start, before = time.monotonic(), used(monitor.pid)
        sent = int(playing.communicate()[0])
        share = (used(monitor.pid) - before) / (time.monotonic() - start)
    highest, own = (memory(monitor.pid, what) / 1e6 for what in ("VmHWM", "RssAnon"))
    monitor.send_signal(signal.SIGTERM)
    monitor.wait()
    reader.join()
    said = screen.decode(errors="replace")
    counted = re.search(r"([\d,]+) frames = ([\d,]+) received \+ ([\d,]+) dropped", said)
    if counted is None or int(counted[1].replace(",", "")) != sent:
        raise AssertionError(f"{sent} sent: {said[-1000:]}")
    said = f"{share:.1%} of one core, {highest:.0f} MB, {own:.0f} of its own"
    return f"{sent:,} frames, {counted[3]} dropped: {said}, {size}\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path, nargs="?", help="candump -l text; simulated when not given")
    parser.add_argument("--seconds", type=float, default=30.0, help="of the log that is simulated")
    parser.add_argument("--size", default=SIZE, help="of the terminal (default: %(default)s)")
    parser.add_argument("--watch", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.watch is not None:
        sys.exit(watch(options.watch))
    with tempfile.TemporaryDirectory() as name:
        log = options.log or live.simulated(Path(name) / "flight.log", options.seconds)
        sys.stdout.write(measure(log, options.size))


if __name__ == "__main__":
    main()
