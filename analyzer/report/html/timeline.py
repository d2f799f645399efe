"""Time lines of a flight as inline SVG: a lane each device, lines on common scales, modes as bands, events as marks.

Positions are shares of the width, as in `svg`. Texts go through `Markup.format`, which escapes them.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from analyzer.report.html.svg import axis
from analyzer.report.moments import Span
from analyzer.report.triage.words import who
from analyzer.views.terminal import escape, fit
from dissectors.records import dataclass
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from analyzer.flight.flights import Flight
    from analyzer.flight.timeline.lanes import EventMark, TimeLane
    from analyzer.flight.timeline.strands import Strand
    from analyzer.flight.timeline.timeline import TimeLine
    from analyzer.report.triage.words import TriageWords

LANES = 24
_HIGH, _LOW, _BAND = 76, 34, 11  # px of a lane with lines, of one without, of the modes in it
_WIDE, _TALL = 10_000, 1000  # the box that lines are drawn in
_NEAR = 0.5  # percent of the width below which two marks are drawn as one
_LETTER = 0.75  # percent of the width that a letter of a mode takes
_TITLE, _MOST_TITLES = 160, 6
_ORDER = ("speed", "current", "temperature", "commanded", "voltage")
_FROM = {"voltage": 0.5}  # share of its top at which a scale begins, if not at 0
_SCALES: Mapping[str, tuple[str, float]] = {  # unit, and what a scale reaches at least
    "speed": ("rpm", 100), "current": ("A", 10), "temperature": ("°C", 60), "commanded": ("%", 100),
    "voltage": ("V", 10),
}  # fmt: skip
_BREAKS = 3  # that are told in words
_CODES = 8  # colours of modes
_Scale = tuple[float, float]  # lower and upper end


@dataclass(frozen=True, slots=True)
class _Sheet:
    """The common sheet of all lanes of a time line: `tops` are the upper ends of the scales."""

    line: TimeLine
    span: Span
    words: TriageWords
    tops: Mapping[str, float]
    styles: Mapping[int, str]  # of events, by identity
    prefix: str


def draw(
    line: TimeLine, words: TriageWords, styles: Mapping[int, str], prefix: str, ending: Callable[[Flight], str]
) -> dict[str, Any]:
    """Return what a template needs to show a time line.

    `styles` are classes of events by their `id`, `prefix` with their number is where they stand on the page,
    `ending` says how a flight ended.
    """
    shown = _shown(line, styles)
    tops = {name: _top(name, [lane.strands[name] for lane in shown if name in lane.strands]) for name in _ORDER}
    sheet = _Sheet(line, Span(line.start, line.end), words, tops, styles, prefix)
    used = [name for name in _ORDER if any(name in lane.strands for lane in shown)]
    modes = dict.fromkeys((stay.name, _style(stay.code, failed=stay.failed)) for lane in shown for stay in lane.stays)
    return {
        "flights": _flights(sheet, ending) if line.flights else "",
        "lanes": [(_name(lane), _told(lane), _lane(lane, sheet)) for lane in shown],
        "left": len(line.lanes) - len(shown),
        "axis": axis(sheet.span),
        "scales": [(name, f"{_bottom(name, tops):,.10g} to {tops[name]:,.10g} {_SCALES[name][0]}") for name in used],
        "modes": [(escape(name), style) for name, style in modes],
        "breaks": [_cut(one.text) for one in line.breaks[:_BREAKS]],
        "more_breaks": len(line.breaks[_BREAKS:]),
        "length": f"{(line.end - line.start) / SECOND:.3g} s",
        "onset": line.onset is not None,
    }


def _shown(line: TimeLine, styles: Mapping[int, str]) -> list[TimeLane]:
    """Return as many lanes as a page has room for: those in which it began go before others."""
    if len(line.lanes) <= LANES:
        return list(line.lanes)
    first = [any(styles.get(id(mark.event)) == "onset" for mark in lane.marks) for lane in line.lanes]
    kept = sorted(range(len(first)), key=lambda k: not first[k])[:LANES]
    return [line.lanes[k] for k in sorted(kept)]


def _top(name: str, strands: Sequence[Strand]) -> float:
    """Return a round number above all values."""
    most = max([_SCALES[name][1], *(float(np.abs(one).max()) for of in strands for one in (of.low, of.high))])
    power = 10.0 ** (len(str(int(most))) - 1)
    return next(part * power for part in (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10) if part * power >= most)


def _bottom(name: str, tops: Mapping[str, float]) -> float:
    return tops[name] * _FROM.get(name, 0)


def _name(lane: TimeLane) -> str:
    names = {"bus": "bus and recording", "autopilot": "the autopilot's log", "supply": "supply, all of them"}
    if lane.kind in names:
        return names[lane.kind]
    node = f"node {lane.node}"
    if lane.kind == "commands":
        return f"commands ({node})"
    speed = lane.strands.get("speed")
    turned = ", reverse" if speed is not None and _backwards(speed) else ""
    return f"{node if lane.ch is None else f'ch{lane.ch} {node}'}{turned}"


def _told(lane: TimeLane) -> str:
    """Return what the lines of a lane reach, in a few words."""
    parts = []
    for name, one in lane.strands.items():
        unit = _SCALES[name][0]
        if lane.kind in {"commands", "supply"}:
            parts.append(f"{float(one.low.min()):.3g} to {float(one.high.max()):.3g} {unit}")
        elif name != "commanded":
            parts.append(f"{float(max(one.high.max(), -one.low.min())):,.0f} {unit}")
    return ", ".join(parts)


def _backwards(one: Strand) -> bool:
    return float(np.median(one.low)) < 0


def _lane(lane: TimeLane, sheet: _Sheet) -> Markup:
    height = _HIGH if lane.strands else _LOW
    room = height - (_BAND + 3 if lane.stays else 0)
    parts = [_ground(sheet, height), *_strands(lane, sheet, room)]
    parts += [_stay(stay, sheet.span, height) for stay in lane.stays]
    told = [mark for mark in lane.marks if not lane.stays or mark.event.kind != "mode"]  # modes are bands
    parts += [_mark(marks, sheet, room) for marks in _joined(told, sheet)]
    events = f", {len(told)} event{'s' * (len(told) > 1)}" if told else ""
    return Markup('<svg class="course-lane" role="group" aria-label="{}{}" height="{}">{}</svg>').format(
        _name(lane), events, height, Markup("").join(parts)
    )


def _ground(sheet: _Sheet, height: int) -> Markup:
    """Draw what lies under a lane: ticks, holes of the recording, and the time in which it began."""
    span = sheet.span
    parts = [
        Markup('<line class="grid" x1="{0}%" x2="{0}%" y1="0" y2="{1}"/>').format(f"{at:.2f}", height)
        for at, _ in span.ticks()
    ]
    parts += [
        _box("hole", span, start, end, 0, height, "not recorded")
        for start, end in ((span.start, sheet.line.recorded[0]), (sheet.line.recorded[1], span.end))
        if start < end
    ]
    parts += [
        _box("hole", span, one.start, one.end, 0, height, f"not on the axis: {one.text}") for one in sheet.line.breaks
    ]
    if sheet.line.onset is not None:
        low, high = sheet.line.onset
        title = f"it began between {sheet.words.time(low)} and {sheet.words.time(high)}"
        parts.append(_box("began", span, low, high, 0, height, title))
    return Markup("").join(parts)


def _box(style: str, span: Span, start: int, end: int, y: int, height: int, title: str) -> Markup:
    left, right = span.share(start), span.share(end)
    return Markup('<rect class="{}" x="{}%" width="{}%" y="{}" height="{}"><title>{}</title></rect>').format(
        style, f"{left:.2f}", f"{max(right - left, 0.15):.2f}", y, height, _cut(title)
    )


def _flights(sheet: _Sheet, ending: Callable[[Flight], str]) -> Markup:
    """Draw when the vehicle flew."""
    parts = []
    for start, end, flight in sheet.line.flights:
        low, high = max(start, sheet.span.start), min(end, sheet.span.end)
        text = f"flight {flight.number}, {ending(flight)}"
        parts.append(_box("flight", sheet.span, low, high, 3, 13, text))
        if sheet.span.share(high) - sheet.span.share(low) > _LETTER * len(text):
            at = f"{sheet.span.share(low) + 0.3:.2f}"
            parts.append(Markup('<text class="stay" x="{}%" y="13">{}</text>').format(at, text))
    return Markup('<svg class="course-lane" role="group" aria-label="flights" height="18">{}</svg>').format(
        Markup("").join(parts)
    )


def _strands(lane: TimeLane, sheet: _Sheet, room: int) -> Iterator[Markup]:
    for name in reversed(_ORDER):
        one = lane.strands.get(name)
        if one is None:
            continue
        band = lane.kind in {"commands", "supply"}
        scale = _bottom(name, sheet.tops), sheet.tops[name]
        path = (_area if band else _path)(one, sheet, scale, turned=name == "speed" and _backwards(one))
        yield Markup(
            '<svg width="100%" height="{}" viewBox="0 0 {} {}" preserveAspectRatio="none">'
            '<path class="{} {}" d="{}"/></svg>'
        ).format(room, _WIDE, _TALL, "band" if band else "strand", name, path)


def _places(one: Strand, sheet: _Sheet, scale: _Scale, *, turned: bool) -> tuple[list[int], list[int], list[int]]:
    """Return places across, and those of the lowest and of the highest values, in the box."""
    length = max(sheet.span.end - sheet.span.start, 1)
    across = ((one.t - sheet.span.start) * _WIDE // length).tolist()
    low, high = (-one.high, -one.low) if turned else (one.low, one.high)
    ups = [
        np.clip(_TALL - _TALL * (values - scale[0]) / (scale[1] - scale[0]), 0, _TALL).astype(int).tolist()
        for values in (low, high)
    ]
    return across, *ups


def _path(one: Strand, sheet: _Sheet, scale: _Scale, *, turned: bool) -> str:
    """Return a line through all values; a step with several of them is an upright stroke."""
    parts = []
    for x, low, high, begins in zip(*_places(one, sheet, scale, turned=turned), one.begins.tolist(), strict=True):
        parts.append(f"{'M' if begins else 'L'}{x} {low}{f'V{high}' if high != low else ''}")
        if begins:
            parts.append("h1")  # a value alone is a point
    return "".join(parts)


def _area(one: Strand, sheet: _Sheet, scale: _Scale, *, turned: bool) -> str:
    """Return the area between the lowest and the highest values."""
    across, low, high = _places(one, sheet, scale, turned=turned)
    borders = [*np.flatnonzero(one.begins).tolist(), len(across)]
    parts = []
    for start, stop in pairwise(borders):
        upper = "L".join(f"{across[k]} {min(high[k], low[k] - 12)}" for k in range(start, stop))
        lower = "L".join(f"{across[k]} {low[k]}" for k in reversed(range(start, stop)))
        parts.append(f"M{upper}L{lower}Z")
    return "".join(parts)


def _stay(stay: Any, span: Span, height: int) -> Markup:
    left, right = span.share(stay.start), span.share(stay.end)
    name = escape(stay.name)
    box = _box(f"stay {_style(stay.code, failed=stay.failed)}", span, stay.start, stay.end, height - _BAND, _BAND, name)
    if right - left < _LETTER * (len(name) + 1):
        return box
    label = Markup('<text class="stay" x="{}%" y="{}">{}</text>').format(f"{left + 0.3:.2f}", height - 2, name)
    return box + label


def _style(code: int, *, failed: bool) -> str:
    return "failed" if failed else f"mode{code % _CODES}"


def _joined(marks: Iterable[EventMark], sheet: _Sheet) -> list[list[EventMark]]:
    """Return the marks, those that would touch together."""
    out: list[list[EventMark]] = []
    for mark in sorted(marks, key=lambda mark: mark.start):
        if out and sheet.span.share(mark.start) - sheet.span.share(out[-1][0].start) < _NEAR:
            out[-1].append(mark)
        else:
            out.append([mark])
    return out


def _mark(marks: Sequence[EventMark], sheet: _Sheet, room: int) -> Markup:
    """Draw one mark, or several at one place: a line with a head, and a bar as long as the longest of them lasts."""
    found = [sheet.styles.get(id(mark.event), "") for mark in marks]
    style = next((name for name in ("onset", "after", "before") if name in found), "calm")
    titles = [_title(mark, sheet.words) for mark in marks[:_MOST_TITLES]]
    titles += [f"and {len(marks) - _MOST_TITLES} more"] if marks[_MOST_TITLES:] else []
    at, end = (sheet.span.share(t) for t in (marks[0].start, max(mark.end for mark in marks)))
    bar = Markup('<line class="lasts" x1="{}%" x2="{}%" y1="2.5" y2="2.5"/>').format(f"{at:.2f}", f"{end:.2f}")
    return Markup(
        '<a href="#{}{}"><g class="event {}">{}<line x1="{x}%" x2="{x}%" y1="0" y2="{}"/>'
        '<circle cx="{x}%" cy="5" r="4.5"/><title>{}</title></g></a>'
    ).format(
        sheet.prefix, marks[0].number, style, bar if end - at > _NEAR else "", room, "\n".join(titles), x=f"{at:.2f}",
    )  # fmt: skip


def _title(mark: EventMark, words: TriageWords) -> str:
    one = mark.event
    whose = f"{who(one)} " if who(one) else ""
    return _cut(f"{words.time(one.first.t)} {whose}{one.kind}: {one.text}")


def _cut(text: str) -> str:
    return fit(escape(text), _TITLE)
