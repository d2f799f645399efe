"""Valid captures of every format, damaged in every way, through every command: no traceback, and sums that agree.

    python tests/bench/damage.py [--runs 20000] [--seed 1] [--workers 2]

A capture is cut, or bytes of it are changed, taken out, doubled, swapped or filled up, once or a few times, in the
packed bytes or in those below a compression. Every run must end with a documented status, say what it says in
printable lines that begin with the program's name or with `--`, and account for every line and frame. Exit status 1 if
one does not.
"""

from __future__ import annotations

import argparse
import gzip
import io
import os
import random
import re
import sys
import tempfile
import traceback
from collections import Counter
from contextlib import redirect_stderr, redirect_stdout
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import zstandard

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from kit import CAPTURES
from kit.libraries import WRITERS, library_file
from kit.rows import FD, records

from analyzer._native import FrameBatch
from analyzer.cli import main
from analyzer.sources import Source

LINES = 240
CONVERTED = ("log", "pcapng", "mcap")
PACKINGS = {"": bytes, ".gz": gzip.compress, ".zst": zstandard.compress}
COMMANDS = (
    ("decode", "-q"), ("check",), ("info",), ("decode", "-T", "jsonl"), ("decode", "--frame-list"), ("decode", "-V"),
    ("check", "--json", "-"), ("decode", "-x", "--findings"), ("convert", "{out}.log"), ("export", "-o", "{out}"),
)  # fmt: skip
STATUSES = {0, 1, 3, 4}
SUM = re.compile(r"(\d+) (?:lines|records|frames) = ([^;]*)")
MF4_SHARE = 50  # one of so many runs: each is a process of its own


@cache
def wholes() -> dict[str, bytes]:
    """The captures by suffix, of traffic with faults, CAN FD and error frames."""
    text = b"".join(
        line
        for name in ("faults.log", "fd.log", "services.log", "startup.log")
        for line in (CAPTURES / name).read_bytes().splitlines(keepends=True)[:LINES]
    )
    made: dict[str, bytes] = {}
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "x.log")
        source.write_bytes(text)
        for suffix in CONVERTED:
            target = Path(folder, f"y.{suffix}")
            with redirect_stderr(io.StringIO()):
                main(["convert", str(source), str(target)])
            made[f".{suffix}"] = target.read_bytes()
        pieces = Source(str(target.with_suffix(".pcapng"))).chunks()
        found = list(records(piece for piece in pieces if isinstance(piece, FrameBatch)))
    for suffix in WRITERS:
        made[suffix] = library_file(suffix, [one for one in found if suffix != ".trc" or not one.flags & FD])
    return made


def damaged(data: bytes, chance: random.Random) -> tuple[str, bytes]:
    """The kinds of damage, and what they left."""
    kinds = []
    for _ in range(chance.choice((1, 1, 1, 2, 5))):
        kind = chance.choice(("cut", "flip", "byte", "take", "double", "swap", "zeros", "noise"))
        at = chance.randrange(len(data) + 1)
        size = min(chance.choice((1, 2, 8, 64, 1000)), len(data) - at)
        part = data[at : at + size]
        if kind == "cut":
            data = data[:at]
        elif kind == "take":
            data = data[:at] + data[at + size :]
        elif kind == "double":
            data = data[:at] + part + data[at:]
        else:
            new = {
                "flip": bytes(byte ^ (1 << chance.randrange(8)) for byte in part[:1]) + part[1:],
                "byte": chance.randbytes(1)[: len(part)] + part[1:],
                "swap": part[::-1],
                "zeros": bytes(size),
                "noise": chance.randbytes(size),
            }[kind]
            data = data[:at] + new + data[at + size :]
        kinds.append(kind)
    return "+".join(kinds), data


def attempt(seed: int) -> tuple[str, int, str]:
    """Damage one capture and run one command on it; return format, status and what was wrong."""
    chance = random.Random(seed)
    formats = sorted(wholes())
    suffix = ".mf4" if seed % MF4_SHARE == 0 else chance.choice([one for one in formats if one != ".mf4"])
    packing = chance.choice(("", "", ".gz", ".zst"))
    kinds, data = damaged(wholes()[suffix], chance)
    data = PACKINGS[packing](data)
    if packing and chance.random() < 0.5:
        kinds, data = damaged(PACKINGS[packing](wholes()[suffix]), chance)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"x{suffix}{packing}")
        path.write_bytes(data)
        words = [word.replace("{out}", str(Path(folder, "out"))) for word in chance.choice(COMMANDS)]
        out, err = io.StringIO(), io.StringIO()
        out.buffer = io.BytesIO()  # type: ignore[attr-defined]  # what binary output asks for
        status, wrong = -1, ""
        try:
            with redirect_stdout(out), redirect_stderr(err):
                status = main([words[0], str(path), *words[1:]])
        except BaseException:  # noqa: BLE001 - that is what is looked for
            wrong = traceback.format_exc(limit=-3)
    wrong = wrong or complaint(status, err.getvalue())
    return suffix + packing, status, wrong and f"seed {seed}: {' '.join(words)} {kinds}: {wrong}"


def complaint(status: int, err: str) -> str:
    """What a run said that it should not; empty if all is well."""
    lines = err.splitlines()
    if status not in STATUSES:
        return f"exit status {status}: {err[:300]}"
    odd = [line for line in lines if not line.startswith(("tailbyte: ", "-- ")) or not line.isprintable()]
    if odd:
        return f"odd line {odd[0]!r}"
    if status == 3 and not lines:
        return "damage, and not a word"
    for total, parts in SUM.findall(lines[-1] if lines else ""):
        if int(total) != sum(int(number) for number in re.findall(r"\d+", parts)):
            return f"sums: {lines[-1]}"
    return ""


def silence() -> None:
    """Let go of standard output: reports are written to it whatever Python calls so."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def run() -> int:
    """Run the campaign; print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    args = parser.parse_args()
    table: dict[str, Counter[int]] = {}
    wrongs = []
    first = args.seed * 1_000_000
    with get_context("spawn").Pool(args.workers, silence) as pool:
        for name, status, wrong in pool.imap_unordered(attempt, range(first, first + args.runs), chunksize=50):
            table.setdefault(name, Counter())[status] += 1
            if wrong:
                wrongs.append(wrong)
                sys.stderr.write(f"{wrong}\n")
    sys.stdout.write(
        "| Format | Runs | whole | findings | damage told | nothing to judge |\n|---|---:|---:|---:|---:|---:|\n"
    )
    for name, counts in sorted(table.items()):
        cells = (counts.total(), *(counts[status] for status in sorted(STATUSES)))
        sys.stdout.write(f"| {name} | {' | '.join(map(str, cells))} |\n")
    sys.stdout.write(f"{args.runs} runs, {len(wrongs)} wrong\n")
    return bool(wrongs)


if __name__ == "__main__":
    sys.exit(run())
