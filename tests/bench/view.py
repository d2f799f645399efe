"""Measure the browser: python tests/bench/view.py LOG [--size COLUMNSxROWS] [--filter FILTER]

`tailbyte view LOG` runs on a terminal of its own. Told are when its first rows stand there, when all is decoded and
judged, its memory, what is its own of that, and for keys at several places and under a filter: the processor time and
the bytes for the terminal that one key costs. Keys are pressed one by one, each when the answer to the one before has
ended; processor time is that of the whole process, so measure judged captures, or keys share it with the judging.
"""

from __future__ import annotations

import argparse
import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import time
from pathlib import Path

SIZE = "80x24"
QUIET = 0.25  # seconds without a byte that end an answer, if then nothing of the process works or waits for a core
PRESSES = 20
DOING = re.compile(rb"[\d,]+ frames(?: +\d+ notes? \(7\))?( [^\x1b]*)\x1b")  # in the first line
STATE = re.compile(rb"row [\d,]+ of [\d,]+[^\x1b]*")
TAIL = 40_000  # bytes that were drawn last


def used(process: int) -> float:
    """Return the seconds of processor time of all threads of a process."""
    parts = Path(f"/proc/{process}/schedstat")
    total = 0
    for task in Path(f"/proc/{process}/task").iterdir():
        total += int((task / parts.name).read_text().split()[0])
    return total / 1e9


def works(process: int) -> bool:
    """Return whether a thread of a process has something to do."""
    every = (one / "stat" for one in Path(f"/proc/{process}/task").iterdir())
    return any(one.read_text().rpartition(")")[2].split()[0] in "RD" for one in every)


def used_by_all(process: int) -> float:
    """Return the seconds of processor time of a process, of threads that have ended among them, to 10 ms."""
    words = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def memory(process: int, what: str) -> float:
    """Return a figure of the memory of a process in MB."""
    found = re.search(rf"{what}:\s+(\d+)", Path(f"/proc/{process}/status").read_text())
    assert found is not None
    return int(found[1]) * 1024 / 1e6


class Terminal:
    """A browser on a terminal of its own; `got` is everything that it drew."""

    def __init__(self, words: list[str], size: str) -> None:
        columns, rows = map(int, size.split("x"))
        self._end, inner = pty.openpty()
        fcntl.ioctl(inner, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        environment = os.environ | {"TERM": "xterm-256color"}
        self.start = time.monotonic()
        command = [sys.executable, "-m", "analyzer", "view", "--no-marks", *words]
        self.process = subprocess.Popen(command, stdin=inner, stdout=inner, stderr=inner, env=environment)
        os.close(inner)
        self.got = bytearray()

    def read(self, seconds: float) -> int:
        """Return how many bytes came, waiting so long for the first of them."""
        ready, _, _ = select.select([self._end], [], [], seconds)
        if not ready:
            return 0
        piece = os.read(self._end, 1 << 16)
        self.got += piece
        return len(piece)

    def until(self, wanted: bytes, *, gone: bool = False, limit: float = 3600) -> float:
        """Return the seconds from the start until bytes stand there, or a line is drawn without them."""
        seen = 0
        while time.monotonic() - self.start < limit:
            self.read(1.0)
            if not gone and wanted in self.got[seen:]:
                return time.monotonic() - self.start
            tops = DOING.findall(self.got[-TAIL:]) if gone else []
            if tops and not tops[-1].strip():
                return time.monotonic() - self.start
        raise AssertionError(bytes(self.got[-2000:]))

    def settle(self) -> int:
        """Return the bytes that come until it is quiet."""
        total = 0
        while (count := self.read(QUIET)) or works(self.process.pid):
            total += count
        return total

    def press(self, keys: str) -> int:
        """Press keys; return the bytes of the answer."""
        os.write(self._end, keys.encode())
        return self.settle()

    def close(self) -> None:
        """Quit."""
        os.write(self._end, b"q")
        self.process.wait(60)


def cost(terminal: Terminal, what: str, keys: str, presses: int = PRESSES) -> None:
    """Print the processor time and the bytes of one press, and the most of one."""
    times, sizes = [], []
    for _ in range(presses):
        before = used(terminal.process.pid)
        sizes.append(terminal.press(keys))
        times.append((used(terminal.process.pid) - before) * 1000)
    times.sort()
    sys.stdout.write(
        f"  {what:<34} {times[len(times) // 2]:6.1f} ms  most {times[-1]:6.1f} ms"
        f"   {sum(sizes) // len(sizes):6} bytes  most {max(sizes):6}\n"
    )
    sys.stdout.flush()


def measure(log: str, size: str, chosen: str) -> None:
    """Print everything about one capture."""
    terminal = Terminal([log], size)
    first = terminal.until(b">*")
    begun = used_by_all(terminal.process.pid)
    loaded = terminal.until(b"flights")
    own = memory(terminal.process.pid, "RssAnon")
    cpu = used_by_all(terminal.process.pid)
    judged = terminal.until(b"", gone=True)
    sys.stdout.write(
        f"{log} {size}: first rows {first:.2f} s ({begun:.2f} s of processor), "
        f"decoded {loaded:.1f} s ({cpu:.1f} s), judged {judged:.1f} s ({used_by_all(terminal.process.pid):.1f} s)\n"
        f"  memory: {own:.0f} MB of its own when decoded, {memory(terminal.process.pid, 'RssAnon'):.0f} when judged, "
        f"peak with pages of files {memory(terminal.process.pid, 'VmHWM'):.0f} MB\n"
    )
    terminal.settle()
    idle = used(terminal.process.pid)
    time.sleep(2)
    sys.stdout.write(f"  idle: {(used(terminal.process.pid) - idle) / 2:.1%} of a core\n")
    keys(terminal)
    if chosen:
        begin, before = time.monotonic(), used_by_all(terminal.process.pid)
        terminal.press(f"={chosen}\r")
        while b"(" not in (state := STATE.findall(terminal.got[-TAIL:])[-1]) or b"so far" in state:
            terminal.read(0.1)
        terminal.settle()
        sys.stdout.write(
            f" under {chosen}: {state.decode().strip()}, found in {time.monotonic() - begin:.1f} s, "
            f"{used_by_all(terminal.process.pid) - before:.1f} s of processor\n"
        )
        keys(terminal)
    sys.stdout.write(f"  memory: {memory(terminal.process.pid, 'RssAnon'):.0f} MB of its own at the end\n")
    terminal.close()


def keys(terminal: Terminal) -> None:
    """Print what keys cost."""
    cost(terminal, "down, at the start", "\x1b[B")
    cost(terminal, "page down", "\x1b[6~")
    for share in (30, 77):
        cost(terminal, f"go to {share} %", f"g{share}%\r", 1)
        cost(terminal, "down", "\x1b[B")
        cost(terminal, "page up", "\x1b[5~")
        cost(terminal, "next of the same sender", ".")
    cost(terminal, "end, home", "\x1b[F\x1b[H", 5)
    cost(terminal, "next finding", "]", 5)
    cost(terminal, "to the details and back", "\t\x1b[Z", 5)


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log")
    parser.add_argument("--size", default=SIZE)
    parser.add_argument("--filter", default="")
    options = parser.parse_args()
    measure(options.log, options.size, options.filter)


if __name__ == "__main__":
    main()
