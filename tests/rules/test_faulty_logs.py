"""Logs that are full of faults: what is counted is what is there, whatever is searched, and however it is cut."""

from __future__ import annotations

import random
from binascii import crc_hqx
from functools import cache
from itertools import islice

import pytest
from bench import make_faults, make_log
from kit.command import CAPTURES
from kit.judged import judge, registry, whole

from analyzer.decode.engine import Engine
from analyzer.rules.diagnosis import budgets
from analyzer.rules.diagnosis.neighbours import NeighbourFinder
from analyzer.tables import TRANSFER_ANOMALIES
from dissectors.kit.definitions import Types

FRAMES = 2500
RULES = ("TRF-002", "TRF-003", "TRF-005", "TRF-006", "TRF-007", "TRF-009", "TRF-010", "CAP-002")
CRC, TOGGLE = (1 << TRANSFER_ANOMALIES.index(name) for name in ("crc", "toggle"))


@cache
def log(kind: str) -> str:
    """A flight of the repository with faults, at the time that these are made for."""
    with (CAPTURES / "hover.log").open("rb") as lines:
        flight = [make_faults.parts_of(line) for line in islice(lines, FRAMES)]
    moved = [(t - flight[0][0] + make_log.START, identifier, data) for t, identifier, data in flight]
    found = make_faults.KINDS[kind](moved, random.Random(make_faults.SEED))
    return "".join(make_faults.line(*parts) for parts in islice(found, FRAMES))


def turned_bit(wire: int, here: int, payload: bytes) -> bool:
    """Whether the CRC is right with one bit turned; every bit is tried."""
    if (wire ^ here).bit_count() == 1:
        return True
    for at in range(8 * len(payload)):
        changed = bytearray(len(payload))
        changed[at // 8] ^= 1 << at % 8
        if crc_hqx(bytes(changed), 0) == wire ^ here:
            return True
    return False


def test_what_is_not_searched_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budgets, "AT_ONCE", 0)
    monkeypatch.setattr(budgets, "EACH", 1 << 30)
    monkeypatch.setattr(NeighbourFinder, "of", None)  # nobody asks
    (batch, *more) = Engine(registry()).run([log("damaged").encode()])
    assert not any(len(one.transfers) for one in more)
    broken = [one for one in batch.transfers.to_pylist() if one["anomaly"] & CRC]
    turned = sum(turned_bit(one["crc_wire"], one["crc_here"], one["payload"]) for one in broken)
    sequences = sum(bool(one["anomaly"] & TOGGLE) for one in batch.transfers.to_pylist())
    counts: dict[tuple[str, str], int] = {}
    for one in judge(log("damaged"), ("TRF-003", "TRF-010")):
        counts[one.rule, one.cause] = counts.get((one.rule, one.cause), 0) + one.count
    assert counts == {
        ("TRF-003", budgets.NOT_SEARCHED): sequences,
        ("TRF-010", "corrupted"): turned,
        ("TRF-010", budgets.NOT_SEARCHED): len(broken) - turned,
    }
    assert turned > sequences > 0 < len(broken) - turned


@pytest.mark.parametrize("kind", make_faults.KINDS)
def test_any_cut_gives_the_same(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budgets, "AT_ONCE", 12)
    monkeypatch.setattr(budgets, "EACH", 64)
    # Where the clock jumps, how much of a gap is known decides what it excuses.
    rules = [rule for rule in RULES if kind != "jumps" or rule not in {"TRF-005", "TRF-007"}]
    whole(log(kind), rules, (97, 700))


def test_searches_are_a_share_of_the_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    calls, look = [], NeighbourFinder.of
    monkeypatch.setattr(NeighbourFinder, "of", lambda *given, **more: calls.append(given[2]) or look(*given, **more))
    monkeypatch.setattr(budgets, "AT_ONCE", 10)
    monkeypatch.setattr(budgets, "EACH", 100)
    judge(log("damaged"), RULES)
    of_each = 10 + FRAMES // 100
    assert 2 * of_each < len(calls) <= 6 * of_each


def test_few_faults_of_a_sender_are_searched_beside_many_of_another(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budgets, "AT_ONCE", 400)
    budget, many, few = budgets.SearchBudget(), (0, 1, 1034), (0, 2, 1034)
    taken = sum(budget.take(many, 0) for _ in range(10 * budgets.AT_ONCE))
    assert taken == budgets.AT_ONCE - budgets.AT_ONCE // budgets.SHARE
    assert all(budget.take(few, 0) for _ in range(budgets.FEW))
    assert not budget.take(few, 0)
    assert budget.take(few, 4 * budgets.EACH * budgets.AT_ONCE)


def test_types_are_asked_once() -> None:
    types = Types(registry())
    assert types.undefined(1034) is types.undefined(1034)
