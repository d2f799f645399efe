"""The load of a bus second by second: what is in which second, who is to blame, and clocks that are set back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from kit.traffic import MS, SECOND, START, at, lines, throttle

if TYPE_CHECKING:
    from collections.abc import Callable

    Tables = Callable[..., dict[str, Any]]


def commands(times: list[int]) -> bytes:
    return lines(*(at(t, throttle(n % 32).frames()[0]) for n, t in enumerate(times)))


def seconds(tables: Tables, times: list[int], **how: Any) -> list[tuple[int, int]]:
    rows = tables(commands(times), names=["load"], **how)["load_seconds"].records()
    return [((row["start_ns"] - START) // SECOND, row["frames"]) for row in rows]


def test_seconds_count_from_the_first_frame(tables: Tables) -> None:
    times = [n * 250 * MS for n in range(9)]
    assert seconds(tables, times) == [(0, 4), (1, 4), (2, 1)]
    assert seconds(tables, [t + 300 * MS for t in times]) == [(0, 4), (1, 4), (2, 1)]
    assert seconds(tables, times, where="RawCommand") == [(0, 4), (1, 4), (2, 1)]


def test_a_clock_that_is_set_back_begins_anew(tables: Tables) -> None:
    times = [n * 250 * MS for n in range(6)]
    assert sorted(seconds(tables, [*times, *times])) == [(0, 4), (0, 4), (1, 2), (1, 2)]


def test_frames_that_change_places_do_not(tables: Tables) -> None:
    times = [0, 500 * MS, 1001 * MS, 999 * MS, 1500 * MS, 2000 * MS]
    assert seconds(tables, times) == [(0, 3), (1, 2), (2, 1)]


def test_the_worst_second_and_its_limits(tables: Tables) -> None:
    slow = [n * 10 * MS for n in range(300)]
    fast = [3 * SECOND + n * SECOND // 5000 for n in range(5000)]
    found = tables(commands([*slow, *fast]), names=["load"])
    (bus,) = found["load"].records()
    assert (bus["seconds"], bus["worst_frames"]) == (4, 5000)
    assert (bus["worst_ns"] - START) == 3 * SECOND
    assert 50 < bus["worst_pct"] < 70
    notes = " ".join(found["load"].notes)
    assert "can0: 1 s above 50 % (BUS-004)" in notes
    assert "70 %" not in notes
    assert "1 s above 2400 frames (BUS-001" in notes
    (cause,) = found["load_worst"].records()
    assert (cause["node"], cause["type"], cause["share_pct"]) == ("1", "RawCommand", 100.0)


def test_long_captures_show_the_worst_seconds(tables: Tables) -> None:
    times = [second * SECOND + n * MS for second in range(100) for n in range(5 + second % 7)]
    table = tables(commands(times), names=["load"])["load_seconds"]
    assert len(table.rows) == 100
    assert len(table.shown) == 20
    assert {table.rows[row][2] for row in table.shown} == {10, 11}


@pytest.mark.parametrize("names", [["load"], ["io"], ["periods"]])
def test_without_times_it_says_so(names: list[str], tables: Tables) -> None:
    text = b"".join(b"can0 1F040601#0000000000%02XC0\n" % n for n in range(4))
    (first, *_) = tables(text, names=names).values()
    assert list(first.rows) == []
    assert "no time" in first.notes[-1]
