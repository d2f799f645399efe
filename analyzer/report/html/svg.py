"""Plots of a report as inline SVG: positions are shares of the width, so they fit a phone and a wide screen alike.

Texts go through `Markup.format`, which escapes them. Colours are classes of the style sheet.
"""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

from markupsafe import Markup

from analyzer.report.model import SEVERITIES
from analyzer.report.moments import Span, clock
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from analyzer.report.model import Severity

POINTS = 500
_NEAR = 0.4  # percent of the width below which two marks are drawn as one
_EDGE = 7.0  # percent of the width in which a label is aligned to the edge
_NAMED = 6
_LANES: Mapping[Severity, int] = {"error": 5, "warning": 12, "note": 19}


@dataclass(slots=True)
class PlotMark:
    """One or several findings at one place of a timeline: ns, what to say of them, and where to jump."""

    start: int
    end: int
    rules: list[str]
    link: str
    count: int = 1


@dataclass(slots=True)
class Lane:
    """One row of a timeline."""

    name: str
    marks: dict[Severity, list[PlotMark]] = field(default_factory=lambda: defaultdict(list))

    def add(self, severity: Severity, mark: PlotMark) -> None:
        """Take a finding in."""
        self.marks[severity].append(mark)

    def draw(self, span: Span) -> Markup:
        """Draw the row: errors above, notes below; marks that would touch are one."""
        drawn = [
            _mark(mark, severity, span)
            for severity in SEVERITIES
            for mark in _joined(self.marks.get(severity, ()), span)
        ]
        return Markup('<svg class="lane" role="group" aria-label="Findings of {}" height="24">{}{}</svg>').format(
            self.name, _grid(span, 24), _join(drawn)
        )


def axis(span: Span) -> Markup:
    """Draw the times below a plot."""
    return Markup('<svg class="axis" aria-hidden="true" height="18">{}</svg>').format(
        _join(
            Markup('<text x="{}%" y="13" text-anchor="{}">{}</text>').format(f"{at:.2f}", _anchor(at), label)
            for at, label in span.ticks()
        )
    )


def course(
    values: Sequence[float],
    span: Span,
    start: int,
    step: int,
    *,
    title: str,
    unit: str = "",
    limits: Mapping[str, float] | None = None,
    top: float = 0,
    height: int = 170,
) -> Markup:
    """Draw a quantity over time: the mean of what a point stands for as area, its highest value as line above.

    Args:
        values: one a step.
        span: what the plot shows.
        start: ns of the first value.
        step: ns between values.
        title: what a reader who does not see the plot is told.
        unit: behind the numbers of the scale.
        limits: lines to stay below, by name.
        top: what the scale reaches at least.
        height: in pixels.
    """
    limits = limits or {}
    peak = max(values, default=0)
    ceiling = max(peak, top, *limits.values(), 1e-9) * 1.12
    left, right = span.share(start), span.share(start + step * len(values))
    parts = [_grid(span, height)]
    for value in _scale(ceiling):
        parts.append(_level(value, ceiling, height, "grid"))
        parts.append(_label(value, ceiling, height, f"{value:,.10g}{unit}", "scale"))
    parts.append(
        Markup(
            '<svg x="{}%" width="{}%" height="{}" viewBox="0 0 1000 100" preserveAspectRatio="none">'
            '<path class="mean" d="{}"/><path class="peak" d="{}"/></svg>'
        ).format(f"{left:.3f}", f"{max(right - left, 0.2):.3f}", height, *_shapes(values, ceiling))
    )
    for name, value in limits.items():
        parts.append(_level(value, ceiling, height, "limit"))
        parts.append(_label(value, ceiling, height, f"limit {value:,.10g}{unit}, {name}", "limit"))
    return Markup('<svg class="course" role="img" height="{}"><title>{}</title>{}</svg>').format(
        height, title, _join(parts)
    )


def sparkline(values: Sequence[float], title: str) -> Markup:
    """Draw a small course for a table cell."""
    mean, _ = _shapes(values, max(values, default=0) or 1, points=60)
    return Markup(
        '<svg class="spark" role="img" width="120" height="22" viewBox="0 -2 1000 104" preserveAspectRatio="none">'
        '<title>{}</title><path class="mean" d="{}"/></svg>'
    ).format(title, mean)


def shares(parts: Sequence[tuple[str, str, int]], title: str) -> Markup:
    """Draw a bar in parts, given by class, name and count."""
    total = sum(count for _, _, count in parts) or 1
    drawn, at = [], 0
    for style, name, count in parts:
        if count:
            drawn.append(
                Markup('<rect class="{}" x="{}%" width="{}%" height="14"><title>{} {}</title></rect>').format(
                    style, f"{100 * at / total:.2f}", f"{100 * count / total:.2f}", count, name
                )
            )
        at += count
    return Markup('<svg class="shares" role="img" height="14"><title>{}</title>{}</svg>').format(title, _join(drawn))


def _join(parts: Iterable[Markup]) -> Markup:
    return Markup("").join(parts)


def _anchor(at: float) -> str:
    return "start" if at < _EDGE else "end" if at > 100 - _EDGE else "middle"


def _grid(span: Span, height: int) -> Markup:
    line = Markup('<line class="grid" x1="{0}%" x2="{0}%" y1="0" y2="{1}"/>')
    return _join(line.format(f"{at:.2f}", height) for at, _ in span.ticks())


def _joined(marks: Iterable[PlotMark], span: Span) -> list[PlotMark]:
    out: list[PlotMark] = []
    for mark in sorted(marks, key=lambda mark: (mark.start, mark.end)):
        if out and span.share(mark.start) - span.share(out[-1].end) < _NEAR:
            last = out[-1]
            last.end, last.count = max(last.end, mark.end), last.count + mark.count
            last.rules += [rule for rule in mark.rules if rule not in last.rules]
        else:
            out.append(PlotMark(mark.start, mark.end, list(mark.rules), mark.link, mark.count))
    return out


def _mark(mark: PlotMark, severity: Severity, span: Span) -> Markup:
    rules = ", ".join(mark.rules[:_NAMED]) + (f" and {len(mark.rules) - _NAMED} more" if mark.rules[_NAMED:] else "")
    many = f" ({mark.count} findings)" if mark.count > 1 else ""
    until = f" to {clock(mark.end)}" if mark.end > mark.start else ""
    return Markup(
        '<a href="#{}"><line class="mark {}" x1="{}%" x2="{}%" y1="{y}" y2="{y}">'
        "<title>{}: {}{}, {}{}</title></line></a>"
    ).format(
        mark.link,
        severity,
        f"{span.share(mark.start):.2f}",
        f"{span.share(mark.end):.2f}",
        severity,
        rules,
        many,
        clock(mark.start),
        until,
        y=_LANES[severity],
    )


def _scale(ceiling: float) -> list[float]:
    """Return two to five round numbers below the ceiling."""
    power = 10.0 ** (len(str(int(ceiling))) - 1) if ceiling >= 1 else 0.1
    step = next(part * power for part in (0.2, 0.25, 0.5, 1, 2, 5) if ceiling / (part * power) < 5.5)
    return [step * k for k in range(1, int(ceiling / step) + 1) if step * k < ceiling * 0.97]


def _height(value: float, ceiling: float, height: int) -> float:
    return height * (1 - value / ceiling)


def _level(value: float, ceiling: float, height: int, style: str) -> Markup:
    return Markup('<line class="{}" x1="0" x2="100%" y1="{y}" y2="{y}"/>').format(
        style, y=f"{_height(value, ceiling, height):.1f}"
    )


def _label(value: float, ceiling: float, height: int, text: str, style: str) -> Markup:
    right = style == "limit"
    return Markup('<text class="{}" x="{}" y="{}" text-anchor="{}">{}</text>').format(
        style, "100%" if right else "0", f"{_height(value, ceiling, height) - 4:.1f}", "end" if right else "start", text
    )


def _shapes(values: Sequence[float], ceiling: float, points: int = POINTS) -> tuple[str, str]:
    """Return paths of the means as an area and of the highest values as a line, in a box of 1000 x 100."""
    count = min(len(values), points)
    means, peaks = list[str](), list[str]()
    for k in range(count):
        part = values[len(values) * k // count : len(values) * (k + 1) // count]
        across = f"{1000 * k / count:.1f}", f"{1000 * (k + 1) / count:.1f}"
        mean, peak = 100 - 100 * sum(part) / len(part) / ceiling, 100 - 100 * max(part) / ceiling
        means.append(f"L{across[0]} {mean:.1f}H{across[1]}")
        peaks.append(f"{'L' if peaks else 'M'}{across[0]} {peak:.1f}H{across[1]}")
    return f"M0 100{''.join(means)}V100Z" if means else "", "".join(peaks)
