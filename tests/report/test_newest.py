"""Findings while a capture is coming in: each is told when it begins, and the last look has what the report has."""

from __future__ import annotations

import pytest
from kit.command import CAPTURES
from kit.judged import registry

import analyzer
from analyzer.decode.engine import Engine
from analyzer.report.newest import Change, Newest
from analyzer.rules.checking import Check
from analyzer.rules.settings import Settings


def looked(name: str, lines: int) -> tuple[list[Change], Newest]:
    """Every change, with a look after each so many lines of the capture."""
    engine, check = Engine(registry()), Check(registry(), Settings())
    newest, changes = Newest(check.judge, Settings(), capture=name, now=lambda: 0.0), list[Change]()
    text = (CAPTURES / name).read_bytes().splitlines(keepends=True)
    for at in range(0, len(text), lines):
        batches = [*engine.feed(b"".join(text[at : at + lines])), engine.flush()]
        for measured in check.measured(batches):
            check.feed(measured)
        changes += newest.look(engine.buses)
        assert not newest.look(engine.buses)
    for measured in check.measured([engine.finish()]):
        check.feed(measured)
    check.finish((), engine)
    changes += newest.look(engine.buses)
    return changes, newest


@pytest.mark.slow
@pytest.mark.parametrize("name", ["duplicate-node.log", "reordering.log", "mission-8-faults.log", "services.log"])
@pytest.mark.parametrize("lines", [97, 5000])
def test_the_last_look_has_what_the_report_has(name: str, lines: int) -> None:
    _, newest = looked(name, lines)
    report = analyzer.check(CAPTURES / name)
    assert newest.all
    assert [(one.rule, one.count, one.first, one.last, one.examples) for one in newest.all] == [
        (one.rule, one.count, one.first, one.last, one.examples) for one in report.findings
    ]


@pytest.mark.slow
def test_a_finding_is_told_once_and_then_as_it_grows() -> None:
    changes, newest = looked("duplicate-node.log", 200)
    (device,) = (one for one in newest.all if one.rule == "BUS-010")
    told = [one for one in changes if one.finding.rule == "BUS-010" and one.finding.first == device.first]
    assert [one.fresh for one in told] == [True] + [False] * (len(told) - 1)
    counts = [one.finding.count for one in told]
    assert len(counts) > 1
    assert counts == sorted(set(counts))
    assert counts[-1] == device.count == sum(one.more for one in told)


@pytest.mark.slow
def test_a_look_that_takes_long_is_rare() -> None:
    clock = [0.0]

    def now() -> float:
        clock[0] += 1.0
        return clock[0]

    engine, check = Engine(registry()), Check(registry(), Settings())
    newest = Newest(check.judge, Settings(), now=now)
    looks = 0
    for line in (CAPTURES / "duplicate-node.log").read_bytes().splitlines(keepends=True)[:600]:
        for measured in check.measured([*engine.feed(line), engine.flush()]):
            check.feed(measured)
        looks += bool(newest.look(engine.buses))
    assert 0 < looks < 60
    before = len(newest.all)
    assert len(newest.look(engine.buses, last=True)) + before >= len(newest.all) > 0


@pytest.mark.slow
def test_a_finding_of_another_severity_is_not_new() -> None:
    changes, _ = looked("duplicate-node.log", 200)
    fresh = [
        (one.finding.rule, one.finding.bus, one.finding.node, one.finding.type, one.finding.key, one.finding.first)
        for one in changes
        if one.fresh
    ]
    assert len(fresh) == len(set(fresh))
