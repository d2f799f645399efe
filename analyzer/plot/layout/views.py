"""Views of series: a plot, lanes of states, a log, a page. Each is named by what it shows and in which unit."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import rerun as rr
import rerun.blueprint as rrb

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.plot.inventory import Series

COMMANDED = "commanded"
_EVER = rr.TimeRange(start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite())
_AXIS = rrb.TimeAxis(link="LinkToGlobal")  # who looks closer at one plot looks closer at all
_ALL_PLOTS = "view/5c0dca6a-e63f-9cf7-f657-2602590474cc"  # where the viewer keeps what they share
_LEGEND = 1.25  # height of a row with one, of those of others
_SIGNS = {"degC": "°C", "deg": "°", "us": "µs"}  # units as people write them
_TEXT = rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"])
_POINTS = {
    steps: rrb.PlotInteraction(tooltip_mode="All", points_display="Always" if steps else None)
    for steps in (False, True)
}
_STEPS = [rr.SeriesLines.from_fields(interpolation_mode="StepAfter")]


class Blueprint(rrb.Blueprint):
    """One whose plots all begin with the whole time, and not each with that of its own lines."""

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        super()._log_to_stream(stream)
        stream.log(f"{_ALL_PLOTS}/TimeAxis", rrb.TimeAxis(view_range=_EVER))


def plot(
    title: str,
    series: Sequence[Series],
    *,
    legend: bool = True,
    span: tuple[float, float] | None = None,
    steps: bool = False,
) -> rrb.View:
    """Show lines and points over time. The vertical axis begins with `span`; values stay until the next in `steps`."""
    roles = {one.role for one in series}
    faint = f" ({COMMANDED}: faint)" if COMMANDED in roles and len(roles) > 1 and not legend else ""
    return rrb.TimeSeriesView(
        origin=_common(series),
        contents=[one.path for one in series],
        name=f"{title}{_units(series)}{faint}",
        axis_x=_AXIS,
        axis_y=None if span is None else rrb.ScalarAxis(range=span),
        plot_legend=rrb.PlotLegend(visible=legend and len(series) > 1),
        interaction=_POINTS[steps],
        defaults=_STEPS if steps else None,
    )


def lanes(title: str, series: Sequence[Series]) -> rrb.View:
    """Show states over time, one lane a series."""
    return rrb.StateTimelineView(
        origin=_common(series), contents=[one.path for one in series], name=title, time_view=_AXIS
    )  # fmt: skip


def log(title: str, series: Sequence[Series]) -> rrb.View:
    """Show lines of text with their times."""
    return rrb.TextLogView(
        origin=_common(series), contents=[one.path for one in series], name=title, columns=_TEXT
    )  # fmt: skip


def page(title: str, series: Series) -> rrb.View:
    """Show a document."""
    return rrb.TextDocumentView(origin=series.path, contents=[series.path], name=title)


def grid(
    parts: Sequence[rrb.View | rrb.Container],
    name: str | None = None,
    *,
    columns: int | None = None,
    first: bool = False,
) -> rrb.Container:
    """Lay out about as many columns as rows, in doubt wider than high, as screens are, with few empty places.

    The `first` row can have more room: for a legend.
    """
    side = max(math.isqrt(len(parts)), 1)
    columns = columns or min(range(side, side + 3), key=lambda count: (-len(parts) % count, -count))
    rows = math.ceil(len(parts) / columns)
    shares = [_LEGEND] + [1.0] * (rows - 1)
    return rrb.Grid(contents=parts, grid_columns=columns, row_shares=shares if first else None, name=name)


def rows(parts: Sequence[rrb.View | rrb.Container], most: int) -> rrb.Container:
    """Lay out at most so many rows, those below with as many as those above or one less: no place is empty."""
    count = min(most, math.ceil(len(parts) / most))
    borders = [-(-len(parts) * k // count) for k in range(count + 1)]
    return rrb.Vertical(contents=[rrb.Horizontal(contents=parts[low:high]) for low, high in pairwise(borders)])


def _units(series: Iterable[Series]) -> str:
    units = [one for one in dict.fromkeys(_SIGNS.get(one.measure, one.measure) for one in series) if one]
    return f" [{', '.join(units)}]" if units else ""


def _common(series: Sequence[Series]) -> str:
    """Return the first part of their paths, which is that of all."""
    return "/" + series[0].path.split("/")[1]
