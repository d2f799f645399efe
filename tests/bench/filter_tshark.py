"""Asks tshark which frames filters select, and writes its answers to tests/filter/tshark.json.

    python tests/bench/filter_tshark.py [FILTER...]

Filters that stand there are asked for again, and those on the command line, too: of parts of two captures, whose frames
are listed, and of every capture of the repository, where their count and the sum of their numbers stand. Needs tshark.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from itertools import groupby
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))
from kit import CAPTURES, TESTS

from analyzer.cli import main as tailbyte

KNOWN = TESTS / "filter" / "tshark.json"
FORMATS = (".log", ".mcap", ".txt")
OF_CAN = "(can || canfd)"  # a comment is a record of its own, which tshark numbers, too, and no frame


def asked(tshark: str, capture: Path, text: str) -> list[int]:
    """Return the numbers of the frames that tshark selects."""
    arguments = [tshark, "-r", str(capture), "-Y", text, "-T", "fields", "-e", "frame.number"]
    found = subprocess.run(arguments, capture_output=True, text=True, check=False, env={"TZ": "UTC"})
    if found.returncode:
        sys.exit(f"tshark does not take {text!r}: {found.stderr.strip()}")
    return list(map(int, found.stdout.split()))


def spans(numbers: list[int]) -> str:
    """Write numbers as the file has them: `1-5 7`."""
    runs = ([n for _, n in run] for _, run in groupby(enumerate(numbers), lambda pair: pair[1] - pair[0]))
    return " ".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)


def summaries(tshark: str, capture: Path, texts: list[str]) -> dict[str, str]:
    """Return how many frames each filter selects, and the sum of their numbers; as many as can be in one reading."""
    found = {}
    for text in texts:
        if "," in text:  # which ends a filter of a statistic
            numbers = asked(tshark, capture, f"{OF_CAN} && ({text})")
            found[text] = f"{len(numbers)} {sum(numbers)}"
    together = [text for text in texts if text not in found]
    filters = [f"frame.number && {OF_CAN} && ({text})" for text in together]
    columns = [f"{how}(frame.number){text}" for text in filters for how in ("COUNT", "SUM")]
    arguments = [tshark, "-r", str(capture), "-q", "-z", ",".join(["io,stat,0", *columns])]
    table = subprocess.run(arguments, capture_output=True, text=True, check=True, env={"TZ": "UTC"}).stdout
    row = next(line for line in table.splitlines() if "<>" in line)
    cells = [cell.strip() for cell in row.split("|")[2:-1]][: len(columns)]
    if len(cells) != len(columns):
        sys.exit(f"tshark answers something else: {row}")
    pairs = zip(cells[::2], cells[1::2], strict=True)
    found |= {text: f"{count} {total}" for text, (count, total) in zip(together, pairs, strict=True)}
    return {text: found[text] for text in texts}


def main(more: list[str]) -> None:
    """Write the file anew."""
    tshark = shutil.which("tshark")
    if tshark is None:
        sys.exit("tshark is not installed")
    known = json.loads(KNOWN.read_text())
    version = subprocess.run([tshark, "--version"], capture_output=True, text=True, check=True).stdout
    known["tshark"] = version.split()[2].rstrip(".")
    with tempfile.TemporaryDirectory() as folder:
        captures = {}
        for name, (first, last) in known["parts"].items():
            lines = (CAPTURES / f"{name}.log").read_text().splitlines(keepends=True)[first - 1 : last]
            part, captures[name] = Path(folder, f"{name}.log"), Path(folder, f"{name}.pcapng")
            part.write_text("".join(lines))
            tailbyte(["convert", str(part), str(captures[name])])
        known["frames"] = {
            text: {name: spans(asked(tshark, capture, text)) for name, capture in captures.items()}
            for text in dict.fromkeys([*known["frames"], *more])
        }
        known["captures"] = {}
        for path in sorted(one for one in CAPTURES.iterdir() if one.suffix in FORMATS):
            whole = Path(folder, f"{path.name}.pcapng")
            tailbyte(["convert", str(path), str(whole)])
            known["captures"][path.name] = [*summaries(tshark, whole, [*known["frames"]]).values()]
    KNOWN.write_text(json.dumps(known, indent=1) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
