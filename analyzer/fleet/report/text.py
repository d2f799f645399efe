"""The report of a fleet for people: one screen of what matters, or one table with all its rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.fleet.report.rates import FEWEST
from analyzer.report.lines import wrap
from analyzer.views.terminal import display_width, escape, fit

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from analyzer.fleet.report.model import EscOutlier, FleetHead, FleetReport, OpenFirst, SinceThen

_MOST = 5  # rows of a table on the screen
_NAME = 24  # columns of a name in a sentence
_NAMED = 3  # of many in a sentence
_LEAST_WIDTH, _LEAST_TABLE = 40, 71  # columns; those of an ESC but for its vehicle


def render(report: FleetReport, *, width: int = 80, by: str | None = None) -> str:
    """Return the report, `by` one table alone: vehicle, software, rule or esc."""
    width = max(width, _LEAST_WIDTH)
    parts = [*_head(report, width), ""]
    if by is not None:
        parts += _TABLES[by](report, None, width)
    else:
        for part in (
            _open_first(report.open_first, width),
            _esc(report, _MOST, width),
            _software(report, _MOST, width),
        ):
            parts += [*part, ""]
        parts += _since(report, width)
        parts += ["", *_rule(report, _MOST, width), "", *_last(report, width)]
    return "".join(f"{line}\n" for line in parts)


def _head(report: FleetReport, width: int) -> Iterator[str]:
    head = report.head
    yield from wrap(f"Fleet {escape(head.store)}: {answer(report)}", width)
    yield from wrap(counted(head), width)
    rules = " ".join(one[:4] for one in head.settings)
    mixed = " (several: run check again for one)" if len(head.settings) > 1 or len(head.versions) > 1 else ""
    yield from wrap(
        f"{_of(head.vehicles, 'vehicle')}, {_hours(head.flight_hours)} in {_of(head.flights, 'flight')}, "
        f"{head.first_day or '?'} to {head.last_day or '?'}, tailbyte {' '.join(head.versions)}, rules {rules}{mixed}",
        width,
    )


def counted(head: FleetHead) -> str:
    """Return how many captures there are, and what became of them."""
    counts = [f"{_of(head.captures, 'capture')}: {head.judged:,} judged"]
    counts += [f"{head.not_judged:,} too short or no flight"] if head.not_judged else []
    counts += [f"{head.unreadable:,} unreadable"] if head.unreadable else []
    counts += [f"{_of(head.duplicates, 'duplicate')} (counted once)"] if head.duplicates else []
    counts += [f"{head.unavailable:,} could not be read: run check again"] if head.unavailable else []
    return ", ".join(counts) + (f"; damaged in part: {head.damaged:,}" if head.damaged else "")


def answer(report: FleetReport) -> str:
    """Return what matters of the fleet in one sentence."""
    failing = sorted((one for one in report.vehicles if one.failed), key=lambda one: (-one.failed, one.vehicle))
    failed = sum(one.failed for one in failing)
    named = [one for one in failing if one.vehicle]
    said = [f"{failed:,} of {_of(report.head.judged, 'judged capture')} {'fails' if failed == 1 else 'fail'}"]
    if named:
        some = ", ".join(f"{_short(one.vehicle)} {one.failed:,}" for one in named[:_NAMED])
        said[0] += f", of {_of(len(named), 'vehicle')} ({some}{' ...' if len(named) > _NAMED else ''})"
    said.append(f"{_of(len(report.open_first), 'capture')} to open first" if report.open_first else "")
    whose = list(dict.fromkeys(f"{_short(one.vehicle)} {_named(one)}" for one in report.odd))
    none = "no odd ESC" if report.tested else f"odd ESCs: cannot tell, none has {report.least_flights} flights"
    said.append(f"{_of(len(whose), 'odd ESC')}: {_first(whose)}" if whose else none)
    more = sorted(
        {f"{one.rule} more often with firmware {_short(one.software)}" for one in report.rates if one.differs}
    )
    said.append(_first(more))
    if report.since is not None and report.since.vehicles:
        worse = [one.rule for one in report.since.worse]
        said.append(f"worse since {report.since.day}: {_first(worse) if worse else 'nothing'}")
    return "; ".join(filter(None, said))


def _short(name: str) -> str:
    return fit(escape(name), _NAME)


def _named(one: EscOutlier) -> str:
    return f"node {one.node}" if one.ch is None else f"ch{one.ch}"


def _first(names: Sequence[str]) -> str:
    return ", ".join(names[:_NAMED]) + (" ..." if len(names) > _NAMED else "")


def _hours(hours: float) -> str:
    if hours < 1:
        return f"{hours * 60:.1f} flight minutes"
    return f"{hours:,.0f} flight hours" if hours >= 10 else f"{hours:.2f} flight hours"


def _open_first(some: Sequence[OpenFirst], width: int) -> Iterator[str]:
    yield "Open these first" if some else "Open these first   nothing: no capture tells a cause"
    for one in some[:_MOST]:
        what = f" {escape(one.vehicle) or '?'} {one.date}  {one.title}, {one.support}"
        command = escape(one.command)
        if display_width(what) + display_width(command) + 2 <= width:
            yield f"{_padded(what, width - display_width(command))}{command}"
        else:
            yield from wrap(what, width, first=" ", indent="   ")
            yield f"   {command}"
    if len(some) > _MOST:
        yield f" and {len(some) - _MOST} more: --json -"


def _esc(report: FleetReport, most: int | None, width: int) -> Iterator[str]:
    least = report.least_flights
    yield f"Odd ESCs (difference from the others of the same flights; >= {least} flights)"
    if not report.odd:
        yield f" none of {report.tested} series" if report.tested else f" no ESC has {least} flights of a named vehicle"
        return
    names = [escape(one.vehicle) for one in report.odd[:most]]
    room = max(map(display_width, names)) if most is None else width - _LEAST_TABLE
    wide = max(8, min(room, max(map(display_width, names))))
    yield f" {'vehicle':<{wide}} ch what                      now usual          n since      support"
    for name, one in zip(names, report.odd, strict=False):
        yield (
            f" {_padded(name, wide)} {_channel(one):>2} {one.what:<20} {_amount(one, one.difference):>8} "
            f"{_usual(one):<11} {one.flights:>4} {one.since or 'always':<10} {one.support}"
        )
    if most is not None and len(report.odd) > most:
        yield f" and {len(report.odd) - most} more: --by esc"


def _padded(name: str, width: int) -> str:
    cut = fit(name, width)
    return cut + " " * (width - display_width(cut))


def _channel(one: EscOutlier) -> str:
    return str(one.ch) if one.ch is not None else f"#{one.node}"


def _amount(one: EscOutlier, value: float) -> str:
    return f"{value:+.0%}" if one.share else f"{value:+.1f} C"


def _usual(one: EscOutlier) -> str:
    if one.share:
        return f"{one.fleet:+.0%} +-{one.spread * 2:.0%}"
    return f"{one.fleet:+.1f} +-{one.spread * 2:.1f}"


def _software(report: FleetReport, most: int | None, width: int) -> Iterator[str]:
    yield "Firmware x finding (captures with it per 100 flight hours, 95 % interval)"
    if len(report.software) < 1:
        yield " no ESC tells its firmware"
        return
    uses = sorted(report.software, key=lambda one: -one.hours)[:most]
    for one in uses:
        flights = _of(one.flights, "flight") + (
            "" if one.flights >= FEWEST else f" (fewer than {FEWEST}: not compared)"
        )
        use = f" {escape(one.software)}: {flights}, {_hours(one.hours)}, {some_names(one.vehicles)}"
        yield from wrap(use, width, first=" ", indent="   ")
    if most is not None and len(report.software) > most:
        yield f" and {len(report.software) - most} more: --by software"
    rules = _by_weight(report)
    of_one = [one for one in report.rules if one.one_of_them]
    for rule in rules[:most]:
        if not any(one.differs for one in report.rates if one.rule == rule) and most is not None:
            count = sum(one.captures for one in report.rates if one.rule == rule)
            mostly = next((f", {one.of_most:,} of {_short(one.most)}" for one in of_one if one.rule == rule), "")
            yield f" {rule:<9} {_of(count, 'capture')}, no difference seen{mostly}"
            continue
        for rate in sorted((one for one in report.rates if one.rule == rule), key=lambda one: -one.rate)[:most]:
            mark = "  * more than the others" if rate.differs else ""
            amount = f"{_rate(rate.rate)} [{_rate(rate.low)}-{_rate(rate.high)}]"
            yield f" {rate.rule:<9} {_padded(escape(rate.software), 22)} {amount}{mark}"
            if rate.differs and not rate.separable:
                only = (
                    f"{escape(rate.software)} flies only on {some_names(rate.only_on)}, where no other firmware flies:"
                )
                yield from wrap(
                    f"{only} vehicle and firmware are not separable",
                    width,
                    first="   ",
                    indent="   ",
                )
    if not rules:
        yield f" {no_rates(report)}"
    elif most is not None and len(rules) > most:
        yield f" and {len(rules) - most} rules more: --by software"


def no_rates(report: FleetReport) -> str:
    """Return why there are no rates of rules."""
    compared = any(one.flights >= FEWEST for one in report.software)
    return "no ESC breaks a rule" if compared else f"nothing is compared: no firmware has {FEWEST} flights"


def _by_weight(report: FleetReport) -> list[str]:
    """Return the rules, those first that differ, then the frequent ones."""
    differs = {one.rule for one in report.rates if one.differs}
    often: dict[str, int] = {}
    for one in report.rates:
        often[one.rule] = often.get(one.rule, 0) + one.captures
    return sorted((rule for rule in often if often[rule]), key=lambda rule: (rule not in differs, -often[rule], rule))


def _rate(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.1f}" if value >= 1 else f"{value:.2f}"


def some_names(names: Sequence[str]) -> str:
    """Return a few of many names."""
    shown = ", ".join(escape(name) or "?" for name in names[:4])
    return f"{shown} and {len(names) - 4} more" if len(names) > 4 else shown


def _since(report: FleetReport, width: int) -> Iterator[str]:
    then = report.since
    if then is None:
        yield "Worse since ...   --since 7d, or a day"
        return
    if not then.vehicles:
        yield f"Worse since {then.day}   {not_told(then)}"
        return
    yield f"Worse since {then.day}   {'' if then.worse else 'nothing'}".rstrip()
    for one in then.worse:
        yield fit(f" {one.rule:<9} {_rate(one.before)} -> {_rate(one.after)} per 100 h  {one.title}", width)
    if then.seen:
        grown = [f"{rule} x{factor:g}" if factor else f"{rule} never" for rule, factor in list(then.seen.items())[:6]]
        yield from wrap(f"growth that would have been seen: {', '.join(grown)}", width, first=" ", indent="  ")


def not_told(then: SinceThen) -> str:
    """Return why nothing can be said of a day of which no vehicle tells both sides."""
    if then.hours_before and then.hours_after:
        return "cannot tell: no vehicle flew before and after it"
    return f"cannot tell: no flight {'before' if then.hours_after else 'after'} it"


def _of(count: int, what: str) -> str:
    return f"{count:,} {what}{'' if count == 1 else 's'}"


def _rule(report: FleetReport, most: int | None, width: int) -> Iterator[str]:
    yield "What fails" if report.rules else "What fails   nothing"
    for one in report.rules[:most]:
        whose = f"of {_of(one.vehicles, 'vehicle')}" if one.vehicles else ""  # captures may name none
        if one.one_of_them:
            whose += f", {one.of_most:,} of {_short(one.most)}"
        line = f" {one.rule:<9} {one.severity:<8} {_of(one.captures, 'capture'):<14} {whose:<15}"
        if display_width(line) + display_width(one.title) < width:
            yield f"{line} {one.title}"
        else:
            yield line.rstrip()
            yield from wrap(one.title, width, first=" " * 11, indent=" " * 11)
    if most is not None and len(report.rules) > most:
        yield f" and {len(report.rules) - most} more: --by rule"


def _vehicle(report: FleetReport, most: int | None, _: int) -> Iterator[str]:
    names = [escape(one.vehicle) or "?" for one in report.vehicles[:most]]
    wide = max(16, *map(display_width, names)) if names else 16
    yield f" {'vehicle':<{wide}}  captures  failed  flights   hours"
    for name, one in zip(names, report.vehicles, strict=False):
        yield f" {_padded(name, wide)} {one.captures:>9,} {one.failed:>7,} {one.flights:>8,} {one.hours:>7.2f}"


def _last(report: FleetReport, width: int) -> Iterator[str]:
    count = report.head.duplicates
    yield (
        f"Duplicates {_of(count, 'capture')} with the sha256 of another one: counted once"
        if count
        else "Duplicates none"
    )
    for one in report.unread[:_MOST]:
        yield from wrap(f"{one.outcome} {escape(one.url)}: {escape(one.error)}", width, indent="  ")
    if len(report.unread) > _MOST:
        yield f"and {len(report.unread) - _MOST} more without a result: --json -"


_TABLES: dict[str, Callable[[FleetReport, int | None, int], Iterator[str]]] = {
    "vehicle": _vehicle,
    "software": _software,
    "rule": _rule,
    "esc": _esc,
}
