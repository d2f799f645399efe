"""Faults made and judged by the document alone: transport faults in frames of a capture, and faults of simulated ESCs.

    python tests/bench/outside [--cases 350] [--seed 1] [--kinds frame,CRC] [--each] [CAPTURE...]

A capture is `candump -l` text of classic 29-bit frames; without one, those of `captures/` that have no fault. Half of
the cases are damaged captures, half are flights sent by `kit.encode`. What a capture says without the fault does not
count. A fault must be found (recall), by a rule that names its cause, and nothing may be said that it does not explain.
Each miss is told as it comes. Exit status 1 if less than 99.5 % are found, less than 99 % with their cause, or anything
is unexplained.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from bench.outside import campaign
from bench.outside.kinds import Score, table

ROOT = Path(__file__).resolve().parents[3]
CAPTURES = tuple(ROOT / "captures" / name for name in ("hover.log", "hover-4.log", "startup.log"))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", nargs="*", type=Path, default=CAPTURES)
    parser.add_argument("--cases", type=int, default=350, help="of each half")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", default="", help="words in the names of kinds, with commas between them")
    parser.add_argument("--each", action="store_true", help="a row for each kind")
    args = parser.parse_args()
    whole = Score()
    for title, scores in campaign.run(args.captures, args.cases, args.seed, args.kinds.split(",")):
        sys.stdout.write(f"\n{title}\n\n" + "\n".join(table(scores, each=args.each)) + "\n\n")
        for one in scores.values():
            whole.add(one)
    return int(whole.found < 0.995 * whole.cases or whole.cause < 0.99 * whole.cases or bool(whole.wrong))


if __name__ == "__main__":
    sys.exit(main())
