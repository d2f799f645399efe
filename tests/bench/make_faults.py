"""Write a log that is full of faults, as `candump -l` text: the worst a rule can meet. Same arguments, same bytes.

    python tests/bench/make_faults.py --kind damaged --frames 200000 --out damaged.log

On top of the flight of `make_log`, --kind is one of these:

- damaged: one bit of the data of one in three frames is turned.
- random: every second frame has an identifier of a known type, a source and bytes by chance.
- jumps: every node ID speaks, and the clock jumps to and fro before every third frame.
- flood: nine of ten frames are no DroneCAN, half of them with 11 bits of identifier and half with 29.
- mixed: one in three frames has a turned bit, comes after the one behind it, is missing, comes twice, has 11 bits of
  identifier, or is followed by a request for a parameter that nobody answers, by chance.
"""

from __future__ import annotations

import argparse
import random
import sys
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench import make_log
from kit import encode

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

SEED = 1
EVERY = 3  # frames, of which one is damaged or comes after a jump
FLIGHT = 10  # frames of a flood, of which one is of the flight
JUMP = 10.0  # s, at most, to and fro
NODES = 127
FOREIGN = 64  # identifiers of 29 bits that flood
PRIORITY = 0x1F000000
SERVICES = 0.25  # of random frames
FAULTS = ("turned", "late", "missing", "twice", "short", "asked")
PARAMETERS, TOOL = 11, 126  # the type of requests for parameters, and who asks

Parts = tuple[float, str, bytes]  # time, identifier, data


def parts_of(text: bytes) -> Parts:
    stamp, _, frame = text.decode().split(" ")
    identifier, data = frame.strip().split("#")
    return float(stamp[1:-1]), identifier, bytes.fromhex(data)


def line(t: float, identifier: str, data: bytes) -> str:
    return f"({t:.6f}) can0 {identifier}#{data.hex().upper()}\n"


def turned(data: bytes, chance: random.Random) -> bytes:
    """One of its bits turned."""
    return (int.from_bytes(data, "big") ^ 1 << chance.randrange(8 * len(data))).to_bytes(len(data), "big")


def damaged(lines: Iterable[Parts], chance: random.Random) -> Iterator[Parts]:
    hit = 0
    for k, (t, identifier, data) in enumerate(lines):
        if k % EVERY == 0:
            hit = k + chance.randrange(EVERY)
        yield t, identifier, turned(data, chance) if k == hit else data


def random_frames(lines: Iterable[Parts], chance: random.Random) -> Iterator[Parts]:
    messages = [one.type_id for one in encode.TYPES.values() if one.kind == "message"]
    services = [one.type_id for one in encode.TYPES.values() if one.kind == "request"]
    for t, identifier, data in lines:
        yield t, identifier, data
        number = chance.choice(messages) << 8
        if chance.random() < SERVICES:
            number = chance.choice(services) << 16 | chance.randrange(2) << 15 | node(chance) << 8 | 0x80
        yield t, f"{PRIORITY | number | node(chance):08X}", chance.randbytes(chance.randrange(1, 9))


def jumps(lines: Iterable[Parts], chance: random.Random) -> Iterator[Parts]:
    moved = 0.0
    for k, (t, identifier, data) in enumerate(lines):
        if k % EVERY == 0:
            moved = chance.uniform(-JUMP, JUMP)
            turn, source = divmod(k // EVERY, NODES)
            uptime = int(t - make_log.START).to_bytes(4, "little")
            status = uptime + bytes((0, 0, 0, 0xC0 | turn % 32))
            yield t + moved, f"{PRIORITY | 341 << 8 | source + 1:08X}", status
        yield t + moved, identifier, data


def flood(lines: Iterable[Parts], chance: random.Random) -> Iterator[Parts]:
    foreign = [f"{0x18FE0000 | chance.randrange(1 << 16):08X}" for _ in range(FOREIGN)]
    for t, identifier, data in lines:
        yield t, identifier, data
        for k in range(FLIGHT - 1):
            flooding = chance.choice(foreign) if k % 2 else f"{chance.randrange(1 << 11):03X}"
            yield t, flooding, chance.randbytes(chance.randrange(9))


def mixed(lines: Iterable[Parts], chance: random.Random) -> Iterator[Parts]:
    late: Parts | None = None
    for k, (t, identifier, data) in enumerate(lines):
        fault = chance.choice(FAULTS) if k % EVERY == 0 else ""
        if fault == "late" and late is None:
            late = t, identifier, data
            continue
        if fault != "missing":
            yield (
                t,
                f"{chance.randrange(1 << 11):03X}" if fault == "short" else identifier,
                (turned(data, chance) if fault == "turned" else data),
            )
        if fault == "twice":
            yield t, identifier, data
        if fault == "asked":
            link = PARAMETERS << 16 | 1 << 15 | node(chance) << 8 | 0x80 | TOOL
            yield t, f"{PRIORITY | link:08X}", bytes((k % 8, 0, 0xC0 | k % 32))
        if late is not None:
            yield t, *late[1:]
            late = None


def node(chance: random.Random) -> int:
    return chance.randrange(1, NODES + 1)


KINDS: dict[str, Callable[[Iterable[Parts], random.Random], Iterator[Parts]]] = {
    "damaged": damaged, "random": random_frames, "jumps": jumps, "flood": flood, "mixed": mixed,
}  # fmt: skip


def write(path: Path, kind: str, frames: int) -> None:
    """Write a log of exactly `frames` lines."""
    with TemporaryDirectory() as folder, path.open("w") as out:
        flight = Path(folder, "flight.log")
        make_log.write(flight, frames)
        with flight.open("rb") as lines:
            for t, identifier, data in islice(KINDS[kind](map(parts_of, lines), random.Random(SEED)), frames):
                out.write(line(t, identifier, data))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kind", choices=KINDS, required=True)
    parser.add_argument("--frames", type=int, default=200_000)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    write(options.out, options.kind, options.frames)


if __name__ == "__main__":
    main()
