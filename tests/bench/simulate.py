"""Measure the simulator: python tests/bench/simulate.py [--minutes N] [--runs N]

Every plan flies with 8 ESCs into a candump log. The table shows the median time and how many times faster than the
clock that is; the goal is ten.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FLIGHT_PLANS = ("hover", "mission", "bench", "startup")


def fly(plan: str, minutes: float, path: Path) -> float:
    """Seconds that one run takes, process start included."""
    program = "import sys; from analyzer.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", program, "simulate", "-o", str(path), "--esc", "8"]
    begin = time.perf_counter()
    subprocess.run(
        [*command, "--flight", plan, "--duration", f"{minutes * 60:g}"], check=True, stderr=subprocess.DEVNULL
    )
    return time.perf_counter() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--runs", type=int, default=3)
    args = parser.parse_args()
    sys.stdout.write(f"{'plan':8} {'seconds':>8} {'frames':>9} {'us/frame':>9} {'x clock':>8}\n")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.log"
        for plan in FLIGHT_PLANS:
            seconds = statistics.median(fly(plan, args.minutes, path) for _ in range(args.runs))
            frames = path.read_bytes().count(b"\n")
            ratio = args.minutes * 60 / seconds
            sys.stdout.write(f"{plan:8} {seconds:8.1f} {frames:9} {seconds / frames * 1e6:9.1f} {ratio:8.0f}\n")


if __name__ == "__main__":
    main()
