"""Lacks of senders, as the core finds it session by session: the same as in columns, wherever batches begin."""

from __future__ import annotations

import random
from copy import deepcopy
from typing import TYPE_CHECKING

import numpy as np
import pytest
from kit.command import CAPTURES
from kit.lacks_in_columns import LacksInColumns

from analyzer.decode.engine import Engine
from analyzer.rules.joint.lacks import Lacks
from analyzer.rules.joint.times import WIDEST
from analyzer.rules.view import Past

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.rules.view import BatchView


def damaged(capture: str, seed: int, *, errors: bool = False) -> list[bytes]:
    """Return the lines of a capture, some of them gone, twice, swapped, with another tail or identifier."""
    chance, lines = random.Random(seed), (CAPTURES / capture).read_bytes().splitlines(keepends=True)[:4000]
    found: list[bytes] = []
    for sent in lines:
        kind, line = chance.random(), sent
        if kind < 0.08:
            continue
        if kind < 0.1 and found:
            found.insert(-1, line)
            continue
        if kind < 0.14:
            line = line[:-3] + b"%02X\n" % chance.randrange(256)
        elif kind < 0.2:
            at = line.index(b"#")
            line = line[: at - 8] + b"%08X" % (chance.randrange(1 << 29)) + line[at:]
        elif kind < 0.22:
            line = line.replace(b"can0", b"can1")
        elif kind < 0.23 and errors:
            line = line.split(b" ")[0] + b" can0 20000004#0004000000000000\n"
        found.append(line)
    return found


def views(lines: list[bytes], seed: int) -> Iterator[BatchView]:
    chance, engine = random.Random(seed), Engine()
    past, at = Past(engine.registry, {}), 0
    while at < len(lines):
        size = chance.choice((1, 30, 400, 1500))
        list(engine.feed(b"".join(lines[at : at + size])))
        yield past.feed(engine.flush())
        at += size
    for batch in engine.end():
        yield past.feed(batch)


@pytest.mark.parametrize("capture", ["hover-4.log", "services.log", "hobbywing.log", "reordering.log"])
@pytest.mark.parametrize("seed", [1, 2])
def test_the_core_finds_the_same(capture: str, seed: int) -> None:
    core, columns, found = Lacks(), LacksInColumns(), 0
    for view in views(damaged(capture, seed, errors=seed == 2), seed):
        core = deepcopy(core)
        (rows, gone), (expected, void) = core.feed(view), columns.feed(view)
        for name, column in rows._asdict().items():
            assert column.tolist() == getattr(expected, name).tolist(), name
        assert sorted(gone.tolist()) == sorted(void.tolist())
        assert core.known(rows, WIDEST).tolist() == columns.known(rows, WIDEST).tolist()
        for bus, nodes in columns.nodes.items():
            assert core.nodes(bus).tolist() == sorted(nodes.values())
        found += len(rows.session)
    assert found > 3


def test_a_sender_alone_and_full_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analyzer.rules.joint.lacks.MOST_SESSIONS", 9)
    monkeypatch.setattr("kit.lacks_in_columns.MOST_SESSIONS", 9)
    lines = [line for line in damaged("hover-4.log", 3) if line.split(b"#")[0].endswith(b"0B")]
    for some in (lines, damaged("hover-4.log", 4)):
        core, columns, found = Lacks(), LacksInColumns(), 0
        for view in views(some, 5):
            rows, expected = core.feed(view)[0], columns.feed(view)[0]
            assert rows.behind.tolist() == expected.behind.tolist()
            found += len(rows.session)
        assert found


def test_columns_fit_together() -> None:
    sent = type("Sent", (), {"forward": True})
    for name, column in {"row": [0, 5], "place": [0, 1], "first": [0, 2], "codes": [7]}.items():
        setattr(sent, name, np.array(column))
    sent.tail = np.zeros(2, np.uint8)
    sent.times = np.zeros(2, np.int64)
    with pytest.raises(ValueError, match="do not fit"):
        Lacks()._native.feed(0, sent, 0, np.zeros(2, np.uint16))
