"""Say by how much a change makes things dearer: python tests/bench/guard.py OLD NEW [--frames N] [--runs N] [--counts]

OLD and NEW are checkouts with a built core. `decode -q` and `check` read a log of make_log.py, other commands a hundred
lines of it, where nothing but their start counts. Both checkouts take turns, so that a busy machine hurts both alike;
the table shows medians of processor time, user and system, and what NEW takes of what OLD takes. With --counts valgrind
counts instructions instead, once, of shorter logs: they do not depend on the machine. Ends with status 1 when something
is dearer by more than --limit.
"""

from __future__ import annotations

import argparse
import os
import re
import statistics
import subprocess
import sys
import tempfile
from itertools import islice
from pathlib import Path
from typing import NamedTuple

MAIN = "import sys; from analyzer.cli import main; sys.exit(main())"
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


def processor_time(tree: Path, case: Case) -> float:
    """Return the seconds that a command takes, of all its threads."""
    process = subprocess.Popen([sys.executable, "-c", MAIN, *case.words], **_streams(tree))
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    _expect(process.returncode, tree, case)
    return used.ru_utime + used.ru_stime


def instructions(tree: Path, case: Case) -> float:
    """Return how many a command executes, as callgrind counts them."""
    command = [
        "valgrind",
        "--tool=callgrind",
        "--callgrind-out-file=/dev/null",
        sys.executable,
        "-c",
        MAIN,
        *case.words,
    ]
    done = subprocess.run(command, check=False, **_streams(tree) | {"stderr": subprocess.PIPE})
    _expect(done.returncode, tree, case)
    return float(re.search(rb"Collected : (\d+)", done.stderr)[1])


def _streams(tree: Path) -> dict:
    env = os.environ | {"PYTHONPATH": str(tree), "PYTHONSAFEPATH": "1", "PYTHONHASHSEED": "0"}
    return {"env": env, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}


def _expect(status: int, tree: Path, case: Case) -> None:
    if status not in {0, 1, 4}:  # 1: findings, 4: too little to judge
        raise SystemExit(f"{tree}: {case.name} ended with status {status}")


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
    measure, runs, unit = (instructions, 1, "M") if args.counts else (processor_time, args.runs, "s")
    frames = COUNTED_FRAMES if args.counts else args.frames
    with tempfile.TemporaryDirectory() as folder:
        log, start = Path(folder, "flight.log"), Path(folder, "start.log")
        made = [
            sys.executable,
            str(Path(__file__).with_name("make_log.py")),
            "--frames",
            str(frames),
            "--out",
            str(log),
        ]
        subprocess.run(made, check=True)
        with log.open() as lines:
            start.write_text("".join(islice(lines, START_LINES)))
        wanted = cases(log, start)
        for tree in trees:  # bytecode is written, files are read
            for case in wanted:
                processor_time(tree, case)
        seen = [{case.name: [] for case in wanted} for _ in trees]
        for _ in range(runs):
            for case in wanted:
                for tree, found in zip(trees, seen, strict=True):
                    found[case.name].append(measure(tree, case) / (1e6 if args.counts else 1))
    old, new = ({name: statistics.median(values) for name, values in found.items()} for found in seen)
    sys.stdout.write(table(list(old), old, new, unit))
    return int(any(new[name] > old[name] * (1 + args.limit / 100) for name in old))


if __name__ == "__main__":
    sys.exit(main())
