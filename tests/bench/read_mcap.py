"""Measure the reading of MCAP in one run: python tests/bench/read_mcap.py [--frames N] [--runs N]

Files of `can_msgs/msg/Frame` are made first, one for each compression, by the `mcap` package with its own chunk size.
Every row is run once for nothing and then `--runs` times, in turn; the table shows medians. The package's iteration
works on a file with the first messages only: its time per message does not depend on the length.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

from mcap.reader import NonSeekingReader

from analyzer.sources import Source

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from kit import mcaps

PACKAGE_MESSAGES = 50_000


@dataclass
class Row:
    """One line of the table."""

    name: str
    path: Path
    messages: int
    seconds: list[float] = field(default_factory=list)

    def measure(self) -> None:
        start = time.perf_counter()
        found = self.run()
        self.seconds.append(time.perf_counter() - start)
        if found != self.messages:
            raise RuntimeError(f"{self.name}: {found} messages of {self.messages}")

    def run(self) -> int:
        """Messages to frames."""
        return sum(piece.frames for piece in Source(str(self.path)).chunks() if not isinstance(piece, bytes))

    @property
    def rate(self) -> float:
        return self.messages / statistics.median(self.seconds)


class PackageRow(Row):
    def run(self) -> int:
        """Messages as they are, no field of a frame read."""
        with self.path.open("rb") as file:
            return sum(1 for _ in NonSeekingReader(file).iter_messages(log_time_order=False))


def write(path: Path, count: int, compression: str) -> None:
    """Traffic of five nodes with data that changes, as `mcaps` makes it."""
    block = mcaps.frames(10_000)
    layout = mcaps.LAYOUTS["can_msgs"]
    messages = [layout.write(frame) for frame in block]
    builder = mcaps.Builder(compression)
    channel = builder.channel("/can0/rx", layout)
    for number in range(count):
        t = block[0].t + number * 100_000
        builder.writer.add_message(channel, t, messages[number % len(messages)], t)
    path.write_bytes(builder.bytes())


def table(rows: list[Row]) -> str:
    reference = {row.path.suffix: row.rate for row in rows if isinstance(row, PackageRow)}
    out = [f"{'':38}{'messages/s':>14}{'ns/message':>12}{'MB/s stored':>13}{'x package':>11}"]
    for row in rows:
        speed = row.path.stat().st_size * row.rate / row.messages / 1e6
        ratio = row.rate / reference[row.path.suffix]
        out.append(f"{row.name:38}{row.rate:14,.0f}{1e9 / row.rate:12,.1f}{speed:13,.0f}{ratio:11,.1f}")
    return "\n".join(out)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=1_000_000, help="messages of each file")
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    few = min(PACKAGE_MESSAGES, options.frames)
    with tempfile.TemporaryDirectory() as name:
        rows: list[Row] = []
        for compression in mcaps.COMPRESSIONS:
            whole, part = (Path(name) / f"{size}.{compression}" for size in ("whole", "part"))
            write(whole, options.frames, compression)
            write(part, few, compression)
            rows.append(Row(f"Source to frames, {compression}", whole, options.frames))
            rows.append(PackageRow(f"mcap package, {compression}", part, few))
        for _ in range(options.runs + 1):
            for row in rows:
                row.measure()
        for row in rows:
            del row.seconds[0]
        sys.stdout.write(f"{options.frames:,} messages a file, medians of {options.runs} runs\n{table(rows)}\n")


if __name__ == "__main__":
    main()
