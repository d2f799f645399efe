"""Findings that are asked for again and again: as if everything were worked out anew, and what stays is the same."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from kit.judged import registry

from analyzer.decode.readings import Statement
from analyzer.rules.catalogue import load
from analyzer.rules.found.findings import Findings
from analyzer.rules.found.results import Results
from analyzer.rules.found.runs import RICH
from analyzer.rules.view import Past
from dissectors.kit import SECOND, Occurrence, Occurrences, Worst

PAGES = load(registry())
VIEW = Past(registry(), {}).finish()
# One that lasts, one that another may be the cause of, that other one, what an event explains, and that event.
LASTING, CUT, SHARED, SILENT, RESTART = "TYP-306", "TRF-006", "BUS-010", "BUS-035", "BUS-042"


def one(rule: str, t: int, node: int, type_: str, **more: Any) -> Occurrence:
    values = dict.fromkeys(PAGES[rule].values, 0) | {"cause": f"{t % 2}"}
    return Occurrence(rule, t * SECOND, 0, node, type_, (t,), values, **more)


def lasting(t: int, node: int) -> Occurrences:
    values = dict.fromkeys(PAGES[LASTING].values, t)
    names = ("voltage", "current", "temperature", "speed")
    worst: dict[str, tuple[Worst, Any]] = {name: ("lowest", np.array([float(t)])) for name in names}
    return Occurrences(
        rule=LASTING, t=np.array([t * SECOND]), bus=np.array([0]), node=np.array([node]), type=np.array([1034]),
        frame=np.array([t]), values=lambda _: values, frames=lambda _: (t,), worst=worst,
    )  # fmt: skip


def found(rule: str, t: int, node: int, type_: str) -> Occurrence | Occurrences:
    if rule == LASTING:
        return lasting(t, node)
    doubtful = {"dronecan": None} if rule == CUT and t % 3 == 0 else {}
    return one(rule, t, node, "" if rule in (SHARED, RESTART) else type_, dialects=doubtful)


FOUND = st.builds(
    found,
    st.sampled_from([LASTING, CUT, SHARED, SILENT, RESTART]),
    st.integers(0, 90),
    st.sampled_from([10, 11]),
    st.sampled_from(["RawCommand", "ESCStatus"]),
)
CHOICE = st.sampled_from([(), ("dronecan",)])


@given(steps=st.lists(st.tuples(st.lists(FOUND, max_size=6), CHOICE), max_size=8))
def test_asked_again_they_are_as_if_worked_out_anew(steps: list[tuple[list[Any], tuple[str, ...]]]) -> None:
    added, kept = Findings(PAGES, {}), Results(PAGES, {})
    for node in range(20, 60):  # many are known when a few come
        added.feed(one(SILENT, 2 * (node - 20), node, "RawCommand"), VIEW)
    kept.of(added, (), over=False)
    for more, choices in steps:
        for each in more:
            added.feed(each, VIEW)
        readings = [Statement("ESCStatus", "dialect", "error_count", 0, 10, choice) for choice in choices]
        told = kept.of(added, readings, 100 * SECOND, over=False)
        assert told == Results(PAGES, {}).of(added, readings, 100 * SECOND, over=False)
        assert [(key, run.count) for key, run in told] == [
            (key, run.count) for key, run in Results(PAGES, {}).of(added, readings, 100 * SECOND)
        ]


def test_what_has_not_changed_is_the_same_pair() -> None:
    added, kept = Findings(PAGES, {}), Results(PAGES, {})
    added.feed(one(CUT, 0, 10, "RawCommand"), VIEW)
    added.feed(one(CUT, 0, 11, "RawCommand"), VIEW)
    before = kept.of(added, (), over=False)
    added.feed(one(CUT, 2, 11, "RawCommand"), VIEW)
    after = kept.of(added, (), over=False)
    assert [key.node for key, _ in after] == [10, 11]
    assert after[0] is before[0]
    assert (before[1][1].count, after[1][1].count) == (1, 2)


def test_a_cause_that_comes_later_changes_what_was_told() -> None:
    added, kept = Findings(PAGES, {}), Results(PAGES, {})
    added.feed(one(CUT, 0, 10, "RawCommand"), VIEW)
    assert [key.severity for key, _ in kept.of(added, (), over=False)] == ["error"]
    added.feed(one(SHARED, 5, 10, ""), VIEW)
    assert [(key.rule, key.severity) for key, _ in kept.of(added, (), over=False)] == [(CUT, "note"), (SHARED, "error")]
    added.feed(one(RESTART, 6, 10, ""), VIEW)
    added.feed(one(SILENT, 7, 10, ""), VIEW)
    assert SILENT not in {key.rule for key, _ in kept.of(added, (), over=False)}


def test_runs_behind_the_first_ones_are_told_with_one_example_until_they_are_among_these() -> None:
    added, kept = Findings(PAGES, {}), Results(PAGES, {})
    for t in range(3):
        added.feed(one(CUT, t * 2, 10, "RawCommand"), VIEW)
    (first,) = kept.of(added, (), over=False)
    assert len(first[1].examples) == 3
    for node in range(RICH):
        added.feed(one(SILENT, -1 - node, node, "RawCommand"), VIEW)
    last = kept.of(added, (), over=False)[-1]
    assert (last[0], len(last[1].examples)) == (first[0], 1)
    assert last[1].count == first[1].count
