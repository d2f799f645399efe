"""The report as text for people, the default on standard output: the verdict, then what is wrong, worst first."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.report import headline, wording
from analyzer.report.inventory import inventory
from analyzer.report.lines import GAP, NARROWEST, columns, pack, right, wrap
from analyzer.report.problems import Problem
from analyzer.views.terminal import PLAIN, Palette, display_width, fit
from dissectors.records import dataclass
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analyzer.report.headline import Headline
    from analyzer.report.model import CaptureSummary, Category, Report

WIDTH = 80
_INDENT = " " * 6
_DETAIL = " " * 11
_BYTES = " " * 13
_PER_RULE = 3
_MOST = {"error": 20, "warning": 20, "note": 8}
_FRAMES = 8
_NAMES = 5
_NARROW, _LEAST_TITLE = 72, 16
_TITLES: dict[Category, str] = {
    "device": "what the devices say about themselves",
    "protocol": "what breaks the protocol",
    "capture": "what this recording cannot prove",
}


@dataclass(frozen=True, slots=True)
class _Page:
    """The way the report is to be shown."""

    width: int
    everything: bool
    palette: Palette
    utc: bool


def render(
    report: Report, *, width: int = WIDTH, everything: bool = False, palette: Palette = PLAIN, utc: bool = False
) -> str:
    """Write the report in lines of at most `width` columns; commands and frames are longer when they must be.

    Args:
        report: what was found.
        width: columns, 40 at least.
        everything: every run, waived and known findings, bytes, all rules, coverage and limits too.
        palette: colours for a terminal.
        utc: times of day in UTC instead of the local time, by which `--around` goes, too.
    """
    page = _Page(max(width, NARROWEST), everything, palette, utc)
    head = headline.of(report, utc=utc)
    lines = [*_head(report, head, page), ""]
    sections = _sections(report, head, page)
    for category, found in sections:
        lines += [_heading(category, page), *_problems(found, report, page)]
    if unproven := list(_unproven(report, page)):
        lines += unproven if sections and sections[-1][0] == "capture" else [_heading("capture", page), *unproven]
    lines += _events(report, page)
    lines += _foot(report, head, page)
    return "".join(f"{line.rstrip()}\n" for line in lines)


def _head(report: Report, head: Headline, page: _Page) -> Iterator[str]:
    word, gate = head.verdict, report.gate
    lines = wrap(head.summary, page.width, first=f"{word}  ", indent=_INDENT)
    first, *more = right(lines, f"exit {gate.exit_status}", page.width)
    yield page.palette.paint(wording.TONES[head.tone], word) + first[len(word) :]
    yield from more
    below = [head.worst]
    below += [wording.safe(gate.reason)] if gate.exit_status not in (0, 1) else []
    for text in filter(None, [*below, wording.safe(head.ungated)]):
        yield from wrap(text, page.width, first=_INDENT, indent=_INDENT)
    for one in head.happened:
        yield from wrap(f"Triage: {one.text}", page.width, first=_INDENT, indent=_INDENT)
        if one.command:  # to be pasted: never wrapped
            yield f"{_INDENT}        {one.command}"
    several = len(report.captures) > 1
    for capture in report.captures:
        facts = list(_facts(capture, page))
        facts[0] = f"{wording.safe(capture.id)}: {facts[0]}" if several and capture.id != capture.path else facts[0]
        yield from pack(facts, page.width, _INDENT)
    profile = wording.setting(report.settings.get("profile") or "default")
    more_limits = "" if report.settings.get("profile") or not report.settings.get("changed") else ", changed"
    yield from pack([f"limits: {profile}{more_limits}", wording.safe(report.tool)], page.width, _INDENT)
    if window := report.settings.get("window"):
        yield from wrap(f"only {wording.setting(window)}", page.width, first=_INDENT, indent=_INDENT)
    for requirement in gate.requirements:
        answer = "met" if requirement.met else "NOT MET"
        words = [f"{wording.wanted(requirement)}:", f"{answer}, found {wording.safe(requirement.found)}"]
        yield from pack(words, page.width, _INDENT)
    for line in wording.waivers(report):
        yield from wrap(line, page.width, first=_INDENT, indent=_INDENT)


def _facts(capture: CaptureSummary, page: _Page) -> Iterator[str]:
    yield wording.safe(capture.path)
    yield ", ".join(wording.safe(bus.name) for bus in capture.buses[:_NAMES])
    if wording.timed(capture) and capture.start_ns is not None and capture.end_ns is not None:
        yield wording.length(capture.end_ns - capture.start_ns)
    yield f"{wording.plural(capture.frames, 'frame')}, {wording.accounted(capture)}"
    digest = wording.safe(capture.sha256)
    if digest:
        yield f"sha256 {digest if page.everything or len(digest) <= 16 else f'{digest[:8]}...{digest[-4:]}'}"
    first, *more = wording.judged(capture) or [""]
    yield f"can judge: {first or 'nothing'}"
    yield from more
    if capture.damage:
        yield f"DAMAGED: {wording.safe(capture.damage)}"


def _sections(report: Report, head: Headline, page: _Page) -> list[tuple[Category, list[Problem]]]:
    """Return what is found by category; all runs if everything is wanted, else what is open."""
    if page.everything:
        return headline.sections([Problem((run,)) for run in report.findings])
    return headline.sections([one for one in head.problems if one.open])


def _heading(category: Category, page: _Page) -> str:
    return f"{page.palette.paint('head', columns(category.upper(), 8))}  {_TITLES[category]}"


def _unproven(report: Report, page: _Page) -> Iterator[str]:
    for reason, rules in wording.inconclusive(report).items():
        text = f"{wording.safe(reason)}: {', '.join(rules)} INCONCLUSIVE"
        first, *more = wrap(text, page.width, first="note     ", indent=_DETAIL)
        yield page.palette.paint("dim", "note") + first[4:]
        yield from more


def _events(report: Report, page: _Page) -> Iterator[str]:
    """Give what devices did that is no fault."""
    found = wording.events(report)
    if found:
        yield f"{page.palette.paint('head', columns('EVENTS', 8))}  what devices did that breaks no rule"
    captures = wording.captures_by_id(report)
    for one, names in found[: None if page.everything else _MOST["note"]]:
        capture = captures.get(one.capture)
        when = wording.moment(one.place.t_ns, None if capture is None else capture.start_ns, utc=page.utc)
        where = f" in {wording.safe(one.capture)}" if len(report.captures) > 1 else ""
        words = f"{one.rule}  {wording.safe(one.title)}: {names}{where}"
        first, *more = wrap(words, page.width, first="event    ", indent=_DETAIL)
        yield page.palette.paint("dim", "event") + first[5:]
        yield from more
        yield from pack([wording.safe(one.text), f"since {when}"], page.width, _DETAIL)
    if not page.everything and len(found) > _MOST["note"]:
        yield f"{_DETAIL}and {wording.plural(len(found) - _MOST['note'], 'more event')} (--all)"


def _problems(found: Sequence[Problem], report: Report, page: _Page) -> Iterator[str]:
    shown, same, cut = found, dict[str, list[Problem]](), dict[str, int]()
    if not page.everything:
        shown = []
        for one in found:
            of_rule = same.setdefault(f"{one.head.rule} {one.severity}", [])
            if len(of_rule) < _PER_RULE and sum(s.severity == one.severity for s in shown) >= _MOST[one.severity]:
                cut[one.severity] = cut.get(one.severity, 0) + 1
                continue
            of_rule.append(one)
            if len(of_rule) <= _PER_RULE:
                shown.append(one)
    table = _Table(shown, report, page)
    for one in shown:
        yield from table.entry(one)
        of_rule = same.get(f"{one.head.rule} {one.severity}", [])
        if len(of_rule) > _PER_RULE and one is of_rule[_PER_RULE - 1]:
            rest = of_rule[_PER_RULE:]
            names = list(dict.fromkeys(wording.place(other.head) for other in rest))
            text = f"and {len(rest)} more of {one.head.rule}: {', '.join(names[:_NAMES])}"
            yield from wrap(
                f"{text}{', ...' if len(names) > _NAMES else ''} (--all)", page.width, first=_DETAIL, indent=_DETAIL
            )
    if cut:
        yield f"{_DETAIL}and {', '.join(wording.plural(n, f'more {severity}') for severity, n in cut.items())} (--all)"


class _Table:
    """The lines of problems, in columns that are as wide as all of them need."""

    def __init__(self, shown: Sequence[Problem], report: Report, page: _Page) -> None:
        self.page = page
        self.captures = wording.captures_by_id(report)
        self.buses = wording.several_buses(report)
        self.days = {c.id: _days(c, utc=page.utc) for c in report.captures}
        self.several = len(report.captures) > 1
        self.rule = max((len(one.head.rule) for one in shown), default=0)
        self.count = max((len(wording.counted(one)) for one in shown), default=0)
        self.time = max((len(self._span(one)) for one in shown), default=0)
        widest = max((display_width(self._place(one)) for one in shown), default=0)
        room = page.width - 9 - self.rule - self.count - self.time - 4 * len(GAP)
        self.place = min(widest, max(room // 2, 8))
        self.narrow = page.width < _NARROW and room - widest < _LEAST_TITLE
        longest = max((display_width(wording.safe(one.head.title)) for one in shown), default=0)
        self.title = max(min(room - self.place, longest), 8)

    def entry(self, one: Problem) -> Iterator[str]:
        """Give all lines about a problem."""
        head, page = one.head, self.page
        if self.narrow:
            yield from self._narrow(one)
            return
        where = columns(fit(self._place(one), self.place), self.place)
        title, *more = wrap(wording.safe(head.title), self.title) if head.title else [""]
        tail = f"{wording.counted(one):>{self.count}}{GAP}{self._span(one)}"
        start = f"{one.severity:<8} {wording.safe(head.rule):<{self.rule}}{GAP}{where}{GAP}"
        line = f"{start}{columns(title, self.title)}{GAP}{tail}"
        yield page.palette.paint(wording.STYLES[one.severity], one.severity) + line[len(one.severity) :]
        for rest in more:
            yield " " * display_width(start) + rest
        yield from self._below(one, self._details(one))

    def _narrow(self, one: Problem) -> Iterator[str]:
        """Put title, count and time below, so that nobody's number is cut."""
        start = f"{one.severity:<8} {wording.safe(one.head.rule)}{GAP}"
        line = start + fit(self._place(one), max(self.page.width - display_width(start), 8))
        yield self.page.palette.paint(wording.STYLES[one.severity], one.severity) + line[len(one.severity) :]
        facts = (wording.safe(one.head.title), wording.counted(one), self._span(one))
        yield from self._below(one, (*facts, *self._details(one)))

    def _below(self, one: Problem, details: Iterable[str]) -> Iterator[str]:
        page, head = self.page, one.head
        show = wording.command(one, self.captures.get(head.capture))
        yield from pack(details, page.width, _DETAIL, whole=show)
        if page.everything:
            for example in one.examples:
                if example.text != head.text:
                    yield from wrap(wording.safe(example.text), page.width, first=_DETAIL, indent=_DETAIL)
                yield from (page.palette.paint("payload", _BYTES + wording.safe(line)) for line in example.lines)

    def _place(self, one: Problem) -> str:
        where = wording.places(one, bus=self.buses)
        return f"{where} in {wording.safe(one.head.capture)}" if self.several else where

    def _details(self, one: Problem) -> Iterator[str]:
        head = one.head
        yield wording.told(one)
        if head.type:
            yield wording.safe(head.type)
        if one.baseline:
            yield {"new": "new", "worse": "worse than before", "known": "known"}[one.baseline]
        if one.waiver is not None:
            reason, owner = wording.safe(one.waiver.reason), wording.safe(one.waiver.owner)
            yield f"waived until {wording.safe(one.waiver.expires)} by {owner}: {reason}"
        if one.severity == "error" or self.page.everything:
            frames = list(one.frames) if self.page.everything else one.frames[:_FRAMES]
            if len(one.frames) > 1:
                yield f"frames {' '.join(map(str, frames))}{' ...' if len(frames) < len(one.frames) else ''}"
        if head.clause not in ("", "-"):
            yield f"clause {wording.safe(head.clause)}"

    def _span(self, one: Problem) -> str:
        capture = self.captures.get(one.head.capture)
        zero, day = (None if capture is None else capture.start_ns), self.days.get(one.head.capture, "")
        first, last, utc = one.first.t_ns, one.last.t_ns, self.page.utc
        if first is None or last is None or first == last:
            return wording.moment(first, zero, utc=utc, form=f"{day}%H:%M:%S")
        long = last - first >= 3600 * SECOND
        form = f"{day}%H:%M" if long else f"{day}%H:%M:%S"
        start, end = (wording.moment(t, zero, utc=utc, form=form, ms=False) for t in (first, last))
        if start.endswith(" s"):
            return f"{start[:-2]}..{end}"
        if start == end:
            return wording.moment(first, zero, utc=utc, form=f"{day}%H:%M:%S")
        return f"{start}..{end[-2:] if start[:-2] == end[:-2] and not long else end}"


def _days(capture: CaptureSummary, *, utc: bool) -> str:
    """Return the date in front of a time, in a capture of several days."""
    day = {wording.moment(t, None, utc=utc, form="%Y-%m-%d", ms=False) for t in (capture.start_ns, capture.end_ns)}
    return "%m-%d " if len(day) > 1 else ""


def _foot(report: Report, head: Headline, page: _Page) -> Iterator[str]:
    found = head.problems
    shown = found if page.everything else [one for one in found if one.open]
    if report.rules:
        yield from pack([f"Rules {len(report.rules)}:", *wording.verdict_counts(report)], page.width, "")
    if page.everything:
        yield from inventory(report, page.width, page.palette)
        return
    numbers = wording.limits(report, [one.head.rule for one in shown])
    if numbers:
        yield from pack(["Limits used:", *numbers], page.width, "")
    hidden = [
        f"{count} {what}"
        for count, what in (
            (sum(one.waiver is not None for one in found), "waived"),
            (sum(one.waiver is None and not one.open for one in found), "known from the baseline"),
        )
        if count
    ]
    if hidden:
        yield from wrap(f"Not shown: {', '.join(hidden)} (--all)", page.width)
    rule = f"explain {wording.safe(headline.worst(shown).head.rule)} | " if shown else ""
    yield from wrap(f"See: tailbyte {rule}check --all | --html FILE", page.width)
