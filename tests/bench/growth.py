"""How cost grows: python tests/bench/growth.py [--frames N ...] [--runs N]

Tables of processor time a frame and of peak memory, as `decode -q` and `check` need them: by the length of a flight, by
its nodes (the same flight on more interfaces, the frames shared out), by the number of types on a bus, and by how many
frames are damaged. A program whose cost is linear has one figure in each column, start-up apart.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
from functools import partial
from itertools import cycle, islice
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import dronecan
from bench import make_faults, make_log
from bench.cost import Row, in_turn, of_process, tailbyte

if TYPE_CHECKING:
    from collections.abc import Iterator

COMMANDS = {"decode -q": ("decode", "-q"), "check": ("check",)}
LENGTHS = (1_000_000, 10_000_000, 100_000_000)
FRAMES = 1_000_000
INTERFACES = (1, 2, 4, 8, 16)
TYPES = (1, 5, 20)
DAMAGED = (0, 1000, 100, 10, 3)  # one frame in so many; 0: none
NODE, PRIORITY, STEP = 42, 16, 400_000  # STEP in ns
SINGLE = 56  # bits that fit into one frame


def longer(folder: Path, frames: int) -> Path:
    log = folder / "length.log"
    make_log.write(log, frames)
    return log


def on_interfaces(folder: Path, interfaces: int, frames: int) -> Path:
    """A flight on each of so many interfaces, `frames` in all."""
    one, log = folder / "one.log", folder / "nodes.log"
    make_log.write(one, frames // interfaces)
    with one.open("rb") as lines, log.open("wb") as out:
        for line in lines:
            out.writelines(line.replace(b" can0 ", b" can%d " % k, 1) for k in range(interfaces))
    return log


def of_types(folder: Path, count: int, frames: int) -> Path:
    """One node that sends so many types by turns, each in one frame of zeros."""
    known = [one for one in dronecan.TYPENAMES.values() if one.default_dtid is not None]
    single = [
        one for one in known if one.kind == one.KIND_MESSAGE and one.get_max_bitlen() == one.get_min_bitlen() <= SINGLE
    ]
    chosen = sorted(single, key=lambda one: one.full_name)[:count]
    if len(chosen) < count:
        raise SystemExit(f"there are only {len(chosen)} types of one frame")
    log = folder / "types.log"
    with log.open("wb") as out:
        for k, one in enumerate(islice(cycle(chosen), frames)):
            tail = 0xC0 | k // count % 32
            data = bytes((one.get_max_bitlen() + 7) // 8) + bytes([tail])
            t = make_log.START * make_log.SECOND + k * STEP
            name = f"{PRIORITY << 24 | one.default_dtid << 8 | NODE:08X}"
            out.write(
                b"(%d.%09d) can0 %s#%s\n" % (*divmod(t, make_log.SECOND), name.encode(), data.hex().upper().encode())
            )
    return log


def damaged(folder: Path, every: int, frames: int) -> Path:
    """A flight of which one frame in `every` has a bit turned."""
    flight = folder / "flight.log"
    make_log.write(flight, frames)
    if not every:
        return flight
    log, chance = folder / "damaged.log", random.Random(1)
    with flight.open("rb") as lines, log.open("w") as out:
        for k, line in enumerate(lines):
            t, identifier, data = make_faults.parts_of(line)
            found = make_faults.turned(data, chance) if k % every == 0 else data
            out.write(make_faults.line(t, identifier, found))
    return log


def rows_of(log: Path, frames: int, runs: int) -> Iterator[Row]:
    rows = [Row(name, frames, partial(of_process, tailbyte(*words, log))) for name, words in COMMANDS.items()]
    in_turn(rows, runs)
    yield from rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, nargs="+", default=LENGTHS, help="lengths (default: %(default)s)")
    parser.add_argument("--part", type=int, default=FRAMES, help="frames of the other logs (default: %(default)s)")
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    nodes, part = len(make_log.ESCS) + 1, options.part
    lengths = [(f"{count:,}", partial(longer, frames=count), count) for count in options.frames]
    buses = [(f"{nodes * k}", partial(on_interfaces, interfaces=k, frames=part), part // k * k) for k in INTERFACES]
    types = [(str(count), partial(of_types, count=count, frames=part), part) for count in TYPES]
    faults = [(str(k or "none"), partial(damaged, every=k, frames=part), part) for k in DAMAGED]
    series = {"frames": lengths, "nodes": buses, "types": types, "damaged, one in": faults}
    for what, points in series.items():
        sys.stdout.write(f"{what:18}" + "".join(f"{name + ', ns':>16}{'peak MB':>9}" for name in COMMANDS) + "\n")
        for label, make, frames in points:
            with tempfile.TemporaryDirectory() as folder:
                rows = rows_of(make(Path(folder)), frames, options.runs)
                sys.stdout.write(
                    f"{label:18}" + "".join(f"{r.processor:16,.0f}{r.peak / 1e6:9,.0f}" for r in rows) + "\n"
                )
                sys.stdout.flush()
        sys.stdout.write("\n")


if __name__ == "__main__":
    main()
