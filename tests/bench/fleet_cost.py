"""What a fleet run costs beside a bare process pool that does the same work: python tests/bench/fleet_cost.py

    python tests/bench/fleet_cost.py [--logs 20 60 200] [--seconds 200] [--workers 2] [--folder DIR]

Makes logs of a flight (some 1,000 frames a second; 200 s are 200 k frames), every second one packed, judges them by a
pool of processes and by `tailbyte fleet check`, and prints the CPU of both with all their processes, for growing
numbers of logs, so that the fixed part and the cost a capture stand apart. `judging` is what the workers' own clocks
say of the captures: what is left is the cluster, the store and the start, whatever the machine does besides. Peak
memory is the largest of any one process.
"""

from __future__ import annotations

import argparse
import gzip
import multiprocessing
import resource
import shutil
import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from analyzer.fleet.store import Store

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

ROOT = Path(__file__).resolve().parents[2]
_POOL = """
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from analyzer.fleet.jobs import FleetSettings, Job, Retries
from analyzer.fleet.preload import quick_start
from analyzer.fleet.worker import judge

def one(path):
    return judge(Job(path, "", None, "", "", ""), FleetSettings(), Retries())

if __name__ == "__main__":
    with ProcessPoolExecutor(int(sys.argv[1]), get_context("spawn"), quick_start) as pool:
        print(sum(len(rows["captures"]) for rows in pool.map(one, sys.argv[2:])))
"""


def make(folder: Path, logs: int, seconds: int) -> list[str]:
    """Return the paths of logs that are made where they are not there yet."""
    folder.mkdir(parents=True, exist_ok=True)
    base = folder / f"flight-{seconds}.base"
    if not base.exists():
        command = [sys.executable, "-m", "analyzer", "simulate", "-F", "candump", "-o", str(base)]
        subprocess.run([*command, "--duration", str(seconds)], check=True, cwd=ROOT, stderr=subprocess.DEVNULL)
    data = base.read_bytes()
    paths = []
    for number in range(logs):
        path = folder / f"{number:04}.log{'.gz' if number % 2 else ''}"

        if not path.exists():
            path.write_bytes(gzip.compress(data, 1, mtime=number) if number % 2 else data)
        paths.append(str(path))
    return paths


def cpu(command: list[str]) -> tuple[float, float]:
    """Return CPU seconds and peak MB of a command with all processes that it started and waited for."""
    reader, writer = multiprocessing.Pipe(duplex=False)
    child = multiprocessing.get_context("fork").Process(target=_measured, args=(command, writer))
    child.start()
    found: tuple[float, float] = reader.recv()
    child.join()
    return found


def _measured(command: list[str], out: Connection) -> None:
    subprocess.run(command, check=False, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    out.send((used.ru_utime + used.ru_stime, used.ru_maxrss / 1024))


def main() -> None:
    """Measure what the arguments ask for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=int, nargs="+", default=[20, 60, 200])
    for name, usual in (("seconds", 200), ("workers", 2)):
        parser.add_argument(f"--{name}", type=int, default=usual)
    parser.add_argument("--folder", type=Path)
    args = parser.parse_args()
    folder = args.folder or Path(tempfile.mkdtemp())
    paths = make(folder / "logs", max(args.logs), args.seconds)
    script = folder / "pool.py"
    script.write_text(_POOL)
    spent: list[tuple[int, float, float]] = []
    for some in sorted(args.logs):
        shutil.rmtree(folder / "results", ignore_errors=True)
        pool, pool_mb = cpu([sys.executable, str(script), str(args.workers), *paths[:some]])
        command = [sys.executable, "-m", "analyzer", "fleet", "check", *paths[:some], "-o", str(folder / "results")]
        fleet, fleet_mb = cpu([*command, "--workers", str(args.workers)])
        ((judging,),) = Store(str(folder / "results")).connected().execute("select cpu_s from runs").fetchall()
        spent.append((some, fleet - pool, fleet - judging))
        sys.stdout.write(
            f"{some:>5} logs  pool {pool:7.1f} s  fleet {fleet:7.1f} s  judging {judging:7.1f} s  beside the pool "
            f"{fleet - pool:+5.1f} s  beside judging {fleet - judging:+5.1f} s  peak {pool_mb:.0f}, {fleet_mb:.0f} MB\n"
        )
        sys.stdout.flush()
    for (few, *before), (many, *after) in pairwise(spent):
        pool, judging = ((late - early) / (many - few) * 1000 for early, late in zip(before, after, strict=True))
        sys.stdout.write(f"{few} to {many}: {pool:.1f} ms a capture beside the pool, {judging:.1f} beside judging\n")
    if args.folder is None:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
