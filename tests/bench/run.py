"""Measure decoding in one run: python tests/bench/run.py [LOG] [--frames N] [--runs N]

Without LOG the log of make_log.py is made first. Every row is run once for nothing and then `--runs` times, in turn, so
that a busy machine hurts all rows alike; the table shows medians. The Python readers work on the first frames only
(200 k and 20 k): their time per frame does not depend on the length.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import make_log

if TYPE_CHECKING:
    from collections.abc import Callable

CHUNK = 1 << 20
READER_FRAMES, DECODER_FRAMES = 200_000, 20_000
REFERENCE = "python-can + pydronecan"


@dataclass(frozen=True)
class Log:
    """The whole log, and the two slices that the slow readers get."""

    path: Path
    frames: int
    reader: Path
    decoder: Path


@dataclass
class Row:
    """One line of the table: `run` gives the peak memory in bytes where it is that of a process of its own."""

    name: str
    frames: int
    run: Callable[[Log], int | None]
    seconds: list[float] = field(default_factory=list)
    memory: int | None = None

    def measure(self, log: Log) -> None:
        start = time.perf_counter()
        self.memory = self.run(log)
        self.seconds.append(time.perf_counter() - start)

    @property
    def ns(self) -> float:
        return statistics.median(self.seconds) / self.frames * 1e9


# A child begins with the peak of the process that started it, so a small one starts the command.
LAUNCHER = """
import resource, subprocess, sys
status = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024)
sys.exit(status)
"""


def spawn(command: list[str]) -> int:
    """Run to the end with its output thrown away; its peak memory in bytes (never below the 10 MB of the launcher)."""
    whole = [sys.executable, "-SEc", LAUNCHER, *command]
    done = subprocess.run(whole, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode not in {0, 1}:  # 1: findings
        raise subprocess.CalledProcessError(done.returncode, command)
    return int(done.stdout)


def count_lines(log: Log) -> int:
    return spawn(["wc", "-l", str(log.path)])


def core(log: Log) -> None:
    """The native core alone, on one core: frames, transfers, anomalies, and the columns of every known type."""
    import dissectors  # noqa: PLC0415
    from analyzer import _native  # noqa: PLC0415

    registry = dissectors.load()
    engine = _native.Pipeline(registry.signatures)
    plans = {}
    with log.path.open("rb", buffering=0) as source:
        while chunk := source.read(4 * CHUNK):
            engine.feed(chunk)
            _, groups = engine.take()
            for group in groups:
                key = group.kind, group.type_id, group.variant
                if key not in plans:
                    plans[key] = _native.Plan(registry.message(*key).plan())
                group.unpack(plans[key], bytes(len(group)))
    engine.finish()
    engine.take()


def tables(log: Log) -> None:
    """Bytes to Arrow tables inside this process: the same, with packets, bit parts, units and derived values."""
    from analyzer.decode.engine import Engine  # noqa: PLC0415 - the other rows do not need it

    engine = Engine()
    with log.path.open("rb", buffering=0) as source:
        while chunk := source.read(CHUNK):
            for batch in engine.feed(chunk):
                dict(batch.messages)  # each table is made when somebody looks at it
    dict(engine.finish().messages)


def process(*words: str) -> Callable[[Log], int]:
    """The whole command, from start-up to the end."""
    command = shutil.which("tailbyte", path=str(Path(sys.executable).parent)) or "tailbyte"
    return lambda log: spawn([command, *words, str(log.path)])


def python_can(log: Log) -> None:
    from can.io import CanutilsLogReader  # noqa: PLC0415

    with CanutilsLogReader(log.reader) as reader:
        for _ in reader:
            pass


def pydronecan(log: Log) -> None:
    """Every frame read, every transfer put together and unpacked."""
    from can.io import CanutilsLogReader  # noqa: PLC0415
    from dronecan.transport import Frame, Transfer, TransferManager  # noqa: PLC0415

    manager = TransferManager()
    with CanutilsLogReader(log.decoder) as reader:
        for message in reader:
            whole = manager.receive_frame(Frame(message.arbitration_id, message.data, ts_monotonic=message.timestamp))
            if whole:
                Transfer().from_frames(whole)


def first(source: Path, target: Path, lines: int) -> Path:
    with source.open("rb") as whole, target.open("wb") as part:
        part.writelines(islice(whole, lines))
    return target


def table(rows: list[Row]) -> str:
    reference = next(row for row in rows if row.name == REFERENCE).ns
    out = [f"{'':34}{'frames/s':>14}{'ns/frame':>10}{'x ' + REFERENCE:>26}{'peak MB':>9}"]
    for row in rows:
        memory = f"{row.memory / 1e6:.0f}" if row.memory else "-"
        out.append(f"{row.name:34}{1e9 / row.ns:14,.0f}{row.ns:10,.1f}{reference / row.ns:26,.1f}{memory:>9}")
    return "\n".join(out)


def measure(path: Path, folder: Path, runs: int) -> str:
    with path.open("rb") as file:
        frames = sum(block.count(b"\n") for block in iter(lambda: file.read(CHUNK), b""))
    reader = first(path, folder / "reader.log", READER_FRAMES)
    decoder = first(path, folder / "decoder.log", DECODER_FRAMES)
    log = Log(path, frames, reader, decoder)
    rows = [
        Row("wc -l", frames, count_lines),
        Row("tailbyte core, to typed columns", frames, core),
        Row("tailbyte Engine, to Arrow tables", frames, tables),
        Row("tailbyte decode -q, whole process", frames, process("decode", "-q")),
        Row("tailbyte check, whole process", frames, process("check")),
        Row("python-can reader", min(frames, READER_FRAMES), python_can),
        Row(REFERENCE, min(frames, DECODER_FRAMES), pydronecan),
    ]
    for _ in range(runs + 1):
        for row in rows:
            row.measure(log)
    for row in rows:
        del row.seconds[0]
    return f"{frames:,} frames, {path.stat().st_size:,} bytes, medians of {runs} runs\n{table(rows)}\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path, nargs="?", help="candump -l text; made when not given")
    parser.add_argument("--frames", type=int, default=10_000_000, help="of the log that is made")
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = options.log or folder / "flight.log"
        if not options.log:
            make_log.write(path, options.frames)
        sys.stdout.write(measure(path, folder, options.runs))


if __name__ == "__main__":
    main()
