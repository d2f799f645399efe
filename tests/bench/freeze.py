"""What every command gives, frozen before a change and compared after it.

    python tests/bench/freeze.py save DIR  # keeps captures, simulated flights, and all outputs in DIR
    python tests/bench/freeze.py compare DIR [--only GLOB]  # one paragraph a difference; exit status 1 if there is any

All captures of captures/ and 50 simulated flights go through decode, info, check, convert, export and plot, in process.
`compare` reads the captures and flights that DIR holds, and simulates the flights again: these are compared, too.
"""

from __future__ import annotations

import argparse
import contextlib
import difflib
import gzip
import json
import os
import re
import shutil
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench import frozen_outputs
from kit import CAPTURES

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

KINDS = {".log", ".txt", ".mcap", ".pcapng"}
MERGED = "merged"  # the case of several captures at once
ONCE = "once"  # commands without a capture
HEAD = 12  # lines of a difference that are shown, a third of them behind the first one that differs
CLEAN = [
    "--duration 4", "--duration 3 --esc 8 --seed 2", "--flight mission --esc 2 --duration 8 --seed 3",
    "--flight bench --duration 5 --seed 4", "--flight startup --duration 5 --esc 6", "--stock --duration 4 --esc 3",
    "--rate 100 --duration 2 --esc 2 --seed 9", "--bus-name can7 --start 2026-03-14T12:49:54 --duration 2 --esc 1",
    "--scenario esc-failure --seed 5 --esc 2", "--scenario command-loss --seed 6 --esc 2",
    "--scenario reordering --seed 7 --esc 3", "--scenario duplicate-node --seed 8 --esc 3",
    "--scenario pack-sag --seed 9 --esc 2", "--scenario bus-break --seed 10 --esc 2",
    "--scenario recording-ends --seed 11 --esc 4", "--fault-rate TRF-010=0.02 --fault-rate TRF-016=0.01 --duration 5",
]  # fmt: skip
FAULTY = 34  # flights that share all faults of the simulator among them


@dataclass(frozen=True)
class Job:
    """One case: the folder of the frozen captures, the case's name, and the arguments of its flight, if it is one.

    With a `command` no other one is run.
    """

    inputs: Path
    name: str
    flight: str | None = None
    command: str = ""


def flights() -> dict[str, str]:
    """Return the arguments of every simulated flight by the name of its file."""
    found = dict(enumerate(CLEAN))
    rules = re.findall(r"^([A-Z]+-\d+) ", frozen_outputs.run(["simulate", "--list"])[1], re.MULTILINE)
    for k in range(FAULTY):
        faults = " ".join(f"--fault {rule}" for rule in rules[k::FAULTY])
        plan = ("hover", "bench", "mission")[k % 3]
        found[len(found)] = f"--flight {plan} --duration 5 --esc 2 --seed {20 + k} {faults}"
    suffix = {1: "mcap", 2: "pcapng"}
    return {f"flight-{k:02}.{suffix.get(k % 10, 'log')}": args for k, args in found.items()}


def jobs(folder: Path, only: str, command: str = "") -> list[Job]:
    """Return the cases of a frozen folder, the slow ones first."""
    planned = json.loads((folder / "flights.json").read_text())
    inputs = folder / "inputs"
    names = sorted(
        {path.name for path in inputs.iterdir()} - planned.keys(), key=lambda name: -(inputs / name).stat().st_size
    )
    found = [Job(inputs, name) for name in names]
    found += [Job(inputs, name, args) for name, args in planned.items()]
    found += [Job(inputs, MERGED), Job(inputs, ONCE)]
    return [replace(job, command=command) for job in found if fnmatch(job.name, only)]


def case(job: Job) -> tuple[str, dict[str, str]]:
    """Return a case's name and all that its commands give, run in a folder of their own."""
    with tempfile.TemporaryDirectory() as place, contextlib.chdir(place):
        if job.name == ONCE:
            any_capture = shutil.copy(min(job.inputs.glob("*.log")), ".")
            return job.name, outputs(job, (line.format(any_capture) for line in frozen_outputs.ONCE))
        if job.name == MERGED:
            return job.name, outputs(job, merged(job.inputs))
        found = {}
        if job.flight is not None:
            found = outputs(job, [f"simulate {job.flight} -o OUT/{job.name} --key OUT/key.json"])
        if not (job.inputs / job.name).exists() and Path("OUT", job.name).exists():
            shutil.copy(f"OUT/{job.name}", job.inputs)  # `save` keeps what it has made
        if (job.inputs / job.name).exists():
            shutil.copy(job.inputs / job.name, ".")
            number = None if job.flight is None else int(job.name[7:9])
            found |= outputs(job, frozen_outputs.commands(job.name, number))
        return job.name, found


def outputs(job: Job, lines: Iterable[str]) -> dict[str, str]:
    """Return what these command lines write, or those of them that the job is about."""
    return frozen_outputs.outputs(line for line in lines if line.startswith(job.command))


def merged(inputs: Path) -> list[str]:
    """Return command lines for several captures at once, and put these into the current folder."""
    names = [path.name for path in sorted(inputs.glob("flight-0*"))[:3]]
    for name in names:
        shutil.copy(inputs / name, ".")
    a, b, c = names
    both = [f"{a} {b}", f"--same-bus {a} {a}", f"--bus left={a} --bus right={c} {a} {c}", f"--offset {b}=+1.5s {a} {b}"]
    lines = [f"{command} {some}" for some in both for command in ("decode", "info --all", "check --json -", "check")]
    lines += [f"convert {some} OUT/both.{suffix}" for some in both for suffix in ("log", "mcap")]
    return [*lines, f"export {both[2]} -o OUT/tables", f"plot {both[2]} -o OUT/p.rrd", f"check {a} missing.log"]


def run_all(todo: list[Job], workers: int) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the outputs of every case; the processes are renewed, for what libraries keep adds up."""
    os.environ.update(TZ="UTC", COLUMNS="120", NO_COLOR="1", RERUN_ANALYTICS="0")
    time.tzset()
    with get_context("spawn").Pool(workers, maxtasksperchild=8) as pool:
        yield from pool.imap_unordered(case, todo)


def save(folder: Path, workers: int, only: str) -> int:
    """Keep inputs and outputs in a new folder; return 1 if a command crashed."""
    crashed = 0
    inputs = folder / "inputs"
    inputs.mkdir(parents=True)
    for path in sorted(CAPTURES.iterdir()):
        if path.suffix in KINDS:
            shutil.copy(path, inputs)
    (folder / "flights.json").write_text(json.dumps(flights(), indent=1))
    todo = jobs(folder, only)
    first = [job for job in todo if job.name not in {MERGED, ONCE}]  # these need the flights
    for some in (first, todo[len(first) :]):
        for name, found in run_all(some, workers):
            (folder / f"{name}.json.gz").write_bytes(gzip.compress(json.dumps(found).encode(), 6, mtime=0))
            crashed += sum(text.startswith(f"exit {frozen_outputs.CRASHED}\n") for text in found.values())
    sys.stdout.write(f"{crashed} commands crashed\n" if crashed else "")
    return int(crashed > 0)


def compare(folder: Path, workers: int, only: str, command: str = "") -> int:
    """Print every difference from a frozen folder; return 1 if there is any."""
    differing = 0
    todo = jobs(folder, only, command)
    for name, found in run_all(todo, workers):
        old = json.loads(gzip.decompress((folder / f"{name}.json.gz").read_bytes()))
        for line in [*(line for line in old if line.startswith(command)), *sorted(found.keys() - old.keys())]:
            if old.get(line) != found.get(line):
                differing += 1
                sys.stdout.write(f"{name}: {line}\n{head(old.get(line), found.get(line))}")
                sys.stdout.flush()
    sys.stdout.write(f"{len(todo)} cases, {differing} outputs differ\n")
    return int(differing > 0)


def head(old: str | None, new: str | None) -> str:
    """Return the first lines of the difference of two texts; None is a file that is not there."""
    if old is None or new is None:
        return f"  only {'after' if old is None else 'before'}\n"
    before, after = old.splitlines(), new.splitlines()
    same = next(
        (k for k, (a, b) in enumerate(zip(before, after, strict=False)) if a != b), min(len(before), len(after))
    )
    window = slice(max(same - 2, 0), same + HEAD // 3)
    lines = difflib.unified_diff(before[window], after[window], lineterm="", n=1)
    shown = [f"  {line[:200]}\n" for line in lines if not line.startswith(("---", "+++", "@@"))][:HEAD]
    return f"  line {same + 1}\n" + "".join(shown)


def main() -> int:
    """Read the arguments."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=["save", "compare"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", default="*", metavar="GLOB", help="cases by name, as hover* or flight-0*")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--command", default="", help="compare the outputs of this command alone")
    args = parser.parse_args()
    if args.action == "save":
        return save(args.folder.resolve(), args.workers, args.only)
    return compare(args.folder.resolve(), args.workers, args.only, args.command)


if __name__ == "__main__":
    sys.exit(main())
