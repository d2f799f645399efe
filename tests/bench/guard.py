"""Say by how much a change makes things dearer: python tests/bench/guard.py OLD NEW [--frames N] [--runs N] [--counts]

OLD and NEW are checkouts with a built core. `decode -q` and `check` read a log of make_log.py, other commands a hundred
lines of it, where nothing but their start counts. Both checkouts take turns, so that a busy machine hurts both alike;
the table shows medians of processor time, user and system, and what NEW takes of what OLD takes. With --counts valgrind
counts instructions instead, once, of shorter logs: they do not depend on the machine. Ends with status 1 when something
is dearer by more than --limit.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
from itertools import islice
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench import make_log
from bench.cost import instructions, of_process, tailbyte

COUNTED_FRAMES = 20_000
START_LINES = 100


class Case(NamedTuple):
    """A command, and the line of the table that shows it."""

    name: str
    words: tuple[str, ...]


def cases(log: Path, start: Path) -> list[Case]:
    """Return what is measured."""
    picture = start.with_suffix(".rrd")
    return [
        Case("decode -q", ("decode", "-q", str(log))),
        Case("check", ("check", str(log))),
        Case("start of --help", ("--help",)),
        Case("start of explain", ("explain", "TRF-003")),
        Case("start of decode", ("decode", str(start))),
        Case("start of check", ("check", str(start))),
        Case("start of plot", ("plot", str(start), "-o", str(picture))),
    ]


def table(names: list[str], old: dict[str, float], new: dict[str, float], unit: str) -> str:
    """Return the lines of the report."""
    rows = [f"{'':18s} {'old':>10s} {'new':>10s}  new/old"]
    rows += [f"{n:18s} {old[n]:9.3f}{unit} {new[n]:9.3f}{unit} {new[n] / old[n]:7.2f}x" for n in names]
    return "\n".join(rows) + "\n"


def main() -> int:
    """Measure, and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("--frames", type=int, default=1_000_000, help="in the log (default: %(default)s)")
    parser.add_argument("--runs", type=int, default=5, help="of each command (default: %(default)s)")
    parser.add_argument("--limit", type=float, default=10, help="allowed, in per cent (default: %(default)s)")
    parser.add_argument("--counts", action="store_true", help="instructions in place of time")
    args = parser.parse_args()
    trees = [args.old.resolve(), args.new.resolve()]
    runs, unit = (1, "M") if args.counts else (args.runs, "s")
    with tempfile.TemporaryDirectory() as folder:
        log, start = Path(folder, "flight.log"), Path(folder, "start.log")
        make_log.write(log, COUNTED_FRAMES if args.counts else args.frames)
        with log.open() as lines:
            start.write_text("".join(islice(lines, START_LINES)))
        commands = {case.name: tailbyte(*case.words) for case in cases(log, start)}
        for tree in trees:  # bytecode is written, files are read
            for command in commands.values():
                of_process(command, tree)
        seen = [{name: [] for name in commands} for _ in trees]
        for _ in range(runs):
            for name, command in commands.items():
                for tree, found in zip(trees, seen, strict=True):
                    used = instructions(command, tree) / 1e6 if args.counts else of_process(command, tree).processor
                    found[name].append(used)
    old, new = ({name: statistics.median(values) for name, values in found.items()} for found in seen)
    sys.stdout.write(table(list(old), old, new, unit))
    return int(any(new[name] > old[name] * (1 + args.limit / 100) for name in old))


if __name__ == "__main__":
    sys.exit(main())
