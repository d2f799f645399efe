"""Occurrences to findings: runs, bounds, and that order and batches do not matter."""

from __future__ import annotations

from copy import deepcopy
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit.judged import outcome, registry

from analyzer.decode.readings import Statement
from analyzer.rules.catalogue import load
from analyzer.rules.drops import Drops
from analyzer.rules.found import findings, runs
from analyzer.rules.found.findings import Findings
from analyzer.rules.found.results import Results
from analyzer.rules.view import Past
from dissectors.kit import NO_TIME, SECOND, JointLosses, Occurrence, Occurrences
from dissectors.records import replace

PAGES = load(registry())
VIEW = Past(registry(), {}).finish()
RULE = "TYP-101"  # its key is the channel


def one(t: float, frame: int, channel: int = 1, node: int = 10, **more: Any) -> Occurrence:
    values = {"channel": channel, "value": -frame}
    return Occurrence(RULE, round(t * SECOND), 0, node, "RawCommand", (frame,), values, **more)


def many(rows: list[tuple[float, int, int]], **more: Any) -> Occurrences:
    """Rows of (seconds, frame, channel), all of node 10."""
    t, frame, channel = (np.array(column) for column in zip(*rows, strict=True))
    size = len(rows)
    return Occurrences(
        rule=RULE, t=np.round(t * SECOND).astype(np.int64), bus=np.zeros(size, np.int64), node=np.full(size, 10),
        type=np.full(size, 1030), frame=frame, key=channel,
        values=lambda k: {"channel": int(channel[k]), "value": -int(frame[k])},
        frames=lambda k: (int(frame[k]),), **more,
    )  # fmt: skip


def result(*found: Occurrences | Occurrence, severities: Any = (), readings: Any = ()) -> list[Any]:
    made = Findings(PAGES, dict(severities))
    for each in found:
        made.feed(each, VIEW)
    return Results(PAGES, dict(severities)).of(made, readings)


def brief(*found: Occurrences | Occurrence) -> list[tuple[str, int, int, int, list[int]]]:
    return [
        (key.key, run.count, run.first[1], run.last[1], [example.frame for example in run.examples])
        for key, run in result(*found)
    ]


def test_a_run_ends_after_ten_seconds_of_silence() -> None:
    assert brief(one(0, 1), one(10, 2), one(20.1, 3)) == [
        ("channel=1", 2, 1, 2, [1, 2]),
        ("channel=1", 1, 3, 3, [3]),
    ]


def test_what_lies_between_two_runs_joins_them() -> None:
    assert brief(one(0, 1), one(15, 3), one(8, 2)) == [("channel=1", 3, 1, 3, [1, 2, 3])]


def test_node_and_key_keep_findings_apart() -> None:
    found = result(one(0, 1), one(0, 2, channel=2), one(0, 3, node=11))
    assert [(key.node, key.key) for key, _ in found] == [(10, "channel=1"), (10, "channel=2"), (11, "channel=1")]


@given(
    rows=st.lists(st.tuples(st.integers(0, 80), st.integers(1, 3)), min_size=1, max_size=60),
    cuts=st.lists(st.integers(0, 60), max_size=4),
    order=st.randoms(use_true_random=False),
)
def test_neither_order_nor_batches_matter(rows: list[tuple[int, int]], cuts: list[int], order: Any) -> None:
    placed = [(t, number, channel) for number, (t, channel) in enumerate(sorted(rows))]
    singly = [one(*row) for row in placed]
    order.shuffle(singly)
    bounds = sorted({0, len(placed), *(cut for cut in cuts if cut < len(placed))})
    pieces = [many(placed[a:b]) for a, b in pairwise(bounds)]
    order.shuffle(pieces)
    assert brief(*singly) == brief(*pieces) == brief(many(placed))
    assert sum(row[1] for row in brief(many(placed))) == len(rows)


def test_twenty_examples_are_kept_the_first_ones() -> None:
    (found,) = brief(*(many([(k, k, 1)]) for k in reversed(range(30))))
    assert found == ("channel=1", 30, 0, 29, list(range(20)))


def test_values_are_asked_of_what_is_shown_alone_where_those_of_the_key_are_given() -> None:
    asked: list[int] = []

    def seen(first: int) -> Occurrences:
        found = many([(first + k, first + k, 1) for k in range(15)])

        def values(k: int) -> Any:
            asked.append(first + k)
            return found.values(k)

        return replace(found, values=values, key_values=lambda _: {"channel": 1})

    (run,) = brief(*(seen(first) for first in (0, 15, 30, 45)))
    assert run == ("channel=1", 60, 0, 59, list(range(20)))
    assert asked == list(range(20))


def test_a_key_that_lasts_is_asked_of_its_first_occurrence_alone() -> None:
    asked: list[int] = []

    def seen(t: int, *, lasts: bool) -> Occurrences:
        def key_values(k: int) -> Any:
            asked.append(t)
            return {"channel": [1, 2][k]}

        return replace(many([(t, t, 1), (t, t + 1, 2)]), key_values=key_values, lasts=lasts)

    assert brief(*(seen(t, lasts=True) for t in (0, 2, 4))) == brief(
        *(many([(t, t, 1), (t, t + 1, 2)]) for t in (0, 2, 4))
    )
    assert asked == [0, 0]
    brief(*(seen(t, lasts=False) for t in (0, 2)))
    assert asked == [0, 0, 0, 0, 2, 2]


def test_bounds_merge_and_never_forget(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runs, "MOST_RUNS", 3)
    monkeypatch.setattr(findings, "MOST_GROUPS", 2)
    found = brief(*(one(20 * k, k) for k in range(6)), *(one(0, 10 + k, channel=k) for k in range(2, 6)))
    assert sum(count for _, count, *_ in found) == 10
    assert [key for key, *_ in found].count("channel=1") == 3
    assert {key for key, *_ in found} == {"channel=1", "channel=2", "further"}


@pytest.mark.parametrize("most", [1, 1 << 16])
def test_what_comes_when_no_more_keys_are_kept_apart_shares_one(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """In every batch, of a node that has a key and of others; what is forgotten of these is found out again."""
    monkeypatch.setattr(findings, "MOST_GROUPS", 2)
    monkeypatch.setattr(findings, "MOST_BEYOND", most)
    batch = many([(1, 1, 1), (1, 2, 2), (1, 3, 3), (1, 4, 1), (1, 5, 1)])
    batch = replace(batch, node=np.array([10, 10, 10, 11, 12]))
    found = {key: count for key, count, *_ in brief(*(replace(batch, t=batch.t + k * SECOND) for k in range(4)))}
    assert found == {"channel=1": 4, "channel=2": 4, "further": 12}


def test_a_rule_with_too_many_runs_has_no_more_for_what_comes_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(findings, "MOST_APART", 3)
    rows = [(0, 0, 1), (20, 1, 1), (40, 2, 2), (60, 3, 1), (61, 4, 3), (90, 5, 2), (120, 6, 1)]
    expected = [
        ("channel=1", 1, 0, 0, [0]),
        ("channel=1", 3, 1, 6, [1]),
        ("channel=2", 2, 2, 5, [2]),
        ("channel=3", 1, 4, 4, [4]),
    ]
    assert brief(*(one(*row) for row in rows)) == expected
    assert brief(*(many([row]) for row in rows)) == expected
    assert brief(many(rows[:3]), many(rows[3:])) == expected
    late = one(-30, 9)
    assert brief(*(one(*row) for row in rows), late)[0] == ("channel=1", 2, 9, 0, [9, 0])


def test_an_episode_of_a_rule_with_too_many_runs_begins_as_its_earliest_part(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(findings, "MOST_APART", 2)

    def low(*rows: tuple[float, int, int]) -> Occurrences:
        return many([*rows], worst={"value": ("lowest", np.array([-float(frame) for _, frame, _ in rows]))})

    before = low((-30, 9, 1)), low((-51, 11, 1), (-50, 10, 1))
    (_, run), _ = result(low((0, 1, 1)), low((20, 2, 2)), *before, low((90, 3, 1)))
    assert run.episode.onset == {"channel": 1, "value": -11}
    assert (run.count, run.first, run.text) == (5, (-51 * SECOND, 11), "ch1 = -11")


@given(
    rows=st.lists(st.tuples(st.integers(0, 300), st.integers(1, 4)), min_size=1, max_size=40),
    cuts=st.lists(st.integers(0, 40), max_size=4),
)
def test_which_runs_stand_apart_does_not_depend_on_batches(rows: list[tuple[int, int]], cuts: list[int]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(findings, "MOST_APART", 5)
        placed = [(t, number, channel) for number, (t, channel) in enumerate(sorted(rows))]
        bounds = sorted({0, len(placed), *(cut for cut in cuts if cut < len(placed))})
        pieces = [many(placed[a:b]) for a, b in pairwise(bounds)]
        spans = [found[:4] for found in brief(*pieces)]
        assert (
            spans
            == [found[:4] for found in brief(many(placed))]
            == [found[:4] for found in brief(*(one(*row) for row in placed))]
        )
        assert sum(found[1] for found in spans) == len(rows)


def test_what_explains_and_what_may_be_explained_keeps_all_its_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(findings, "MOST_APART", 1)
    assert len(result(*(shared(t) for t in (0, 20, 40)))) == 3
    assert len(result(*(cut_short(t, t) for t in (0, 20, 40)))) == 3


def cut_short(t: float, frame: int, node: int = 10) -> Occurrence:
    values = {"frames": 1, "bytes": 7, "why": "", "cause": ""}
    return Occurrence("TRF-006", round(t * SECOND), 0, node, "RawCommand", (frame,), values)


def shared(t: float) -> Occurrence:
    return Occurrence("BUS-010", round(t * SECOND), 0, 10, "", (0,), {"evidence": ""})


def spans(*found: Occurrences | Occurrence) -> list[tuple[str, float, float, int]]:
    return [
        (key.severity, run.first[0] / SECOND, run.last[0] / SECOND, run.count)
        for key, run in result(*found) if key.rule == "TRF-006"
    ]  # fmt: skip


@pytest.mark.parametrize("length", [200, 3000])
def test_what_explains_a_part_of_a_run_softens_nothing_of_minutes_before_or_after(length: int) -> None:
    """However long it is; a part ends where ten seconds begin or end."""
    cut = [cut_short(t, t) for t in range(0, length, 5)]
    cause = [shared(t) for t in range(120, 160, 5)]
    expected = [("error", 0, 105, 22), ("note", 110, 165, 12), ("error", 170, length - 5, length // 5 - 34)]
    assert spans(*sorted((*cut, *cause), key=lambda found: found.t)) == expected
    assert spans(*cause, *cut) == expected


def test_a_part_that_is_explained_may_come_before_its_cause() -> None:
    found = [cut_short(t, t) for t in range(0, 200, 5)], [shared(t) for t in range(120, 160, 5)]
    assert spans(*found[0], *found[1]) == spans(*found[1], *found[0])


def test_what_explains_a_run_is_of_its_node_and_no_note() -> None:
    others = cut_short(0, 1), cut_short(1, 2, node=11), shared(30)
    assert [severity for severity, *_ in spans(*others)] == ["error", "error"]
    found = result(cut_short(0, 1), cut_short(1, 2, node=11), shared(5))
    assert [(key.rule, key.node, key.severity) for key, _ in found] == [
        ("TRF-006", 10, "note"), ("TRF-006", 11, "error"), ("BUS-010", 10, "error"),
    ]  # fmt: skip


def test_severities_of_occurrence_and_user() -> None:
    assert [key.severity for key, _ in result(one(0, 1, severity="error"))] == ["error"]
    assert [key.severity for key, _ in result(one(0, 1, severity="error"), severities={RULE: "note"})] == ["note"]
    assert [key.severity for key, _ in result(one(0, 1))] == [PAGES[RULE].severity]


@pytest.mark.parametrize(
    ("choice", "severities"),
    [("tm", ["warning"]), ("dronecan", []), ("dronecan (forced)", []), ("K", ["note"]), ("undecided", ["warning"])],
)
def test_the_reading_of_a_node_decides_at_the_end(choice: str, severities: list[str]) -> None:
    reading = Statement("ESCStatus", "dialect", "error_count", 0, 10, choice)
    found = result(one(0, 1, dialects={"dronecan": None, "K": "note"}), readings=[reading])
    assert [key.severity for key, _ in found] == severities


def test_a_rule_that_is_not_looked_for_is_left_out() -> None:
    made = Findings({}, {})
    made.feed(one(0, 1), VIEW)
    assert Results(PAGES, {}).of(made, ()) == []


@pytest.mark.parametrize(("end", "given_back"), [(15, 0), (16, 1), (18, 2), (None, 2)])
def test_what_a_loss_may_explain_waits_for_it(end: int | None, given_back: int) -> None:
    drops = Drops(around=5 * SECOND, beside=SECOND // 2)
    drops.hold(one(9.5, 1))
    drops.hold(one(11.5, 2))
    ready = list(drops.ready(None if end is None else end * SECOND))
    assert len(ready) == given_back
    assert [near.tolist() for _, near in ready] == [[False]] * given_back


def test_occurrences_without_a_row_are_not_given_back() -> None:
    drops, whole = Drops(around=5 * SECOND, beside=SECOND // 2), many([(1, 1, 1)])
    columns = {name: getattr(whole, name)[:0] for name in ("t", "bus", "node", "type", "frame")}
    drops.hold(replace(whole, **columns, key=None))
    assert list(drops.ready(None)) == []


@pytest.mark.parametrize(
    ("t", "until", "near"),
    [
        (NO_TIME, 10 * SECOND, True),
        (NO_TIME, NO_TIME + SECOND, False),
        ((1 << 63) - 1, (1 << 63) + SECOND, False),
        (9 * SECOND, (1 << 63) + SECOND, True),
    ],
)
def test_a_loss_is_near_up_to_the_ends_of_all_times(t: int, until: int, near: bool) -> None:
    drops = Drops(around=5 * SECOND, beside=SECOND // 2)
    drops.add(JointLosses(*(np.array([cell]) for cell in (0, 10 * SECOND, 10 * SECOND, 0, 1, 3, 0, 0))))
    drops.hold(replace(one(0, 1), t=t, until=until))
    assert [found.tolist() for _, found in drops.ready(None)] == [[near]]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("step", [2800, 100, 37])
def test_many_runs_have_the_same_examples_however_they_came(step: int) -> None:
    """The first runs of the capture have all their examples, the others one."""
    lines = [f"(1773475330.{k:06d}) can0 {k % 700:03X}#00\n" for k in range(2800)]
    runs = outcome("".join(lines), ["CAN-001"], step).runs
    assert len(runs) == 700
    assert [len(run.examples) for _, run in runs] == [4] * 500 + [1] * 200


def test_what_is_counted_in_the_core_is_told_at_every_look() -> None:
    made, told = Findings(PAGES, {}), Results(PAGES, {})
    for at in range(60):
        made.feed(many([(at, 2 * at, 1), (at, 2 * at + 1, 2)]), VIEW)
        before = made.changes
        counts = [(run.count, run.last) for _, run in told.of(made, (), over=False)]
        assert counts == [(at + 1, (at * SECOND, 2 * at)), (at + 1, (at * SECOND, 2 * at + 1))]
        assert made.changes == before
    copied = deepcopy(made)
    made.feed(many([(60, 200, 1)]), VIEW)
    assert [run.count for _, run in Results(PAGES, {}).of(copied, ())] == [60, 60]
    assert [run.count for _, run in Results(PAGES, {}).of(made, ())] == [61, 60]
