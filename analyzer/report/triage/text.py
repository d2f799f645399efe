"""The screen of triage: what broke first, why, what came after, what is ruled out, what to do next; 80 x 24."""

from __future__ import annotations

from itertools import chain, zip_longest
from textwrap import wrap
from typing import TYPE_CHECKING

from analyzer.report.triage.words import TriageWords, odd_who, together
from analyzer.views.terminal import PLAIN, display_width, escape, fit
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analyzer.flight.log import FlightEvent
    from analyzer.flight.verdict.model import Triage, Verdict
    from analyzer.views.terminal import Palette

_LABEL, _NAME = 11, 10
LINES = 24
_SAID, _AFTER, _EARLIER, _ODD, _SEEN = 4, 3, 2, 2, 6
_STATS = "tailbyte stats odd"


def render(
    found: Triage, *, width: int = 80, everything: bool = False, story: bool = False, palette: Palette = PLAIN,
    utc: bool = False,
) -> str:  # fmt: skip
    """Return the screen, or with `story` every event; `everything` leaves nothing out that does not fit."""
    screen = _Screen(found, width, everything=everything, palette=palette, utc=utc)
    return "".join(f"{line}\n" for line in (screen.story() if story else screen.lines()))


class _Screen:
    """Writes it with at most `width` columns."""

    def __init__(self, found: Triage, width: int, *, everything: bool, palette: Palette, utc: bool) -> None:
        self._found, self._width, self._all, self._palette = found, max(width, 60), everything, palette
        self._words = TriageWords(found, utc=utc)

    def lines(self) -> Iterator[str]:
        """Yield the lines."""
        found = self._found
        yield from self._head()
        yield from self._verdict(found.first, "What broke first")
        below = self._said, self._others, self._after, self._excluded, self._looked, self._odd, self._earlier
        closing = [*self._seen(), *self._next()]
        room = LINES - 1 - len(list(self._head())) - len(list(self._verdict(found.first, ""))) - len(closing)
        for part in below:
            for row in part():
                if len(row) > room and not self._all:
                    break
                room -= len(row)
                yield from row
        yield from closing

    def story(self) -> Iterator[str]:
        """Yield every event in a line, those that began it marked."""
        found = self._found
        yield from self._head()
        for one, whose in together(found.events):
            mark = "*" if any(one is first for first in found.primary) else " "
            text = f"{mark}{self._words.time(one.first.t)}  {f'{whose:<8}'} {one.kind}: {one.text}"
            first, *rest = wrap(escape(text), self._width, subsequent_indent=" " * 24) or [""]
            yield self._palette.paint("bad", first) if mark == "*" else first
            yield from rest
        if found.more:
            yield f"{found.more} more that are like these"

    def _head(self) -> Iterator[str]:
        found = self._found
        count = len(found.flights)
        flights = "no flight" if not count else "1 flight" if count == 1 else f"{count} flights"
        if found.flight is not None and found.flight.by == "arming":
            armed = round((found.flight.last.ran - found.flight.first.ran) / SECOND)
            flights = f"{'last ' if count > 1 else ''}armed {armed} s (ArmingStatus)"
        elif found.flight is not None:
            how = found.ending(found.flight)
            flights += f", {how}" if count == 1 else f", last: {how.removeprefix('motors ')}"
        behind = f"  {self._words.span(found)}  {', '.join(map(escape, found.buses))}  {flights}"
        name = ", ".join(map(escape, found.captures))
        if display_width(name) + display_width(behind) > self._width:
            name = ", ".join(escape(one.rpartition("/")[2]) for one in found.captures)
        room = max(_NAME, self._width - display_width(behind))
        yield f"{fit(name, room)}{fit(behind, self._width - _NAME)}"
        for label, text in found.lines:
            yield from self._row(label, text)

    def _verdict(self, one: Verdict, label: str) -> Iterator[str]:
        style = "bad" if one.told else "good" if self._found.well else "note"
        text = escape(one.title)
        support = one.support if one.told else "" if self._found.judged or one.kind != "none" else '(not "healthy")'
        room = self._width - len(label) - 2
        first, *rest = wrap(text, room - len(support) - 2) or [""]
        gap = max(2, room - len(first) - len(support)) if support else 0
        yield f"{self._palette.paint('head', label)}  {self._palette.paint(style, first)}{' ' * gap}{support}".rstrip()
        yield from (f"{' ' * (len(label) + 2)}{self._palette.paint(style, line)}" for line in rest)
        if when := self._words.when(one):
            yield from self._row(" at", when)
        if one.told:
            yield from chain.from_iterable(self._rows(" for", one.reasons))
            yield from chain.from_iterable(self._rows(" against", one.against or ("nothing found",)))
        for label_, text in one.notes:
            yield from self._row(f" {label_}", text)

    def _said(self) -> Iterator[list[str]]:
        """Yield what the autopilot's log says around it."""
        log = self._found.autopilot
        if log is not None and log["parts"]:
            yield from self._events("Autopilot", self._found.said, _SAID, " around it, of the autopilot's log")
            if not self._found.said:
                yield [*self._row("Autopilot", "its log says nothing within 5 s of it")]

    def _others(self) -> Iterator[list[str]]:
        told = " ".join(text for _, text in self._found.first.notes)
        for one in [one for one in self._found.verdicts[1:] if one.title not in told][:2]:
            yield [*self._row("Then, or", f"{self._words.time(one.t_end)}  {one.title} ({one.support})")]

    def _after(self) -> Iterator[list[str]]:
        yield from self._events("After it", self._found.after, _AFTER, "  (consequences: not used as causes)")

    def _earlier(self) -> Iterator[list[str]]:
        label, most = ("Seen", _SEEN) if self._found.flight is None else ("Earlier", _EARLIER)
        yield from self._events(label, self._found.earlier, most, "")

    def _odd(self) -> Iterator[list[str]]:
        """Yield which ESCs were odd before, and of a flight without a fault what groups of them have in common."""
        found = self._found
        if found.judged:
            return
        label = "Odd before" if found.first.told else "Notes"
        told = [f"{odd_who(one)} {one.text if self._all else one.gist}" for one in found.odd_before]
        shown = told if self._all else told[:_ODD]
        rest = f"{len(told) - len(shown)} more odd ESCs" if len(told) > len(shown) else ""
        facts = [] if found.first.told and not self._all else found.facts
        lines = [*shown, *filter(None, [rest])]
        for number, text in enumerate((*lines, *facts)):
            last = lines and number == len(lines) - 1
            room = self._width - _LABEL - display_width(text) - len(_STATS) - 2
            more = f"{' ' * (room + 2)}{_STATS}" if last and room >= 0 else ""
            rows = list(self._row(label if not number else "", text))
            yield [*rows[:-1], rows[-1] + more]

    def _events(self, label: str, events: Sequence[FlightEvent], most: int, note: str) -> Iterator[list[str]]:
        told = list(together(events))
        shown = told if self._all else told[:most]
        for number, (one, whose) in enumerate(shown):
            text = f"{self._words.time(one.first.t)}  {whose + ' ' if whose else ''}{one.kind}: {one.text}"
            yield [fit(f"{label if not number else '':<{_LABEL}}{escape(text)}", self._width)]
        if len(told) > len(shown):
            yield [f"{'':<{_LABEL}}{len(told) - len(shown)} more{note}"]

    def _excluded(self) -> Iterator[list[str]]:
        rows = [f"{one.fact}: {one.seen}" for one in self._found.excluded]
        yield from self._rows("Ruled out", rows)

    def _looked(self) -> Iterator[list[str]]:
        if self._found.looked and (not self._found.first.told or self._all):
            yield [*self._row("Looked at", "; ".join(self._found.looked))]

    def _seen(self) -> Iterator[str]:
        if self._found.not_seen:
            more = "" if self._found.autopilot is not None else ".  Add --with flight.bin"
            yield from self._row("Not on CAN", f"{', '.join(self._found.not_seen)}{more}")

    def _next(self) -> Iterator[str]:
        for label, command in zip(
            ("Next", "", ""), self._found.commands, strict=False
        ):  # to be pasted: never cut, never wrapped
            yield f"{self._palette.paint('head', f'{label:<{_LABEL}}')}{escape(command)}"
        if not self._all:
            more = f"-- all {len(self._found.events)} events: --story; everything: --all; words: tailbyte help triage"
            yield self._palette.paint("dim", fit(more, self._width))

    def _rows(self, label: str, texts: Iterable[str]) -> Iterator[list[str]]:
        for number, text in enumerate(texts):
            yield [*self._row(label if not number else "", text)]

    def _row(self, label: str, text: str) -> Iterator[str]:
        indent = " " if label.startswith(" ") else ""
        labels = wrap(label.strip(), _LABEL - 1, initial_indent=indent, subsequent_indent=" ")
        lines = wrap(escape(text), self._width - _LABEL, break_on_hyphens=False)
        for name, line in zip_longest(labels or [""], lines or [""], fillvalue=""):
            yield f"{self._palette.paint('head', f'{name:<{_LABEL}}')}{line}".rstrip()
