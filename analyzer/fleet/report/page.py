"""The report of a fleet as one HTML page that needs nothing else: tables, and how odd ESCs went."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from analyzer.fleet.report.text import answer, counted, no_rates, not_told, some_names
from analyzer.views.terminal import escape as shown

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analyzer.fleet.report.model import EscOutlier, FleetReport

_STYLE = (
    "body{font:15px/1.45 system-ui,sans-serif;max-width:70em;margin:2em auto;padding:0 1em;color:#222;background:#fff;"
    "overflow-wrap:anywhere}.wide{overflow-x:auto;margin:.6em 0}table{border-collapse:collapse}"
    "td,th{padding:.2em .8em .2em 0;text-align:left;border-bottom:1px solid #ddd;vertical-align:top;"
    "overflow-wrap:normal;max-width:26em}td.short{white-space:nowrap}td.long{overflow-wrap:anywhere;min-width:12em}"
    "svg{display:block;max-width:100%;height:auto}summary{cursor:pointer}"
    "@media(prefers-color-scheme:dark){body{color:#ddd;background:#181818}td,th{border-color:#444}}"
)
_SHORT, _LONG = 16, 24  # characters of a cell that is never broken, and of one that is broken anywhere
_MOST = 50  # rows of a table that are seen before somebody asks for all of them
_PLOTS = 100
_APART = 12  # so many units apart two labels can be read
_WIDTH, _HEIGHT, _MARGIN, _LABELS = 640, 120, 16, 50


def render(report: FleetReport) -> str:
    """Return the page."""
    return "".join(_page(report))


def _page(report: FleetReport) -> Iterator[str]:
    head = report.head
    yield f"<!doctype html><html lang=en><meta charset=utf-8><title>Fleet {escape(shown(head.store))}</title>"
    yield f'<meta name=viewport content="width=device-width"><style>{_STYLE}</style>'
    yield f"<h1>Fleet {escape(shown(head.store))}</h1><p><b>{escape(answer(report))}</b></p>"
    yield (
        f"<p>{counted(head)}.<br>{head.vehicles:,} vehicles, {head.flight_hours:,.2f} flight hours in {head.flights:,} "
        f"flights, {escape(head.first_day or '?')} to {escape(head.last_day or '?')}.</p>"
    )
    several = " (several: run check again for one)" if len(head.settings) > 1 or len(head.versions) > 1 else ""
    yield f"<p>tailbyte {escape(', '.join(head.versions))}, rules {escape(', '.join(head.settings))}{several}</p>"
    yield "<h2>Open these first</h2>"
    yield from _table(
        ("Vehicle", "Day", "What", "Support", "Command"),
        ((one.vehicle, one.date, one.title, one.support, one.command) for one in report.open_first),
    )
    yield (
        "<h2>Odd ESCs</h2><p>Each number is the difference from the other ESCs of the same flights. "
        f"{report.tested:,} series of at least {report.least_flights} flights were tested; of what is listed at most "
        "one in a hundred is chance. p is the probability of such a difference by chance.</p>"
    )
    yield from _table(
        ("Vehicle", "Ch", "What", "Now", "Usual", "Flights", "Since", "Against", "Support", "p"),
        (
            (
                one.vehicle, _channel(one), one.what, _amount(one, one.difference),
                _amount(one, one.fleet), one.flights, one.since or "always", one.against, one.support, f"{one.p:.1e}",
            )
            for one in report.odd
        ),
    )  # fmt: skip
    for one in report.odd[:_PLOTS]:
        yield from _plot(one)
    yield "<h2>Firmware</h2>"
    yield from _table(
        ("Firmware", "Flights", "Hours", "Vehicles"),
        (
            (one.software, one.flights, f"{one.hours:.2f}", f"{len(one.vehicles)}: {some_names(one.vehicles)}")
            for one in report.software
        ),
    )
    yield "<p>Captures with a finding per 100 flight hours; p is the probability of such a difference by chance:</p>"
    yield from _table(
        ("Rule", "Title", "Firmware", "Captures", "Rate", "95 % interval", "p", ""),
        (
            (
                one.rule, one.title, one.software, one.captures, f"{one.rate:.2f}", f"{one.low:.2f} - {one.high:.2f}",
                f"{one.p:.1e}",
                ("more than the others" + ("" if one.separable else ", but vehicle and firmware are not separable"))
                if one.differs else "",
            )
            for one in report.rates
        ),
        no_rates(report),
    )  # fmt: skip
    if report.since is not None:
        yield f"<h2>Worse since {escape(report.since.day)}</h2>"
        yield from _table(
            ("Rule", "Title", "Before", "After", "p"),
            ((o.rule, o.title, f"{o.before:.2f}", f"{o.after:.2f}", f"{o.p:.1e}") for o in report.since.worse),
            "nothing" if report.since.vehicles else not_told(report.since),
        )
        seen = (
            f"{rule}: {'never' if factor is None else f'x{factor:g}'}" for rule, factor in report.since.seen.items()
        )
        yield f"<p>Growth that would have been seen: {escape(', '.join(seen)) or 'none'}</p>"
    yield "<h2>What fails</h2>"
    yield from _table(
        ("Rule", "Title", "Severity", "Captures", "Vehicles", "One of them"),
        ((one.rule, one.title, one.severity, one.captures, one.vehicles, one.example) for one in report.rules),
    )
    yield "<h2>Vehicles</h2>"
    yield from _table(
        ("Vehicle", "Captures", "Failed", "Flights", "Hours"),
        ((one.vehicle, one.captures, one.failed, one.flights, f"{one.hours:.2f}") for one in report.vehicles),
    )
    yield "<h2>Without a result</h2>"
    yield from _table(("Capture", "Outcome", "Why"), ((one.url, one.outcome, one.error) for one in report.unread))
    yield "</html>\n"


def _table(head: Sequence[str], rows: Iterable[Sequence[object]], none: str = "none") -> Iterator[str]:
    some = list(rows)
    if not some:
        yield f"<p>{escape(none[:1].upper() + none[1:])}.</p>"
        return
    yield from _rows(head, some[:_MOST])
    if len(some) > _MOST:
        yield f"<details><summary>and {len(some) - _MOST:,} more</summary>"
        yield from _rows(head, some[_MOST:])
        yield "</details>"


def _rows(head: Sequence[str], rows: Sequence[Sequence[object]]) -> Iterator[str]:
    yield f"<div class=wide><table><tr>{''.join(f'<th>{escape(one)}' for one in head)}"
    for row in rows:
        yield f"<tr>{''.join(map(_cell, row))}"
    yield "</table></div>"


def _cell(content: object) -> str:
    text = shown(str(content))
    kind = " class=long" if len(text) > _LONG else " class=short" if len(text) <= _SHORT else ""
    return f"<td{kind}>{escape(text)}"


def _channel(one: EscOutlier) -> str:
    return f"node {one.node}" if one.ch is None else str(one.ch)


def _amount(one: EscOutlier, value: float) -> str:
    return f"{value:+.1%}" if one.share else f"{value:+.1f} C"


def _plot(one: EscOutlier) -> Iterator[str]:
    """Draw the differences, a dot a flight, and a line where it changed."""
    values = [value for _, value in one.points]
    low, high = min(*values, one.fleet), max(*values, one.fleet)
    step = (_WIDTH - 2 * _MARGIN) / max(len(values) - 1, 1)

    def height(value: float) -> float:
        return _HEIGHT - _MARGIN - (value - low) / ((high - low) or 1) * (_HEIGHT - 2 * _MARGIN)

    def label(text: str, x: float, y: float, anchor: str = "start") -> str:
        return f'<text x="{x}" y="{y:.1f}" text-anchor="{anchor}" font-size="11" fill="#888">{escape(text)}</text>'

    who = f"{shown(one.vehicle)} {'node' if one.ch is None else 'ch'}{one.node if one.ch is None else one.ch}"
    yield f"<h3>{escape(who)}: {escape(one.what)}, difference from the others of its flights</h3>"
    yield f'<svg viewBox="0 0 {_WIDTH + _LABELS} {_HEIGHT + 4}" width="{_WIDTH + _LABELS}" role="img">'
    yield f"<title>{escape(who)}</title>"
    zero = height(one.fleet)
    yield f'<line x1="{_MARGIN}" x2="{_WIDTH - _MARGIN}" y1="{zero:.1f}" y2="{zero:.1f}" stroke="#888"/>'
    for place, (day, value) in enumerate(one.points):
        late = bool(one.since) and day >= one.since
        colour = "#c33" if late else "#37c"
        yield (
            f'<circle cx="{_MARGIN + place * step:.1f}" cy="{height(value):.1f}" r="3" fill="{colour}">'
            f"<title>{escape(day)}: {_amount(one, value)}</title></circle>"
        )
    for value in {one.fleet, *(edge for edge in (low, high) if abs(height(edge) - zero) > _APART)}:
        yield label(_amount(one, value), _WIDTH - _MARGIN + 6, height(value) + 4)
    yield label(one.points[0][0], _MARGIN, _HEIGHT)
    yield label(one.points[-1][0], _WIDTH - _MARGIN, _HEIGHT, "end")
    yield "</svg>"
