"""What a fleet run costs beside a bare process pool that does the same work: python tests/bench/fleet_cost.py

    python tests/bench/fleet_cost.py [--logs 20 60 200] [--seconds 228] [--workers 2] [--folder DIR]

Makes logs of a flight (880 frames a second; 228 s are 200 k frames), every second one packed, judges them by a pool of
processes and by `tailbyte fleet check`, and prints the CPU of both with all their processes, for growing numbers of
logs, so that the fixed part and the cost a capture stand apart. Of each the part in brackets is what the workers' own
clocks say of the captures, which is the same work and differs only by what else the machine does: `beside judging` is
what is left, the cluster, the store and the start, less what is left of the pool. Peak memory is the largest of any
one process.
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

from analyzer.fleet.store import ResultStore

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

ROOT = Path(__file__).resolve().parents[2]
_POOL = """
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from analyzer.fleet.jobs import FleetSettings, Job, Retries
from analyzer.fleet.preload import quick_start
from analyzer.fleet.worker import judge

def one(path):
    return judge(Job(path, "", None, "", "", ""), FleetSettings(), Retries())

if __name__ == "__main__":
    with ProcessPoolExecutor(int(sys.argv[1]), get_context("spawn"), quick_start) as pool:
        judging = sum(rows["captures"][0]["cpu_s"] for rows in pool.map(one, sys.argv[2:]))
    Path(sys.argv[0]).with_suffix(".judging").write_text(str(judging))
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
    for name, usual in (("seconds", 228), ("workers", 2)):
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
        its = float(script.with_suffix(".judging").read_text())
        command = [sys.executable, "-m", "analyzer", "fleet", "check", *paths[:some], "-o", str(folder / "results")]
        fleet, fleet_mb = cpu([*command, "--workers", str(args.workers)])
        ((judging,),) = ResultStore(str(folder / "results")).connected().execute("select cpu_s from runs").fetchall()
        spent.append((some, fleet - pool, fleet - judging - (pool - its)))
        sys.stdout.write(
            f"{some:>5} logs  pool {pool:6.1f} s ({its:6.1f})  fleet {fleet:6.1f} s ({judging:6.1f})  more "
            f"{fleet - pool:+5.1f} s, beside judging {spent[-1][2]:+5.1f} s  peak {pool_mb:.0f}, {fleet_mb:.0f} MB\n"
        )
        sys.stdout.flush()
    for (few, *before), (many, *after) in pairwise(spent):
        more, beside = ((late - early) / (many - few) * 1000 for early, late in zip(before, after, strict=True))
        sys.stdout.write(f"{few} to {many}: {more:.1f} ms a capture more, {beside:.1f} beside judging\n")
    if args.folder is None:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
