"""Batches of one engine that follow each other are, joined, the one that it gives if nobody asks in between."""

from __future__ import annotations

import random
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from bench import make_faults
from kit.command import CAPTURES

from analyzer.decode.engine import Engine
from analyzer.decode.joined import joined

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from analyzer.decode.engine import Batch

STEP = 4000  # lines of a joined batch
FRAMES = 12_000


def batches(pieces: list[list[bytes]]) -> Iterator[Batch]:
    """One for each piece of lines, and that of the end."""
    engine = Engine()
    engine.core.measured = True
    for lines in pieces:
        yield from engine.feed(b"".join(lines))
        yield engine.flush()
    yield engine.finish()


def cut(lines: list[bytes], chance: random.Random, times: int) -> list[list[bytes]]:
    """The lines in so many pieces and one more, some of them without any."""
    at = sorted([0, len(lines), *(chance.randrange(len(lines) + 1) for _ in range(times))])
    return [lines[low:high] for low, high in pairwise(at)]


def check_same(one: Batch, other: Batch) -> None:
    for name in ("frames", "transfers", "events", "settled"):
        assert getattr(one, name).equals(getattr(other, name)), name
    assert {name: table.to_pydict() for name, table in one.messages.items()} == {
        name: table.to_pydict() for name, table in other.messages.items()
    }
    assert one.bit_times is not None
    assert np.array_equal(one.bit_times, other.bit_times)  # type: ignore[arg-type]
    for name in ("first_frame", "first_transfer", "buses", "readings", "settled_before"):
        assert getattr(one, name) == getattr(other, name), name


def check(lines: list[bytes], seed: int, step: int = STEP, times: int = 7) -> int:
    """Check the batches of a log; return of how many frames the last verdict came in a later piece of the same one."""
    chance = random.Random(seed)
    steps = [lines[at : at + step] for at in range(0, len(lines), step)]
    apart = batches([piece for step in steps for piece in cut(step, chance, times)])
    settled = 0
    for whole in batches(steps):
        parts = [next(apart) for _ in range(times + 1 if whole.first_frame < len(lines) and len(whole.frames) else 1)]
        mine = joined(parts)
        check_same(whole, mine)
        settled += sum(len(one.settled) for one in parts) - len(mine.settled)
    assert next(apart, None) is None
    return settled


@pytest.mark.slow
@pytest.mark.parametrize("kind", make_faults.KINDS)
def test_a_bus_full_of_faults(kind: str, tmp_path: Path) -> None:
    make_faults.write(tmp_path / "x.log", kind, FRAMES)
    check((tmp_path / "x.log").read_bytes().splitlines(keepends=True), seed=7)


@pytest.mark.parametrize("seed", range(4))
def test_frames_that_are_settled_later(seed: int) -> None:
    """Whose frames of unknown types are turns out some frames later: in the same batch, and in the next one."""
    chance = random.Random(seed)
    ids = [0x1F00_0000 | chance.randrange(1 << 16) << 8 | 1 + chance.randrange(127) for _ in range(40)]
    lines = []
    for k in range(3000):
        id_, tail = chance.choice(ids), 0xC0 | k // len(ids) % 32
        data = chance.randbytes(7) + bytes([tail if chance.random() < 0.9 else chance.randrange(256)])
        lines.append(f"({k * 1e-4:.6f}) can0 {id_:08X}#{data.hex()}\n".encode())
    assert check(lines, seed, step=500, times=12) > 100


@pytest.mark.parametrize("name", ["mission-8-faults.log", "faults.log", "fd.log", "hobbywing.log"])
def test_a_capture(name: str) -> None:
    check((CAPTURES / name).read_bytes().splitlines(keepends=True), seed=len(name))


def test_one_alone_is_itself() -> None:
    one, _ = batches([(CAPTURES / "faults.log").read_bytes().splitlines(keepends=True)])
    assert joined([one]) is one
