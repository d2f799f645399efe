"""Rules that ask all ESCs at once say of each one what they would say of it alone, row by row."""

from __future__ import annotations

from bisect import bisect_left, insort
from itertools import accumulate, pairwise
from types import MappingProxyType
from typing import Any, cast

import numpy as np
import pyarrow as pa
import pytest

from dissectors.kit import NO_TIME, DecodedTable, TransferTable
from dissectors.tmotor.rules.bus.settings.never_answered import NeverAnswered
from dissectors.tmotor.rules.joined.joins import (
    NO_CHANNEL,
    LastCommands,
    ReportingEsc,
    commands,
    esc_reports,
    in_force,
    units,
)
from dissectors.tmotor.rules.joined.motion import Motion
from dissectors.tmotor.rules.joined.periods import PeriodHistogram
from dissectors.tmotor.rules.joined.recent_throttle import RecentThrottles
from dissectors.tmotor.rules.joined.valid_throttle import CommandGaps, ValidThrottle, ValidThrottles

COUNT, STEP = 60, 1000
SEEDS = pytest.mark.parametrize("seed", range(12))


class Batch:
    """A batch of reports and commands by chance, as a rule sees it."""

    def __init__(self, chance: np.random.Generator, first: int) -> None:
        commanded = chance.random(COUNT) < 0.5
        bus, t = chance.integers(0, 2, COUNT), (first + np.arange(COUNT)) * STEP + chance.integers(0, STEP, COUNT)
        common = {
            "t": t, "bus": bus.astype(np.uint8), "src": chance.integers(1, 4, COUNT).astype(np.uint8),
            "transfer": np.arange(first, first + COUNT).astype(np.uint64), "trusted": chance.random(COUNT) < 0.9,
            "bits_left": np.zeros(COUNT, np.int32),
        }  # fmt: skip
        rpm = np.where(chance.random(COUNT) < 0.5, 0, chance.integers(-2, 3, COUNT)).astype(np.int32)
        own = {"esc_index": chance.integers(0, 4, COUNT).astype(np.uint8), "rpm": rpm}
        lists: list[list[int]] = [chance.integers(-2, 3, chance.integers(0, 5)).tolist() for _ in range(COUNT)]
        cmd = pa.array(lists, pa.list_(pa.int16()))
        self._tables = {
            "ESCStatus": table("ESCStatus", {**common, **own}, ~commanded, first),
            "RawCommand": table("RawCommand", {**common, "cmd": cmd}, commanded, first),
        }
        ends = pa.record_batch({"t_end": pa.array(t + 5, pa.timestamp("ns"))})
        self.transfers, self.start = TransferTable(ends, first), 0

    def table(self, name: str) -> DecodedTable:
        return self._tables[name]


def table(name: str, columns: dict[str, Any], rows: Any, first: int) -> DecodedTable:
    arrays = {key: values if isinstance(values, pa.Array) else pa.array(values) for key, values in columns.items()}
    return DecodedTable(name, pa.record_batch(arrays).filter(pa.array(rows)), first)


def batches(seed: int) -> list[Any]:
    chance = np.random.default_rng(seed)
    return [Batch(chance, k * COUNT) for k in range(4)]


@SEEDS
def test_reports_stand_together_by_esc(seed: int) -> None:
    for view in batches(seed):
        reports, status = esc_reports(view), view.table("ESCStatus")
        expected: dict[ReportingEsc, list[int]] = {}
        for row in np.flatnonzero(status.trusted).tolist():
            esc = ReportingEsc(status.bus.item(row), status.src.item(row), status["esc_index"].item(row))
            expected.setdefault(esc, []).append(row)
        assert reports is not None
        assert {esc: rows.tolist() for esc, rows in units(view).items()} == expected
        assert reports.escs == sorted(expected)
        assert [reports.escs[k] for k in reports.of.tolist()] == [esc for esc in reports.escs for _ in expected[esc]]
        still = reports.column("rpm") == 0
        assert reports.any(still) == [not status["rpm"][expected[esc]].all() for esc in reports.escs]
        before = reports.before(reports.number, [-1 - k for k in range(len(reports.escs))])
        for k, (esc, part) in enumerate(zip(reports.escs, reports.parts, strict=True)):
            number = status["transfer"][expected[esc]].tolist()
            assert before[part].tolist() == [-1 - k, *number[:-1]]
        assert [bus for bus, part in reports.by_bus() for _ in range(part.start, part.stop)] == [
            reports.escs[k].bus for k in reports.of.tolist()
        ]


@SEEDS
def test_the_command_in_force_at_each_report(seed: int) -> None:
    together, last = LastCommands(), dict[int, tuple[int, list[int]]]()
    for view in batches(seed):
        reports = esc_reports(view)
        assert reports is not None
        found = together.at_reports(view, reports)
        for esc, part in zip(reports.escs, reports.parts, strict=True):
            t, channels = last.get(esc.bus, (NO_TIME, []))
            before = t, [*channels, *[NO_CHANNEL] * 32][esc.index]
            alone = in_force(commands(view).get(esc.bus), before, esc.index, reports.table, reports.rows[part])
            assert [column[part].tolist() for column in found] == [column.tolist() for column in alone]
        together.feed(view)
        last |= {bus: (sent.t.item(-1), sent.cmd[:, -1].tolist()) for bus, sent in commands(view).items()}


@SEEDS
def test_the_last_valid_throttle_of_many_channels(seed: int) -> None:
    throttles = ValidThrottles()
    heard: dict[tuple[int, int], list[tuple[int, int, int]]] = {}  # number, time, throttle
    for view in batches(seed):
        reports, now = esc_reports(view), commands(view)
        assert reports is not None
        for bus, sent in now.items():
            for channel in range(6):
                columns = (sent.number.tolist(), sent.t.tolist(), sent.channel(channel).tolist())
                heard.setdefault((bus, channel), []).extend(zip(*columns, strict=True))
        bus = np.repeat([esc.bus for esc in reports.escs], np.diff(reports.first))
        channel = np.repeat([esc.index for esc in reports.escs], np.diff(reports.first))
        found = throttles.at(now, bus, channel, reports.number)
        for k, number in enumerate(reports.number.tolist()):
            before = [one for one in heard.get((bus[k], channel[k]), ()) if one[0] < number]
            valid = [one[1:] for one in before if one[2] >= 0]
            assert (found.t[k], found.value[k]) == (valid[-1] if valid else (NO_TIME, 0))
            assert found.last[k] == (before[-1][2] if before else NO_CHANNEL)
        throttles.feed(now)


@SEEDS
def test_a_steady_throttle_is_valid_and_close(seed: int) -> None:
    throttle, last = ValidThrottle(), dict.fromkeys(range(6), NO_TIME)
    for view in batches(seed):
        sent = commands(view).get(0)
        if sent is None:
            continue
        until = sent.t.item(-1) + STEP
        for channel in range(6):
            for longest in (STEP, 8 * STEP, 80 * STEP):
                times, cmd = [last[channel], *sent.t.tolist(), until], sent.channel(channel)
                close = all(after - before <= longest for before, after in pairwise(times))
                steady = last[channel] != NO_TIME and close and bool((cmd >= 0).all())
                assert throttle.steady(CommandGaps.of(sent), channel, until, longest) == steady
        throttle.feed(sent)
        for channel in range(6):
            valid = np.flatnonzero(sent.channel(channel) >= 0)
            last[channel] = sent.t.item(valid[-1]) if len(valid) else last[channel]


@SEEDS
def test_motors_begin_and_cease_to_turn(seed: int) -> None:
    motion, on = Motion(), dict[object, bool]()
    for view in batches(seed):
        status, told = view.table("ESCStatus"), list[tuple[int, int, object, bool]]()
        for esc, rows in units(view).items():
            said = zip(status["transfer"][rows].tolist(), (status["rpm"][rows] != 0).tolist(), strict=True)
            told += [(number, esc.bus, esc, turns) for number, turns in said]
        for bus, sent in commands(view).items():
            turning = (sent.cmd > 0).any(axis=0).tolist()
            told += [(number, bus, bus, turns) for number, turns in zip(sent.number.tolist(), turning, strict=True)]
        expected: dict[int, list[tuple[int, bool]]] = {}
        for number, bus, who, turns in sorted(told, key=lambda one: one[0]):
            before = any(on.get(one) for one in on if cast("Any", one) == bus or getattr(one, "bus", None) == bus)
            on[who] = bool(turns)
            after = any(on.get(one) for one in on if cast("Any", one) == bus or getattr(one, "bus", None) == bus)
            if before != after:
                expected.setdefault(bus, []).append((number, after))
        found = motion.feed(view)
        assert {
            bus: list(zip(one.number, one.turning, strict=True)) for bus, one in found.items() if len(one.number)
        } == (expected)
        number = view.transfers.first
        assert all((one.t == view.transfers.t_end[one.number - number]).all() for one in found.values())


@SEEDS
def test_the_throttle_in_the_last_moment(seed: int) -> None:
    long = 20 * STEP
    recent, heard = RecentThrottles(long), list[tuple[int, int, list[int]]]()
    chance = np.random.default_rng(seed)
    for view in batches(seed):
        sent = commands(view)[0]
        heard += zip(sent.number.tolist(), sent.t.tolist(), sent.cmd.T.tolist(), strict=True)
        first = view.transfers.first
        numbers = first + chance.integers(0, COUNT, 9)
        asked = list(zip(*(one.tolist() for one in (chance.integers(0, 2, 9), numbers, numbers * STEP)), strict=True))
        expected = [[cmd[index] for k, at, cmd in heard if k < number and at >= t - long] for index, number, t in asked]
        assert list(recent.spans(view, 0, asked)) == [
            (min(one), max(one)) if one else (NO_CHANNEL, NO_CHANNEL) for one in expected
        ]
        recent.feed(view)


@SEEDS
def test_slots_in_which_units_are_heard(seed: int) -> None:
    chance = np.random.default_rng(seed)
    rule, expected = NeverAnswered(), dict[tuple[int, int, int], list[int]]()
    for _ in range(5):
        bus, node, unit = (chance.integers(0, 3, 30).astype(np.uint8) for _ in range(3))
        t = chance.integers(-5, 20, 30) * 300_000_000
        rule._hear(bus, node, unit, t)
        for *who, at in zip(bus.tolist(), node.tolist(), unit.tolist(), (t // 500_000_000).tolist(), strict=True):
            known = expected.setdefault(cast("Any", tuple(who)), [])
            if at not in known[bisect_left(known, at) :][:1]:
                insort(known, at)
    assert rule._heard == MappingProxyType(expected)


@SEEDS
def test_a_histogram_fed_little_by_little_is_that_of_all(seed: int) -> None:
    chance = np.random.default_rng(seed)
    periods = chance.integers(-10, 1 << 40, 9000)
    whole, parts = PeriodHistogram(), PeriodHistogram()
    whole.feed(periods)
    ends = [*accumulate(chance.integers(0, 200, 60).tolist())]
    for part in np.split(periods, [end for end in ends if end < len(periods)]):
        parts.feed(part)
    assert parts.count == whole.count == (periods > 0).sum()
    assert [parts.below(share) for share in (0.01, 0.5, 0.99)] == [whole.below(share) for share in (0.01, 0.5, 0.99)]
