"""The differences as text for people: what is different, worst first, with both sides' numbers and how sure it is."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from analyzer.report.comparison.rows import earliest, evidence, headline, name, rows, since, tone
from analyzer.report.lines import NARROWEST, columns, pack, right, wrap
from analyzer.report.moments import on_calendar
from analyzer.report.wording import STYLES, TONES, length, moment, plural, safe
from analyzer.views.terminal import PLAIN, Palette, display_width, fit
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analyzer.report.comparison.model import CaptureDiff, Compared, Side
    from analyzer.report.comparison.rows import DifferenceRow

WIDTH = 80
_INDENT = " " * 9
_WEIGHT = 9
HEIGHT = 24  # of a screen
_FEWEST = 2  # rows, however small the screen
_NAMED = 6  # rows that are left out
_SHORTEST = 24  # columns in which a remark is worth its beginning
_COMMANDS = 3  # rows with the command that shows them
_WIDEST = {"who": 14, "value": 13, "since": 12}
_NARROW = 66  # columns below which both values stand in a line of their own
_ALL = " (--all)"


@dataclass(frozen=True, slots=True)
class _Sheet:
    """The way it is to be shown."""

    width: int
    height: int
    everything: bool
    palette: Palette
    utc: bool


def render(
    of: CaptureDiff, *, width: int = WIDTH, height: int = HEIGHT, everything: bool = False, palette: Palette = PLAIN,
    utc: bool = False,
) -> str:  # fmt: skip
    """Write the differences in lines of at most `width` columns; commands are longer when they must be.

    Args:
        of: what was found.
        width: columns, 40 at least.
        height: lines of the screen that it should fit; at least two differences are shown.
        everything: every difference by itself, limits and matched nodes too.
        palette: colours for a terminal.
        utc: times of day in UTC instead of the local time.
    """
    sheet = _Sheet(max(width, NARROWEST), height, everything, palette, utc)
    head, foot = list(_head(of, sheet)), list(_foot(of, sheet))
    lines = [*head, *_table(of, sheet, height - len(head) - len(foot) - 1), *foot]
    return "".join(f"{line.rstrip()}\n" for line in lines)


def _head(of: CaptureDiff, sheet: _Sheet) -> Iterator[str]:
    word, summary = headline(of)
    lines = wrap(summary, sheet.width, first=f"{word}  ", indent=_INDENT)
    if of.fail_on:
        lines = right(lines, "fails" if of.failed else "does not fail", sheet.width)
    yield sheet.palette.paint(TONES[tone(of)], word) + lines[0][len(word) :]
    yield from lines[1:]
    for word, side in (("good", of.good), ("bad", of.bad)):
        first, *more = pack(_facts(side, sheet), sheet.width, _INDENT)
        yield columns(word, len(_INDENT)) + first[len(_INDENT) :]
        yield from more
    for text in of.remarks:
        yield from wrap(safe(text), sheet.width, first=_INDENT, indent=_INDENT)
    one = earliest(of)
    if one is not None:
        when = since(one, of.bad.start_ns, utc=sheet.utc)
        words = [when, f"{name(one)}: {safe(one.what)}"]
        yield columns("first", len(_INDENT)) + fit("  ".join(words), sheet.width - len(_INDENT))
        if one.command and one not in [row.head for row in rows(of.differences)[:_COMMANDS]]:
            yield _INDENT + one.command


def _facts(side: Side, sheet: _Sheet) -> Iterator[str]:
    yield safe(side.path)
    if side.start_ns is not None and side.end_ns is not None and side.can_judge.get("timing") != "no":
        if on_calendar(side.start_ns):
            yield moment(side.start_ns, None, utc=sheet.utc, form="%Y-%m-%d %H:%M:%S", ms=False)
        yield length(side.end_ns - side.start_ns)
    yield plural(side.nodes, "node")
    if sheet.everything:
        yield plural(side.frames, "frame")
    if side.lost:
        yield f"{side.lost} transfers lost"
    if side.damage:
        yield f"DAMAGED: {safe(side.damage)}"


def _table(of: CaptureDiff, sheet: _Sheet, room: int) -> Iterator[str]:
    """Give the rows, and of those that have no room who they are about."""
    found = rows(of.differences, everything=sheet.everything)
    if not found:
        return
    form, entries = _Form(found, of, sheet), list[list[str]]()
    for k, row in enumerate(found):
        entry = list(form.entry(row, command=sheet.everything or k < _COMMANDS))
        if not sheet.everything and k >= _FEWEST and sum(map(len, entries)) + len(entry) > room - (k + 1 < len(found)):
            break
        entries.append(entry)
    yield form.title()
    for entry in entries:
        yield from entry
    if rest := found[len(entries) :]:
        counts = Counter(f"{row.head.weight} {row.head.kind}" for row in rest)
        names = [f"{kind}{f' {count}x' if count > 1 else ''}" for kind, count in counts.items()]
        text = f"and {len(rest)} more: {', '.join(names[:_NAMED])}{', ...' if len(names) > _NAMED else ''}"
        yield _INDENT + fit(text, sheet.width - len(_INDENT) - len(_ALL)) + _ALL


class _Form:
    """The columns of the table, as wide as its rows need."""

    def __init__(self, shown: Sequence[DifferenceRow], of: CaptureDiff, sheet: _Sheet) -> None:
        self.sheet, self.of = sheet, of
        self.who = min(max(display_width(row.who) for row in shown), _WIDEST["who"])
        self.good, self.bad = (_room(row.head.good for row in shown), _room(row.head.bad for row in shown))
        whens = [since(row.head, of.bad.start_ns, utc=sheet.utc) for row in shown]
        self.since = max(display_width(text) for text in [*whens, "Since"])
        self.narrow = sheet.width < _NARROW
        used = _WEIGHT + self.who + 2 + (0 if self.narrow else self.good + self.bad + 6 + self.since)
        self.what = max(sheet.width - used, 12)

    def title(self) -> str:
        """Return the line above the rows."""
        cells = [columns("", _WEIGHT), columns("Who", self.who + 2), columns("What", self.what)]
        if not self.narrow:
            cells += ["  ", columns("Good", self.good + 2), columns("Bad", self.bad + 2), "Since"]
        return self.sheet.palette.paint("head", "".join(cells).rstrip())

    def entry(self, row: DifferenceRow, *, command: bool) -> Iterator[str]:
        """Give all lines about a row."""
        one, sheet = row.head, self.sheet
        good, bad, when = safe(one.good), safe(one.bad), since(one, self.of.bad.start_ns, utc=sheet.utc)
        inline = not self.narrow and display_width(good) <= self.good and display_width(bad) <= self.bad
        text = safe(one.what)
        text = _breakable(text) if display_width(text) > self.what else text
        who, what = wrap(row.who, self.who), wrap(text, self.what)
        for k in range(max(len(who), len(what))):
            cells = [columns(one.weight if not k else "", _WEIGHT)]
            cells += [columns(who[k] if k < len(who) else "", self.who + 2)]
            cells += [columns(what[k] if k < len(what) else "", self.what)]
            if not k and not self.narrow:
                values = (good, bad) if inline else ("", "")
                cells += ["  ", columns(values[0], self.good + 2), columns(values[1], self.bad + 2), when]
            line = "".join(cells)
            yield sheet.palette.paint(STYLES[one.weight], one.weight) + line[len(one.weight) :] if not k else line
        pieces = [] if inline else [f"{good} -> {bad}"]
        pieces += [*([when] if self.narrow and when else []), *evidence(one), row.more]
        if sheet.everything or self.narrow:
            yield from pack([*pieces, safe(one.remark)], sheet.width, _INDENT, whole=one.command)
            return
        line = fit("  ".join(filter(None, pieces)), sheet.width - len(_INDENT))
        room = sheet.width - len(_INDENT) - display_width(line) - 2
        remark = safe(one.remark)
        if remark and room >= min(_SHORTEST, display_width(remark)):
            line = f"{line}  {fit(remark, room)}"
        yield from pack([line], sheet.width, _INDENT, whole=one.command if command else "")


def _room(texts: Iterable[str]) -> int:
    """Return the columns that values need; those that are too long stand elsewhere."""
    sizes = (display_width(safe(text)) for text in texts)
    return max([size for size in sizes if size <= _WIDEST["value"]] + [len("Good")])


def _breakable(text: str) -> str:
    """Return a dotted name with a blank behind its first part, where a line may end."""
    outer, dot, inner = text.partition(".")
    return f"{outer}{dot} {inner}" if dot and " " not in text else text


def _named(one: Compared) -> str:
    """Write `1 node`, `4 ESCs at equal command`."""
    noun, gap, rest = one.what.partition(" at ")
    return f"{plural(one.count, noun.removesuffix('s'))}{gap}{rest}"


def _foot(of: CaptureDiff, sheet: _Sheet) -> Iterator[str]:
    yield ""
    parts = [f"{_named(one)}{f' ({one.detail})' if one.detail else ''}" for one in of.compared]
    yield from wrap(", ".join(parts) or "nothing", sheet.width, first="Compared ", indent=_INDENT)
    if of.cannot:
        yield from wrap("; ".join(map(safe, of.cannot)), sheet.width, first="Cannot   ", indent=_INDENT)
    if not sheet.everything:
        return
    for k, one in enumerate(one for one in of.matched if (one.bus, one.node) != (one.bad_bus, one.bad_node)):
        text = f"{safe(one.bus)} node {one.node} is {safe(one.bad_bus)} node {one.bad_node}, by {one.reason}"
        yield from wrap(text, sheet.width, first="Matched  " if not k else _INDENT, indent=_INDENT)
    numbers = [f"{name}={value:g}" for name, value in of.limits.items()]
    yield from wrap(" ".join(numbers), sheet.width, first="Limits   ", indent=_INDENT)
