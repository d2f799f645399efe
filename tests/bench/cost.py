"""What a command or a call costs: processor time, wall-clock time, peak memory, or instructions."""

from __future__ import annotations

import os
import re
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

ROOT = Path(__file__).resolve().parents[2]
_MAIN = "import sys; from analyzer.cli import main; sys.exit(main())"
FINE = {0, 1, 4}  # 1: findings, 4: too little to judge

# A child begins with the peak of the process that started it, so a small one starts the command.
_LAUNCHER = """
import resource, subprocess, sys, time
start = time.perf_counter()
status = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode
wall = time.perf_counter() - start
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, wall, used.ru_maxrss * 1024, status)
"""


class Cost(NamedTuple):
    """Seconds of all processors together, seconds by the clock, and the peak memory in bytes, 0 if it is not known."""

    processor: float
    wall: float
    peak: int = 0


def tailbyte(*words: object) -> list[str]:
    """Return the command line of a checkout's command: that of the `tree` it is measured in."""
    return [sys.executable, "-c", _MAIN, *map(str, words)]


def of_process(command: Sequence[str], tree: Path = ROOT) -> Cost:
    """Run a command to its end with its output thrown away; the peak is never below the 10 MB of the launcher."""
    whole = [sys.executable, "-SEc", _LAUNCHER, *command]
    done = subprocess.run(whole, stdout=subprocess.PIPE, text=True, check=True, env=_environment(tree))
    processor, wall, peak, status = done.stdout.split()
    if int(status) not in FINE:
        raise subprocess.CalledProcessError(int(status), list(command))
    return Cost(float(processor), float(wall), int(peak))


def of_call(call: Callable[[], object]) -> Cost:
    """Call it once in this process."""
    start, processor = time.perf_counter(), time.process_time()
    call()
    return Cost(time.process_time() - processor, time.perf_counter() - start)


def instructions(command: Sequence[str], tree: Path = ROOT) -> int:
    """Return how many a command executes, as callgrind counts them; it takes some 50 times as long."""
    counted = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", *command]
    done = subprocess.run(counted, capture_output=True, text=True, check=False, env=_environment(tree))
    found = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode not in FINE or found is None:
        raise subprocess.CalledProcessError(done.returncode, counted, stderr=done.stderr)
    return int(found[1])


def _environment(tree: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(tree), "PYTHONSAFEPATH": "1", "PYTHONHASHSEED": "0"}


@dataclass
class Row:
    """One line of a table: what is measured of a log of so many frames."""

    name: str
    frames: int
    run: Callable[[], Cost]
    costs: list[Cost] = field(default_factory=list)

    @property
    def processor(self) -> float:
        """Nanoseconds of processor time a frame, the median."""
        return statistics.median(cost.processor for cost in self.costs) / self.frames * 1e9

    @property
    def wall(self) -> float:
        """Nanoseconds by the clock a frame, the median."""
        return statistics.median(cost.wall for cost in self.costs) / self.frames * 1e9

    @property
    def peak(self) -> int:
        """Bytes, the highest."""
        return max(cost.peak for cost in self.costs)


def in_turn(rows: Sequence[Row], runs: int) -> None:
    """Measure rows `runs` times in turn, so that a busy machine hurts all alike; two and more after one for nothing."""
    for turn in range(runs + (runs > 1)):
        for row in rows:
            cost = row.run()
            if turn or runs == 1:
                row.costs.append(cost)
