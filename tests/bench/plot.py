"""Measure `tailbyte plot` in one run: python tests/bench/plot.py [LOG] [--minutes N] [--runs N]

Without LOG ten minutes of eight ESCs are simulated first. Every row is run once for nothing and then `--runs` times, in
turn, so that a busy machine hurts all rows alike; the table shows medians, and how much of plotting each row is.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import simulate
from run import Log, process, spawn

if TYPE_CHECKING:
    from collections.abc import Callable

MESSAGES = 1_000_000


@dataclass
class Row:
    """One line of the table: `run` gives seconds."""

    name: str
    run: Callable[[], float]
    seconds: list[float] = field(default_factory=list)

    @property
    def median(self) -> float:
        return statistics.median(self.seconds)


def whole(*words: str) -> Callable[[Path], float]:
    """A command from start-up to its end."""
    run = process(*words)

    def measured(log: Path) -> float:
        start = time.perf_counter()
        run(Log(log, 0, log, log))
        return time.perf_counter() - start

    return measured


def imported() -> float:
    start = time.perf_counter()
    spawn([sys.executable, "-c", "import rerun"])
    return time.perf_counter() - start


def decoded(log: Path) -> tuple[Any, list[Any], int]:
    """The types, every batch of the log, and how many messages there are."""
    import dissectors  # noqa: PLC0415
    from analyzer.decode.engine import Engine  # noqa: PLC0415
    from analyzer.sources.merge import Plan, open_captures  # noqa: PLC0415

    registry = dissectors.load()
    batches = list(Engine(registry).run(open_captures([str(log)], Plan()).chunks()))
    return registry, batches, sum(len(batch.transfers) for batch in batches)


def drawn(registry: Any, batches: list[Any], *, written: bool) -> float:
    """All messages as a recording, in seconds: into a file, or only as far as Rerun's chunks."""
    from analyzer.plot.output import FileOutput  # noqa: PLC0415
    from analyzer.plot.parts import whole as part  # noqa: PLC0415
    from analyzer.plot.picture import Picture  # noqa: PLC0415

    def draw(send: Callable[[Any], None]) -> None:
        picture = Picture(send, registry)
        for batch in batches:
            picture.note_start(batch)
            picture.feed(part(batch))
        picture.close({})

    start = time.perf_counter()
    if not written:
        draw(lambda _: None)
        return time.perf_counter() - start
    with tempfile.TemporaryFile() as file, FileOutput(file, "bench") as output:
        draw(output.send)
    return time.perf_counter() - start


def measure(log: Path, folder: Path, runs: int) -> str:
    registry, batches, messages = decoded(log)
    target = str(folder / "out.rrd")
    rows = [
        Row("import rerun, whole process", imported),
        Row("tailbyte decode -q, whole process", lambda: whole("decode", "-q")(log)),
        Row("tailbyte check, whole process", lambda: whole("check")(log)),
        Row("tailbyte plot, whole process", lambda: whole("plot", "-o", target)(log)),
        Row("drawing beyond decoding, chunks", lambda: drawn(registry, batches, written=False)),
        Row("drawing beyond decoding, file", lambda: drawn(registry, batches, written=True)),
    ]
    for _ in range(runs + 1):
        for row in rows:
            row.seconds.append(row.run())
    for row in rows:
        del row.seconds[0]
    plot = rows[3].median
    lines = [
        f"{messages:,} messages, {log.stat().st_size:,} bytes, medians of {runs} runs, {os.cpu_count()} processors"
    ]
    lines.append(f"{'':36}{'seconds':>9}{'of plot':>9}{'a million messages':>20}")
    for row in rows:
        million = f"{row.median / messages * MESSAGES:.2f} s" if row.name.startswith("drawing") else "-"
        lines.append(f"{row.name:36}{row.median:9.2f}{row.median / plot:9.2f}{million:>20}")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path, nargs="?", help="a capture; simulated when not given")
    parser.add_argument("--minutes", type=float, default=10.0, help="of the log that is simulated")
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = options.log or folder / "flight.log"
        if not options.log:
            simulate.fly("hover", options.minutes, path)
        sys.stdout.write(measure(path, folder, options.runs))


if __name__ == "__main__":
    main()
