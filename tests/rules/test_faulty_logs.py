"""Logs that are full of faults: what is counted is what is there, whatever is searched, and however it is cut."""

from __future__ import annotations

import random
from binascii import crc_hqx
from functools import cache
from itertools import islice

import numpy as np
import pytest
from bench import make_faults, make_log
from kit.command import CAPTURES
from kit.judged import judge, registry, whole

from analyzer.decode.engine import Engine
from analyzer.rules.diagnosis import budgets
from analyzer.rules.recent import Recent
from analyzer.rules.transfers import missing_start, unassigned
from analyzer.rules.view import Past
from analyzer.tables import TRANSFER_ANOMALIES
from dissectors.kit import Occurrences
from dissectors.kit.definitions import Types

FRAMES = 2500
RULES = ("TRF-002", "TRF-003", "TRF-004", "TRF-005", "TRF-006", "TRF-007", "TRF-009", "TRF-010", "TRF-027", "CAP-002")
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
    monkeypatch.setattr(budgets, "MOST_SEARCHES", 0)
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


@pytest.mark.sampled(4)
@pytest.mark.parametrize("kind", make_faults.KINDS)
def test_any_cut_gives_the_same(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budgets, "MOST_SEARCHES", 12)
    # Where the clock jumps, how much of a gap is known decides what it excuses.
    rules = [rule for rule in RULES if kind != "jumps" or rule not in {"TRF-005", "TRF-007"}]
    whole(log(kind), rules, (97, 700))


def test_nothing_is_looked_up_of_frames_that_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(missing_start, "MOST_EARLY", 0)  # of those that are held back the lines are kept
    asked: list[int] = []
    look_up = Recent.frame

    def frame(recent: Recent, number: int) -> object:
        asked.append(number)
        return look_up(recent, number)

    monkeypatch.setattr(Recent, "frame", frame)
    (batch, *_) = Engine(registry()).run([log("random").encode()])
    past, rule, told = Past(registry(), {}), unassigned.UnassignedFrames(), dict[str, int]()
    for found in (*rule.feed(past.feed(batch)), *rule.finish(past.finish())):
        assert isinstance(found, Occurrences), "they are told one by one"
        told[found.rule] = told.get(found.rule, 0) + len(found.t)
    assert told["TRF-005"] > 100 < 10 * told["TRF-002"]
    # Behind the start of the batch, a few more frames are looked through for the frame before a start.
    assert all(number < 64 for number in asked)


def test_searches_of_a_sender_are_counted_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budgets, "MOST_SEARCHES", 3)
    monkeypatch.setattr(budgets, "MOST_SENDERS", 2)
    budget, sent = budgets.SearchBudget(), np.array([7, 8, 7, 7, 7, 8, 9])
    assert budget.allows(sent).tolist() == [True, True, True, True, False, True, True]
    assert budget.take(sent).tolist() == [True, True, True, True, False, True, False], "too many senders"
    assert budget.take(sent).tolist() == [False, True] + [False] * 5
    assert (budget.left(7), budget.left(8), budget.left(9)) == (0, 0, 0)


def test_types_are_asked_once() -> None:
    types = Types(registry())
    assert types.undefined(1034) is types.undefined(1034)
