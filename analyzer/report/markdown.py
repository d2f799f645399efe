"""The report as Markdown, for a comment on a merge request: a table, and details that open.

Everything but plain words of ASCII stands in code spans, where neither markup nor links nor mentions exist; what could
end a code span or a table cell is written as an escape.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from analyzer.report import headline, wording
from analyzer.report.problems import ranked
from analyzer.views.terminal import ELLIPSIS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.report.headline import Headline
    from analyzer.report.model import CaptureSummary, DeviceEvent, Report, Requirement
    from analyzer.report.problems import Problem

COMMENT_BYTES = 60_000  # GitHub takes 65,536 characters
_LONGEST = 300
_COLUMNS = "| | Rule | Where | What | Count | First |\n|---|---|---|---|---:|---|\n"
_DETAILED = 20
_LINES = 20
_SIGNS = {"error": "❌", "warning": "⚠️", "note": "ℹ️"}  # noqa: RUF001 - the sign for information is meant
_TONES = {"good": "🟢", "caution": "🟠", "bad": "🔴", "idle": "⚪"}
PICTURES = frozenset("".join((*_SIGNS.values(), *_TONES.values())))  # what a plain font has no letters for
_PLAIN = re.compile(r"[A-Za-z0-9(][A-Za-z0-9 ,;()'./-]*")
# Words that a forge makes a link of by itself: addresses, issues, commits.
_LINKED = re.compile(r"www\.|//|\bgh-\d|[0-9a-f]{7}", re.IGNORECASE)
_CODE = str.maketrans({"`": r"\x60", "|": r"\x7c"})


def code(text: str) -> str:
    """Write text from anywhere as a code span that is safe in a table cell, too."""
    text = _short(wording.safe(text)).translate(_CODE)
    return f"`{text}`" if text.strip() else ""


def plain(text: str) -> str:
    """Write text as it is if it is only words, else as `code`."""
    harmless = _PLAIN.fullmatch(text) and not _LINKED.search(text) and len(text) <= _LONGEST
    return text if harmless else code(text)


def render(report: Report, limit: int = COMMENT_BYTES) -> str:
    """Write Markdown of at most `limit` bytes of UTF-8 (1,000 at least); what has no room is counted."""
    first = headline.of(report)
    found = ranked(first.problems)
    shown = [one for one in found if one.open]
    rest = [one for one in found if not one.open]
    head, tail = _join(_head(report, first)), _join(_tail(report))
    share = (limit - _size(head) - _size(tail)) // 8
    needs = _fitting("", list(map(_requirement, report.gate.requirements)), "\n", share)
    needs += _fitting("", [f"- {plain(line)}\n" for line in wording.waivers(report)], "\n", share)
    captures = _fitting("", list(map(_capture, report.captures)), "", share)
    events = _fitting("", [_event(one, names) for one, names in wording.events(report)], "\n", share)
    reasons = _fitting("", [_reason(*item) for item in wording.inconclusive(report).items()], "", share)
    room = limit - sum(map(_size, (head, needs, captures, events, reasons, tail)))
    table = _fitting(_COLUMNS, [_row(one, report) for one in shown], "\n", room)
    room -= _size(table)
    start = f"<details><summary>Evidence of {wording.plural(len(shown), 'finding')}</summary>\n\n"
    blocks = [_evidence(one, report) for one in shown[:_DETAILED]]
    details = _fitting(start, blocks, "\n</details>\n\n", room, len(shown) - len(blocks))
    start = f"<details><summary>{wording.plural(len(rest), 'finding')} waived or known</summary>\n\n"
    excused = _fitting(start, list(map(_excuse, rest)), "\n</details>\n\n", room - _size(details))
    return head + needs + table + details + excused + events + captures + reasons + tail


def _join(lines: Iterable[str]) -> str:
    return "".join(f"{line}\n" for line in lines)


def _size(text: str) -> int:
    return len(text.encode())


def _fitting(start: str, blocks: list[str], end: str, room: int, hidden: int = 0) -> str:
    """Give as many blocks as there is room for, and the number of the others; nothing if there are none."""
    if not blocks:
        return ""
    room -= _size(start) + _size(end) + _size(_left(len(blocks) + hidden))
    if room < 0:
        return ""
    written = 0
    while written < len(blocks) and _size(blocks[written]) <= room:
        room -= _size(blocks[written])
        written += 1
    return start + "".join(blocks[:written]) + _left(len(blocks) - written + hidden) + end


def _left(count: int) -> str:
    return f"\nand {count} more, see the JSON report\n" if count else ""


def _head(report: Report, first: Headline) -> Iterator[str]:
    yield f"### {_TONES[first.tone]} tailbyte check: {first.verdict}"
    yield ""
    yield plain(first.summary)
    if first.worst:
        yield ""
        yield f"Worst: {plain(first.worst)}"
    for one in first.happened:
        yield ""
        yield f"Triage: {plain(one.text)}" + (f": {code(one.command)}" if one.command else "")
    if report.gate.reason:
        yield ""
        yield f"Gate: {plain(report.gate.reason)}"
    if first.ungated:
        yield ""
        yield plain(first.ungated)
    yield ""


def _requirement(requirement: Requirement) -> str:
    answer = "met" if requirement.met else "**not met**"
    word = "expects" if requirement.expected else "requires"
    return f"- {word} {plain(requirement.what)}: {answer}, found {plain(requirement.found)}\n"


def _row(one: Problem, report: Report) -> str:
    head = one.head
    capture = wording.captures_by_id(report).get(head.capture)
    where = [plain(wording.places(one, bus=wording.several_buses(report))), plain(head.type)]
    if len(report.captures) > 1:
        where.append(f"in {code(head.capture if capture is None else capture.path)}")
    start = None if capture is None else capture.start_ns
    what = " ".join(filter(None, [plain(head.title), f"**{one.baseline}**" if one.baseline else ""]))
    cells = [
        f"{_SIGNS[one.severity]} {f'**{one.severity}**' if one.fails else one.severity}",
        plain(head.rule),
        " ".join(filter(None, where)),
        what,
        str(one.count),
        wording.full_moment(one.first.t_ns, start),
    ]
    return f"| {' | '.join(cells)} |\n"


def _evidence(one: Problem, report: Report) -> str:
    head = one.head
    lines = [
        f"**{plain(head.rule)}** {plain(wording.places(one, bus=True))}: {code(wording.told(one)) or plain(head.title)}"
    ]
    facts = [plain(head.cause), "" if head.clause in ("", "-") else f"clause {plain(head.clause)}"]
    facts += [f"frames {' '.join(map(str, one.frames))}" if one.frames else ""]
    lines += [", ".join(filter(None, facts)), ""]
    block = [wording.command(one, wording.captures_by_id(report).get(head.capture))]
    block += [_short(wording.safe(line)) for example in one.examples[:1] for line in example.lines[:_LINES]]
    return _join([*lines, "```", *(line.replace("`", r"\x60") for line in block), "```", ""])


def _excuse(one: Problem) -> str:
    head, waiver = one.head, one.waiver
    why = "known from the baseline"
    if waiver is not None:
        why = f"waived until {plain(waiver.expires)} by {plain(waiver.owner)}: {plain(waiver.reason)}"
    return f"- {plain(head.rule)} {plain(wording.places(one, bus=True))} {plain(head.type)} {one.count}x, {why}\n"


def _event(one: DeviceEvent, names: str) -> str:
    return f"- event {plain(one.rule)} {plain(one.title)}, {plain(names)}: {plain(one.text)}\n"


def _capture(capture: CaptureSummary) -> str:
    facts = [code(capture.path), f"{wording.plural(capture.frames, 'frame')}, {wording.accounted(capture)}"]
    facts += [f"SHA-256 {code(capture.sha256)}", f"can judge: {code(', '.join(wording.judged(capture))) or 'nothing'}"]
    if capture.damage:
        facts.append(f"**damaged**: {code(capture.damage)}")
    return f"- {', '.join(facts)}\n"


def _reason(reason: str, rules: list[str]) -> str:
    return f"- {plain(reason)}: {', '.join(map(plain, rules))} inconclusive\n"


def _tail(report: Report) -> Iterator[str]:
    if report.rules:
        yield f"- {wording.plural(len(report.rules), 'rule')}: {', '.join(wording.verdict_counts(report))}"
    if window := report.settings.get("window"):
        yield f"- only {code(wording.setting(window))}"
    yield f"- limits: {plain(wording.setting(report.settings.get('profile') or 'default'))}, by {plain(report.tool)}"


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + ELLIPSIS
