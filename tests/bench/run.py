"""Measure the main jobs in one run: python tests/bench/run.py [LOG] [--frames N] [--faulty N] [--runs N] [--counts]

Without LOG the log of make_log.py is made first; a second table is about the logs of make_faults.py. Every row is run
once for nothing and then `--runs` times, in turn, so that a busy machine hurts all rows alike; the tables show medians
of processor time (of all threads) and of the clock. The Python readers work on the first frames only (200 k and 20 k):
their time per frame does not depend on the length. Peers that are programs (tshark, log2long) are run if they are
installed. With --counts valgrind counts instructions instead, of a longer log less those of a shorter one.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench import make_faults, make_log
from bench.cost import Cost, Row, in_turn, instructions, of_call, of_process, tailbyte

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

CHUNK = 1 << 20
READER_FRAMES, DECODER_FRAMES, PEER_FRAMES, ROW_FRAMES = 200_000, 20_000, 500_000, 1_000_000
COUNTED_FRAMES = 20_000, 120_000
REFERENCE = "python-can + pydronecan"


def core(log: Path) -> None:
    """The native core alone, on one core: frames, transfers, anomalies, and the columns of every known type."""
    import dissectors  # noqa: PLC0415
    from analyzer import _native  # noqa: PLC0415

    registry = dissectors.load()
    engine = _native.Pipeline(registry.signatures)
    decoders = {}
    with log.open("rb", buffering=0) as source:
        while chunk := source.read(4 * CHUNK):
            engine.feed(chunk)
            _, groups = engine.take()
            for group in groups:
                key = group.kind, group.type_id, group.variant
                if key not in decoders:
                    message = registry.message(*key)
                    decoders[key] = _native.Decoder(message.plan())
                    for place in range(len(message.layout.fields)):
                        decoders[key].show(place, [])
                decoders[key].table(group, 0)
    engine.finish()
    engine.take()


def tables(log: Path) -> None:
    """Bytes to Arrow tables inside this process: the same, with packets, bit parts, units and derived values."""
    from analyzer.decode.engine import Engine  # noqa: PLC0415 - the other rows do not need it

    engine = Engine()
    with log.open("rb", buffering=0) as source:
        while chunk := source.read(CHUNK):
            for batch in engine.feed(chunk):
                dict(batch.messages)  # each table is made when somebody looks at it
    dict(engine.finish().messages)


def python_can(log: Path) -> None:
    from can.io import CanutilsLogReader  # noqa: PLC0415

    with CanutilsLogReader(log) as reader:
        for _ in reader:
            pass


def pydronecan(log: Path) -> None:
    """Every frame read, every transfer put together and unpacked."""
    from can.io import CanutilsLogReader  # noqa: PLC0415
    from dronecan.transport import Frame, Transfer, TransferManager  # noqa: PLC0415

    manager = TransferManager()
    with CanutilsLogReader(log) as reader:
        for message in reader:
            whole = manager.receive_frame(Frame(message.arbitration_id, message.data, ts_monotonic=message.timestamp))
            if whole:
                Transfer().from_frames(whole)


def jobs(log: Path, folder: Path) -> dict[str, list[str]]:
    """Return what is run as a process of its own on a whole log."""
    return {
        "decode -q": tailbyte("decode", "-q", log),
        "info": tailbyte("info", log),
        "check": tailbyte("check", log),
        "check --threads 1": tailbyte("check", "--threads", 1, log),
        "export to Parquet": tailbyte("export", "--force", log, "-o", folder / "tables"),
        "plot": tailbyte("plot", log, "-o", folder / "plot.rrd"),
    }


def lists(log: Path) -> dict[str, list[str]]:
    """Return the ways to show every transfer."""
    forms = {form: tailbyte("decode", "-T", form, log) for form in ("jsonl", "csv")}
    fields = tailbyte("decode", "-T", "fields", "-e", "frame.number", "-e", "ESCStatus.rpm", log)
    named = {"list": tailbyte("decode", log), **forms, "fields": fields, "-x": tailbyte("decode", "-x", log)}
    return {f"decode, {name}": command for name, command in named.items()} | {
        "decode -V": tailbyte("decode", "-V", log)
    }


def peers(log: Path, folder: Path) -> dict[str, list[str]]:
    """Return the programs of others that are installed."""
    out = {}
    if tshark := shutil.which("tshark"):
        pcap = folder / "peer.pcapng"
        subprocess.run(tailbyte("convert", log, pcap), check=True, stderr=subprocess.DEVNULL)
        out["tshark"] = [tshark, "-r", str(pcap)]
    if log2long := shutil.which("log2long"):
        out["log2long"] = ["sh", "-c", f'exec "{log2long}" < "{log}"']
    return out


def first(source: Path, target: Path, lines: int) -> Path:
    with source.open("rb") as whole, target.open("wb") as part:
        part.writelines(islice(whole, lines))
    return target


def lines_of(path: Path) -> int:
    with path.open("rb") as file:
        return sum(block.count(b"\n") for block in iter(lambda: file.read(CHUNK), b""))


def table(rows: Sequence[Row], reference: float) -> str:
    """Return a table of rows; `reference` are the nanoseconds a frame that the last column compares with."""
    out = [f"{'':34}{'frames/s':>14}{'ns/frame':>10}{'by clock':>10}{'x ' + REFERENCE:>26}{'peak MB':>9}"]
    for row in rows:
        peak = f"{row.peak / 1e6:.0f}" if row.peak else "-"
        speed, times = 1e9 / row.processor, reference / row.processor
        out.append(f"{row.name:34}{speed:14,.0f}{row.processor:10,.1f}{row.wall:10,.1f}{times:26,.1f}{peak:>9}")
    return "\n".join(out)


def healthy(path: Path, folder: Path) -> list[Row]:
    """Return the rows about a log without faults."""
    frames = lines_of(path)
    short = {count: first(path, folder / f"{count}.log", count) for count in SHORT}
    call = {name: partial(of_call, partial(run, path)) for name, run in ((CORE, core), (ENGINE, tables))}
    whole: dict[str, Callable[[], Cost]] = {"wc -l": partial(of_process, ["wc", "-l", str(path)]), **call}
    whole |= {name: partial(of_process, command) for name, command in jobs(path, folder).items()}
    rows = [Row(name, frames, run) for name, run in whole.items()]
    part = min(frames, ROW_FRAMES)
    rows += [Row(name, part, partial(of_process, command)) for name, command in lists(short[ROW_FRAMES]).items()]
    others = peers(short[PEER_FRAMES], folder)
    rows += [Row(name, min(frames, PEER_FRAMES), partial(of_process, command)) for name, command in others.items()]
    for name, count, run in (("python-can reader", READER_FRAMES, python_can), (REFERENCE, DECODER_FRAMES, pydronecan)):
        rows.append(Row(name, min(frames, count), partial(of_call, partial(run, short[count]))))
    return rows


CORE, ENGINE = "core, to typed columns", "Engine, to Arrow tables"
SHORT = (READER_FRAMES, DECODER_FRAMES, PEER_FRAMES, ROW_FRAMES)


def faulty(folder: Path, frames: int) -> list[Row]:
    """Return the rows about logs that are full of faults."""
    rows = []
    for kind in make_faults.KINDS:
        log = folder / f"{kind}.log"
        make_faults.write(log, kind, frames)
        wanted = jobs(log, folder)
        names = ("info", "check", "export to Parquet")
        rows += [Row(f"{kind}: {name}", frames, partial(of_process, wanted[name])) for name in names]
    return rows


def counts(folder: Path) -> str:
    """Return how many instructions a frame takes, start-up apart."""
    logs = []
    for frames in COUNTED_FRAMES:
        logs.append(folder / f"counted-{frames}.log")
        make_log.write(logs[-1], frames)
    out = [f"{'':34}{'instructions/frame':>20}{'start-up, M':>14}"]
    for name in jobs(logs[0], folder):
        less, more = (instructions(jobs(log, folder)[name]) for log in logs)
        each = (more - less) / (COUNTED_FRAMES[1] - COUNTED_FRAMES[0])
        out.append(f"{name:34}{each:20,.0f}{(less - each * COUNTED_FRAMES[0]) / 1e6:14,.0f}")
    return "\n".join(out)


def measured(path: Path, folder: Path, faults: int, runs: int) -> str:
    """Return both tables, with medians of so many runs."""
    rows = healthy(path, folder)
    worst = faulty(folder, faults) if faults else []
    in_turn(rows + worst, runs)
    reference = next(row for row in rows if row.name == REFERENCE).processor
    parts: Mapping[str, list[Row]] = {f"{rows[0].frames:,} frames": rows, f"{faults:,} frames full of faults": worst}
    return "\n".join(f"{of}, medians of {runs} runs\n{table(some, reference)}\n" for of, some in parts.items() if some)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path, nargs="?", help="candump -l text; made when not given")
    parser.add_argument("--frames", type=int, default=10_000_000, help="of the log that is made")
    parser.add_argument(
        "--faulty", type=int, default=200_000, metavar="N", help="frames of each log of faults, 0: none"
    )
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--counts", action="store_true", help="instructions in place of time")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.counts:
            sys.stdout.write(f"{counts(folder)}\n")
            return
        path = options.log or folder / "flight.log"
        if not options.log:
            make_log.write(path, options.frames)
        sys.stdout.write(measured(path, folder, options.faulty, options.runs))


if __name__ == "__main__":
    main()
