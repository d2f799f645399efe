"""Flights and their events for people: a line each, what befalls several ESCs at once in one."""

from __future__ import annotations

import json
from itertools import pairwise
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from analyzer.views.terminal import PLAIN, escape, fit
from analyzer.views.times import TimeFormat
from dissectors.records import dataclass
from dissectors.times import MILLISECOND, SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analyzer.stats.table import StatTable
    from analyzer.views.terminal import Palette

MOST_WHO = 24
TOGETHER = SECOND // 2  # events of several ESCs that are told in one line
_YEAR_2000 = 946_684_800 * SECOND
_UNITS = (("voltage", "V"), ("current", "A"), ("temperature", "C"), ("speed", "rpm"))
_SHOWN = {"fault": ("voltage", "current", "temperature", "speed"), "mode": ("voltage", "current", "speed")}
_BAD = ("fault", "sag", "restart", "silence", "commands stop")


@dataclass(slots=True)
class _Line:
    """Events that are told together: the first one, and who they are of."""

    first: Mapping[str, Any]
    all: list[Mapping[str, Any]]


class EventStory:
    """Writes the tables of `stats flights` and `stats events` with at most `width` columns.

    Times are of day, or count from `start` if they have no date.
    """

    def __init__(self, width: int, start: int | None, *, buses: int, palette: Palette = PLAIN) -> None:
        self._width, self._start, self._buses, self._palette = max(width, 60), start or 0, buses, palette
        dated = start is not None and start >= _YEAR_2000
        self._clock = TimeFormat("a", digits=6) if dated else None
        self._times = 0

    def flights(self, table: StatTable) -> Iterator[str]:
        """Write the flights."""
        yield self._palette.paint("head", "flights") + ("" if table.rows else "  none: no motor turned for long enough")
        for one in table.records():
            seconds = "" if one["duration_s"] is None else f"{one['duration_s']:.1f} s"
            chs = f"ch{_ranges(one['chs'])}  " if one["chs"] else ""
            yield (
                f"{one['flight']:>3}  {self._time(one['t_ns'])} to {self._time(one['t_end_ns'])}  {seconds:>8}  "
                f"{one['end']:<6}  {chs}by {one['by']}"
            )
        yield from self._notes(table)

    def events(self, table: StatTable) -> Iterator[str]:
        """Write the events, with how long before its time each may have happened."""
        yield self._palette.paint("head", "events") + ("" if table.rows else "  none")
        lines = _together(table.records())
        if lines:
            who = min(max(3, *(len(self._who(line)) for line in lines)), MOST_WHO)
            self._times = max(4, *(len(self._time(line.first["t_end_ns"])) for line in lines))
            yield self._palette.paint("dim", f"{'Time':<{self._times}}  {'Within':>7}  {'Who':<{who}}  What")
            for line in lines:
                yield from self._line(line, who)
        yield from self._notes(table)

    def _line(self, line: _Line, width: int) -> Iterator[str]:
        one = line.first
        since, at = min(e["t_ns"] or e["t_end_ns"] for e in line.all), one["t_end_ns"]
        within = "" if since >= at else _span(at - since)
        if one["t_ns"] is None:
            within = "" if one["kind"] in ("join", "message") else "start"
        who = self._who(line)
        head = f"{self._time(at):>{self._times}}  {within:>7}  {fit(who, width):<{width}}  "
        room = max(self._width - len(head), 20)
        said = wrap(escape(self._what(line)), room, break_on_hyphens=False) or [""]
        kind, _, rest = said[0].partition("  ")
        style = "bad" if one["kind"] in _BAD else "note"
        yield head + self._palette.paint(style, kind) + ("  " + rest if rest else "")
        yield from (" " * len(head) + more for more in said[1:])

    def _who(self, line: _Line) -> str:
        one = line.first
        if one["source"] != "bus":
            return str(one["source"])
        if one["node"] is None:
            return escape(one["bus"] or "all")
        chs = [event["ch"] for event in line.all]
        prefix = f"{escape(one['bus'])} " if self._buses > 1 else ""
        if all(chs):
            many = f"ch{_ranges(','.join(chs))}"
            return prefix + (many if len(chs) > 1 else f"{many} node {one['node']}")
        return prefix + f"node {_ranges(','.join(event['node'] for event in line.all))}"

    def _what(self, line: _Line) -> str:
        one = line.first
        values = json.loads(one["values"]) if len(line.all) == 1 else {}
        shown = [name for name in _SHOWN.get(one["kind"], ()) if name in values]
        units = dict(_UNITS)
        measured = " ".join(f"{values[name]:.{0 if name == 'speed' else 1}f}{units[name]}" for name in shown)
        text = f"{one['kind']}: {one['text']}"
        if one["kind"] in ("fault", "sag"):
            ends = [event["until_ns"] for event in line.all]
            text += ", to the end" if None in ends else f", for {_span(max(ends) - one['t_end_ns'])}"
        if measured:
            text += f" ({measured}"
            hottest = values.get("worst_temperature")
            text += f", up to {hottest:.0f}C)" if hottest is not None else ")"
        return text

    def _time(self, t: int | None) -> str:
        if t is None:
            return "-"
        return f"{(t - self._start) / SECOND:.3f} s" if self._clock is None else self._clock.text(t)[:-3]

    def _notes(self, table: StatTable) -> Iterator[str]:
        for note in table.notes:
            yield from wrap(note, self._width, initial_indent="  ", subsequent_indent="  ", break_on_hyphens=False)


def _together(events: Sequence[Mapping[str, Any]]) -> list[_Line]:
    """Return the events; what several devices tell alike within `TOGETHER` is told once."""
    lines: list[_Line] = []
    open_: dict[tuple[Any, ...], _Line] = {}
    for one in events:
        text = "" if one["kind"] == "sag" else one["text"]
        key = one["kind"], text, one["type"], one["bus"], bool(one["ch"])
        line = open_.get(key)
        near = line is not None and 0 <= one["t_end_ns"] - line.first["t_end_ns"] <= TOGETHER
        if line is not None and near and one["node"] not in {None, *(event["node"] for event in line.all)}:
            line.all.append(one)
            continue
        open_[key] = _Line(one, [one])
        lines.append(open_[key])
    return lines


def _ranges(text: str) -> str:
    """Return `1,2,3,5` as `1-3,5`."""
    some = sorted({int(part) for part in text.split(",") if part})
    borders = [k for k, (a, b) in enumerate(pairwise(some), 1) if b != a + 1]
    parts = [some[a:b] for a, b in pairwise([0, *borders, len(some)])]
    return ",".join(str(part[0]) if len(part) == 1 else f"{part[0]}-{part[-1]}" for part in parts if part)


def _span(ns: int) -> str:
    """Return a duration as people write it."""
    if ns < SECOND:
        return f"{ns / MILLISECOND:.0f} ms"
    return f"{ns / SECOND:.1f} s" if ns < 600 * SECOND else f"{ns / (60 * SECOND):.0f} min"
