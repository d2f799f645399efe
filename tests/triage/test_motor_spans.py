"""Troubles of a motor: what is found among columns is what is found row by row, however reports come in pieces."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from analyzer.flight.clock import RowPlaces
from analyzer.flight.motors.spans import TOLD, MotorTrouble, TroubleSpans
from analyzer.flight.motors.watch import WAYS, ComparedReports
from dissectors.times import SECOND

AGAIN, PATIENCE = SECOND, 2 * SECOND
STEPS = st.sampled_from([SECOND // 10, SECOND // 10, AGAIN, AGAIN + 1, PATIENCE, PATIENCE + 1])
REPORTS = st.lists(st.tuples(st.booleans(), STEPS, st.sampled_from([0.2, 0.9, 1.1, 1.3])), min_size=1, max_size=40)
Row = tuple[bool, int, float]


def _compared(rows: list[Row], first: int, stop: int) -> ComparedReports:
    t = np.cumsum([step for _, step, _ in rows])[first:stop]
    frames, share = np.arange(first, stop), np.array([one for _, _, one in rows[first:stop]])
    at = RowPlaces(t, t, frames, frames, np.ones_like(frames))
    off = np.array([one for one, _, _ in rows[first:stop]], bool)
    return ComparedReports(off, np.full((stop - first, WAYS), -1), [None] * WAYS, share, share, share, at)


def _spans(rows: list[Row], cut: int) -> list[MotorTrouble]:
    spans = TroubleSpans()
    found = [one for piece in ((0, cut), (cut, len(rows))) for one in spans.feed(_compared(rows, *piece))]
    return [one for one in (*found, *([] if spans.open is None else [spans.open])) if one.counts]


def _row_by_row(rows: list[Row]) -> list[tuple[int, int, int | None, list[float], int]]:
    """Return the frames at which troubles begin, end and are over, the first shares and their number."""
    found: list[list[int]] = []
    ran = np.cumsum([step for _, step, _ in rows]).tolist()
    for k in (k for k, row in enumerate(rows) if row[0]):
        apart = ran[k] - ran[found[-1][-1]] if found else 0
        if found and (apart <= AGAIN or (found[-1][-1] == k - 1 and apart <= PATIENCE)):
            found[-1].append(k)
        else:
            found.append([k])
    return [
        (one[0], one[-1], one[-1] + 1 if one[-1] + 1 < len(rows) else None, [rows[k][2] for k in one[:TOLD]], len(one))
        for one in found
    ]


@given(REPORTS, st.data())
def test_troubles_are_those_of_reports_one_by_one(rows: list[Row], data: st.DataObject) -> None:
    told = [
        (one.first.frame, one.last.frame, one.after and one.after.frame, one.speed, one.count)
        for one in _spans(rows, data.draw(st.integers(0, len(rows))))
    ]
    every = _row_by_row(rows)
    assert [one for one in every if one in told] == told
    left_out = [one for one in every if one not in told]
    assert all(one[-1] == 1 or np.median(one[3]) > 1.05 for one in left_out)
    assert all(min(one[3]) > 0.2 or np.median(one[3]) > 1.05 for one in left_out)


def test_what_is_driven_faster_is_no_trouble() -> None:
    rows = [(True, SECOND // 10, 1.1)] * 9 + [(False, AGAIN + 1, 1.0)] + [(True, SECOND // 10, 0.9)] * 9
    assert [one.first.frame for one in _spans(rows, 4)] == [10]
    rows = [(True, SECOND // 10, 0.9)] * 9
    assert [one.count for one in _spans(rows, 4)] == [9]
