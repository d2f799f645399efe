"""The outputs that bench/freeze.py compares: a capture -> the text of every command, and of every file that it writes.

Everything runs in this process by `analyzer.cli.main`, in the current folder, and nothing else of the product is
imported: the rooms below the command line may move as they like.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import sys
import tempfile
import traceback
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analyzer.cli import main

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    import pyarrow as pa

FIELDS = "-T fields -e frame.number -e frame.time_relative -e ESCStatus.voltage -e PUSHCAN.MotorStatus.speed"
REPORTS = "--json OUT/r.json --html OUT/r.html --junit OUT/r.xml --markdown OUT/r.md -o OUT/r.txt"
# For every capture and flight; for every capture and a share of the flights (a vehicle file and its use in one share).
ALL = ["decode {}", "decode {} -V", "decode {} -x", f"decode {{}} {FIELDS}", "decode {} -T json", "decode {} -T csv"]
ALL += [
    "info {} --all",
    "info {} --types",
    "info {} -T json",
    f"check {{}} {REPORTS}",
    "check {} --github --select all --fail-on any:note",
]
ALL += ["convert {} OUT/c.log", "convert {} OUT/c.mcap", "convert {} OUT/c.pcapng", "export {} -o OUT/tables"]
ALL += ["plot {} -o OUT/p.rrd"]
SOME = ["decode {} -T jsonl", "export {} -F arrow -o OUT/tables", "export {} -F csv -o OUT/tables"]
SOME += ["export {} -o OUT/e.mcap", "export {} --table findings -o OUT/f.mcap", "check {} --all"]
SOME += [
    "check {} --init -o OUT/vehicle.toml --force",
    "plot {} --max-points 100 --from 1 -o OUT/p.rrd",
    "info {} --last 1s",
]
SOME += [
    "check {} --from 1 --to 2 --extract OUT/cut",
    "check {} --vehicle OUT/vehicle.toml --json -",
    "decode {} -q",
]
SOME += ["decode {} -V -x --last 0.05", "decode {} -x --frames 100-140", "decode {} -t e --from 1 --to 1.2"]
SOME += ["decode {} -c 20 -t ud", "decode {} --around 50 -O ESCStatus", "convert {} --last 0.5 OUT/c.log.gz", "info {}"]
SOME += ["check {} --baseline OUT/r.json --ignore TRF,BUS --json -", "check {} --bitrate 1000000 --html -"]
SHARE = 4  # one flight in so many runs a command of `SOME`
ONCE = [
    "--help",
    "explain --list",
    "explain --markdown",
    "explain TRF-010 BUS",
    "explain NO-1",
    "simulate --list",
    "check",
]
ONCE += [
    "info missing.log",
    "decode -T yaml a.log",
    "live --list",
    "simulate --fault NO-1 -o OUT/x.log",
    "decode -O NoType {}",
]

CRASHED = -1  # instead of an exit status
_DEPRECATED = re.compile(r".*deprecated.*\n")  # an old option tells of its new name
_OLD_NAMES = {"--vehicle": ("check", "--profile"), "--flight": ("simulate", "--profile")}


def commands(name: str, flight: int | None) -> list[str]:
    """Return the command lines for the capture of that name; a flight, which has a number, takes its share of some."""
    some = SOME if flight is None else SOME[flight % SHARE :: SHARE]
    return [line.format(name) for line in ALL + some]


def outputs(lines: Iterable[str]) -> dict[str, str]:
    """Return what every command line writes, by the line and the name of the stream or file.

    Files written to OUT stay for the next lines; only those that a line changed count as its output.
    """
    found: dict[str, str] = {}
    shutil.rmtree("OUT", ignore_errors=True)
    Path("OUT").mkdir()
    for line in lines:
        before = {path: path.stat().st_mtime_ns for path in _files()}
        status, out, err = run(line.split())
        found[line] = f"exit {status}\n-- stdout\n{out}-- stderr\n{err}"
        for path in _files():
            if before.get(path) != path.stat().st_mtime_ns:
                found[f"{line} > {path}"] = text_of(path)
        if "OUT/tables" in line:
            shutil.rmtree("OUT/tables", ignore_errors=True)
    return found


def run(args: list[str]) -> tuple[int, str, str]:
    """Run one command in this process; return its exit status and both streams, without what a clock decides."""
    args = [_known(arg) for arg in args]
    kept, streams = [os.dup(number) for number in range(3)], (sys.stdin, sys.stdout, sys.stderr)
    null = os.open(os.devnull, os.O_RDONLY)
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        try:
            for number, target in enumerate((null, out.fileno(), err.fileno())):
                os.dup2(target, number)
            sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115 - restored below
            sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
            sys.stderr = open(2, "w", encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
            status = _safely(args)
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            for number, old in enumerate(kept):
                os.dup2(old, number)
                os.close(old)
            os.close(null)
            sys.stdin, sys.stdout, sys.stderr = streams
        texts = []
        for stream in (out, err):
            stream.seek(0)
            texts.append(stream.read().decode(errors="backslashreplace"))
    return status, texts[0], _DEPRECATED.sub("", texts[1])


def _safely(args: list[str]) -> int:
    try:
        return main(args)
    except Exception:  # noqa: BLE001 - a crash is a difference, too
        traceback.print_exc()
        return CRASHED


def text_of(path: Path) -> str:
    """Return what a file holds as text that differs only if its content does."""
    readers: dict[str, Callable[[Path], Iterable[str]]] = {".parquet": _parquet, ".arrow": _arrow, ".rrd": _recording}
    if path.suffix in readers:
        return "\n".join(readers[path.suffix](path)) + "\n"
    data = path.read_bytes()
    if path.suffix in {".log", ".mcap", ".pcapng", ".gz", ".csv"}:
        return f"{len(data)} bytes, sha256 {hashlib.sha256(data).hexdigest()}\n"
    return data.decode(errors="backslashreplace")


def option(name: str) -> str:
    """Return the option, or the name that it had before."""
    command, old = _OLD_NAMES[name]
    if name not in _HELP:
        _HELP[name] = name in run([command, "--help"])[1]
    return name if _HELP[name] else old


_HELP: dict[str, bool] = {}


def _known(arg: str) -> str:
    return option(arg) if arg in _OLD_NAMES else arg


def _files() -> list[Path]:
    return sorted(path for path in Path("OUT").rglob("*") if path.is_file())


def _digest(values: Any) -> str:
    return hashlib.sha256(repr(values).encode()).hexdigest()[:16]


def _parquet(path: Path) -> Iterator[str]:
    import pyarrow.parquet as pq  # noqa: PLC0415 - takes half a second

    yield from _table(pq.read_table(path))


def _arrow(path: Path) -> Iterator[str]:
    import pyarrow as pa  # noqa: PLC0415 - as above

    with pa.ipc.open_file(path) as reader:
        yield from _table(reader.read_all())


def _table(table: pa.Table) -> Iterator[str]:
    yield f"{table.num_rows} rows {sorted((table.schema.metadata or {}).items())}"
    for field, column in zip(table.schema, table.columns, strict=True):
        metadata = sorted((field.metadata or {}).items())
        yield f"{field.name} {field.type} {'' if field.nullable else 'not null '}{_digest(_cells(column))} {metadata}"


def _cells(column: Any) -> list[Any]:
    import pyarrow as pa  # noqa: PLC0415 - as above

    if pa.types.is_temporal(column.type):
        column = column.cast(pa.int64())
    return list(column.to_pylist())


def _recording(path: Path) -> Iterator[str]:
    """Yield every store, and every column of every entity; the order of chunks and the IDs of rows are accidents."""
    from rerun.chunk import RrdReader  # noqa: PLC0415 - takes a second

    reader = RrdReader(path)
    yield from sorted(f"{one.kind} {one.application_id}" for one in (*reader.recordings(), *reader.blueprints()))
    columns: dict[tuple[str, ...], list[Any]] = defaultdict(list)
    for chunk in reader.stream():
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if not name.startswith("rerun.")]
        kind = "static" if chunk.is_static else "rows"
        for name in names:
            field = batch.schema.field(name)
            columns[chunk.entity_path, kind, ",".join(names), name, str(field.type)] += _cells(batch.column(name))
    for key in sorted(columns):
        yield f"{' '.join(key)}: {len(columns[key])} values {_digest(columns[key])}"
