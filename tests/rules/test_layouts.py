"""Questions to all tables of a batch at once are answered as each of them answers alone."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pytest
from kit import encode
from kit.judged import registry
from kit.oracle.layouts import odd_layouts
from kit.traffic import lines, status

from analyzer.decode.engine import Engine
from analyzer.rules.values.layouts import Layouts
from analyzer.rules.view import Past
from dissectors.kit import NO_TIME, DecodedTable, decoded, usable

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analyzer.rules.view import BatchView
    from dissectors.kit import Occurrences


def odd_transfers(count: int, seed: int) -> bytes:
    """A log of transfers of every type, most of them no payload of it."""
    chance = random.Random(seed)
    types = list(encode.TYPES.values())
    sent = []
    for k in range(count):
        of, most = chance.choice(types), chance.choice((8, 40, 120))
        payload = bytes(chance.choice((0, 255, chance.randrange(256))) for _ in range(chance.randrange(most)))
        dst = None if of.kind == "message" else 5
        fd = chance.random() < 0.2
        sent.append(encode.Transfer(of.kind, of.type_id, 1 + k % 9, payload, of.signature, k // 9 % 32, dst, fd=fd))
    return lines(*(one.frames() for one in sent))


def views(text: bytes) -> list[BatchView]:
    engine, past = Engine(registry()), Past(registry(), {})
    return [past.feed(batch) for batch in engine.run([text, b""])]


def said(found: Iterable[Occurrences]) -> list[Any]:
    """Every breach with all that is said of it, by rule and place, however they are told together."""
    rows = (
        (
            (one.rule, one.frame.item(k), str(one.values(k))), one.t.item(k), one.bus.item(k), one.node.item(k),
            one.type.item(k), one.doubtful, one.values(k), one.frames(k),
        )
        for one in found
        for k in range(len(one.t))
    )  # fmt: skip
    return sorted(rows, key=lambda row: row[0])


@pytest.mark.parametrize("few", [0, 40, 1 << 12])
def test_layouts_of_joined_tables(monkeypatch: pytest.MonkeyPatch, few: int) -> None:
    monkeypatch.setattr(decoded, "_FEW", few)
    rules = set()
    for seed in range(3):
        for mine, plain in zip(*(views(odd_transfers(1500, seed)) for _ in range(2)), strict=True):
            found = said(Layouts().feed(mine))
            assert found == said(odd_layouts(plain))
            rules |= {place[0] for place, *_ in found}
    assert rules == set(Layouts.rules)


@pytest.mark.parametrize("few", [0, 40, 1 << 12])
def test_columns_of_joined_tables(monkeypatch: pytest.MonkeyPatch, few: int) -> None:
    """A column is the same from a table alone and from what it is joined in."""
    monkeypatch.setattr(decoded, "_FEW", few)
    for view in views(odd_transfers(900, 1)):
        known = [name for name in view.tables() if view.definition(name) is not None]
        assert [table.name for context in view.contexts for table in context.tables] == known
        for context in view.contexts:
            assert len(context.tables) == 1 or all(len(table) < few for table in context.tables)
            assert context.table.tolist() == [k for k, one in enumerate(context.tables) for _ in range(len(one))]
            for name in ("transfer", "t", "bus", "src", "trusted", "bits_left", "pad_nonzero", "bad_tag", "layout"):
                own = (DecodedTable(one.name, view._messages[one.name], view.transfers.first) for one in context.tables)
                apart = [table[name] for table in own]
                assert np.array_equal(context[name], np.concatenate(apart))
                assert all(np.array_equal(one, table[name]) for one, table in zip(apart, context.tables, strict=True))


def test_a_missing_time_is_none_in_joined_tables() -> None:
    sent = [encode.transfer("RawCommand", {"cmd": [1]}, 1), status(0)]
    (view, *_) = views(lines(*(one.frames() for one in sent), timed=False))
    (context,) = view.contexts
    assert len(context.tables) == 2
    assert context["t"].tolist() == [NO_TIME, NO_TIME]


def test_what_is_made_once_stays_as_it_is() -> None:
    (view, *_) = views(lines(status(0).frames(), status(1).frames()))
    table = view.table("ESCStatus")
    assert usable(table) is usable(table)
    with pytest.raises(ValueError, match="read-only"):
        usable(table)[0] = False


def test_tables_of_one_name_may_have_other_columns() -> None:
    for names in (["a", "b"], ["b", "a"], ["b"], ["a", "b"]):
        batch = pa.RecordBatch.from_pydict({name: pa.array([ord(name)], pa.uint8()) for name in names})
        table = DecodedTable("X", batch, 0)
        assert [(name in table, table[name].tolist()) for name in names] == [(True, [ord(name)]) for name in names]
        assert ("a" in table) == ("a" in names)
