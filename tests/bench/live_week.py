"""Pump a week of faults through a live session: python tests/bench/live_week.py [LOG] [--rounds N] [--days N]

The rows of LOG (mission-8-faults.log if not given) come again and again, as much later each time as spreads the rounds
over the days; nothing waits. Printed are the memory of the process, the findings, and at the end which containers of
the session grew in its second half, as `class.attribute`, with how many entries they have then. All of them have
limits: what goes on growing from one run to a longer one has none.
"""

from __future__ import annotations

import argparse
import gc
import sys
import time
from collections import Counter, deque
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from kit.live import Row, made, stored  # noqa: E402 - found from here on

from analyzer._native import AsRecorded  # noqa: E402
from analyzer.app.live.batch_interval import BatchInterval  # noqa: E402
from analyzer.app.live.list import EventLines  # noqa: E402
from analyzer.app.live.session import LiveSession  # noqa: E402
from analyzer.app.live.session_recording import SessionRecording  # noqa: E402
from analyzer.cli.commands import parser  # noqa: E402
from analyzer.cli.live import Wanted  # noqa: E402
from analyzer.live.capture_loop import SessionControl  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer._native import FrameBatch

DAY = 86_400
OURS = ("analyzer.", "dissectors.")
# Views of one batch, and what never changes.
LEFT_OUT = ("BatchView", "FrameTable", "TransferTable", "EventTable", "DecodedTable", "Registry")


class Pump:
    """A capture loop that gives the same rows, `step` ns later each time."""

    def __init__(self, rows: list[Row], rounds: int, step: int) -> None:
        self.control, self.behind, self.hub = SessionControl(), 0.0, SimpleNamespace(counts={})
        self.rounds = self.frames = 0
        self._rows, self._most, self._step, self._recorded = rows, rounds, step, AsRecorded()

    @property
    def ended(self) -> bool:
        return self.rounds >= self._most

    def take(self, _seconds: float) -> list[FrameBatch]:
        later = self.rounds * self._step
        self.rounds += 1
        batch = made([row if row.t is None else replace(row, t=row.t + later) for row in self._rows])
        self.frames += batch.frames
        return [self._recorded.apply(batch)]

    def take_findings(self, _changes: object) -> None: ...

    def notes(self) -> list[str]:
        return []


def held(root: object) -> Counter[str]:
    """Entries of all containers that can be reached, by where they are."""
    found: Counter[str] = Counter()
    seen: set[int] = set()
    todo: list[tuple[object, str]] = [(root, "session")]
    while todo:
        one, place = todo.pop()
        if id(one) in seen or type(one).__name__ in LEFT_OUT:
            continue
        seen.add(id(one))
        if isinstance(one, dict | list | set | deque):
            found[place] += len(one)
        if isinstance(one, dict):
            todo += [(value, place) for value in one.values()]
        elif isinstance(one, list | tuple | set | frozenset | deque):
            todo += [(value, place) for value in one]
        elif type(one).__module__.startswith(OURS):
            todo += [(value, f"{type(one).__name__}.{name}") for name, value in parts(one)]
    return found


def parts(one: object) -> Iterator[tuple[str, Any]]:
    yield from getattr(one, "__dict__", {}).items()
    for kind in type(one).__mro__:
        for name in getattr(kind, "__slots__", ()):
            if hasattr(one, name):
                yield name, getattr(one, name)


def memory() -> float:
    """Of this process, in MB."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("log", nargs="?", default=str(ROOT / "captures" / "mission-8-faults.log"))
    asked.add_argument("--rounds", type=int, default=200)
    asked.add_argument("--days", type=float, default=7)
    args = asked.parse_args()
    start, marks = time.monotonic(), list[Counter[str]]()
    pump = Pump(stored(args.log), args.rounds, round(args.days * DAY / args.rounds * 1e9))

    def look(session: LiveSession) -> None:
        if pump.rounds % (args.rounds // 4) == 0:
            gc.collect()
            marks.append(held(session))
            days = pump.rounds * args.days / args.rounds
            sys.stdout.write(
                f"{days:6.2f} days  {pump.frames:11,} frames  {len(session.newest.all):6,} findings  {memory():6.0f} MB"
                f"  {time.monotonic() - start:6.0f} s\n"
            )
            sys.stdout.flush()

    wanted = Wanted(parser().parse_args(["live", "virtual:week", "-q"]))
    view = EventLines(several=False, say=lambda _: None)
    view.look = look  # type: ignore[method-assign]
    with ExitStack() as stack:
        recording = SessionRecording(wanted.request.plan, stack)
        session = LiveSession(pump, recording, "week", wanted.criteria, [view], BatchInterval(0, 0))  # type: ignore[arg-type,list-item]
        session.run()
    for place, count in (marks[-1] - marks[1]).most_common():
        if count >= args.rounds // 2:
            sys.stdout.write(f"{marks[1][place]:9,} -> {marks[-1][place]:9,}  {place}\n")


if __name__ == "__main__":
    main()
