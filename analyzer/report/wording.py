"""Words that all formats share: places, times, commands, counts."""

from __future__ import annotations

import re
import shlex
from collections import Counter
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from analyzer.report.model import VERDICTS
from analyzer.report.moments import on_calendar
from analyzer.views.terminal import escape
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analyzer.report.model import CaptureSummary, DeviceEvent, Finding, Report, Requirement, WaiverUse
    from analyzer.report.problems import Problem

# Styles of a palette, by severity and by the tone of a headline.
STYLES = {"error": "bad", "warning": "note", "note": "dim"}
TONES = {"good": "good", "caution": "note", "bad": "bad", "idle": "dim"}
_NEAR = 5  # frames to each side, where no time says what is near
_MARGIN = "+-50ms"
_NAMED = 4
_MOST_NAMED = 8  # devices of an event
_BROKEN = ("FAIL", "WARN", "WAIVED", "KNOWN")
_UNITS = ((10**9, "GB"), (10**6, "MB"), (10**3, "kB"))  # as conditions of a recording have them
_COMMANDS = re.compile(r"#(#)(?=\w*\[)|:(:)(?=\w)")  # how commands to CI services begin in their logs
_HARMLESS = re.compile(r"[\w%+,./:=@^-]+", re.ASCII)


def safe(text: str) -> str:
    """Return one line of text from anywhere, harmless on a terminal and in the log of a CI service."""
    return _COMMANDS.sub(lambda found: rf"{found[0][0]}\x{ord(found[0][0]):02x}", escape(text))


def plural(count: int, noun: str) -> str:
    """Write `1 error`, `2 errors`."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def size(count: int) -> str:
    """Write a number of bytes in words."""
    for unit, name in _UNITS:
        if count >= unit:
            return f"{count / unit:.1f} {name}"
    return f"{count} bytes"


def captures_by_id(report: Report) -> dict[str, CaptureSummary]:
    """Return the captures that findings name."""
    return {capture.id: capture for capture in report.captures}


def place(finding: Finding | DeviceEvent, *, bus: bool = False) -> str:
    """Say who it was: `ch6 node 25`, or the interface alone; `bus` says that there are several to tell apart."""
    words = [safe(finding.label)] if finding.label else []
    if finding.node is not None:
        words.append(f"node {finding.node}")
    if finding.bus and (bus or not words):
        words.append(safe(finding.bus))
    return " ".join(words) or "bus"


def places(one: Problem, *, bus: bool = False) -> str:
    """Say who a problem is about: `ch6 node 25`, or the first of many: `ch1 ch2 ch3 and 9 more`."""
    names = one.places
    if len(names) == 1:
        return place(one.head, bus=bus)
    words = [*map(safe, names[:_NAMED]), f"and {len(names) - _NAMED} more" if len(names) > _NAMED else ""]
    words.append(safe(one.head.bus) if bus else "")
    return " ".join(filter(None, words))


def events(report: Report) -> list[tuple[DeviceEvent, str]]:
    """Return the first of each events that several devices had together, and who they were: `ch1, ch2 and 3 more`."""
    alike: dict[tuple[str, ...], list[DeviceEvent]] = {}
    for one in report.events:
        alike.setdefault((one.capture, one.bus, one.rule, one.text), []).append(one)
    found = []
    for some in alike.values():
        names = list(dict.fromkeys(place(one, bus=several_buses(report)) for one in some))
        more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
        found.append((some[0], ", ".join(names[:_MOST_NAMED]) + more))
    return found


def told(one: Problem) -> str:
    """Write what is wrong in a line: of several nodes who that is, unless it is the same for all."""
    head = one.head
    cause, text = safe(head.cause), safe(head.text)
    words = f"{cause}: {text}" if cause and text and cause not in text else text or cause
    alike = len({run.text for run in one.runs}) == 1
    return words if alike or len(one.places) == 1 or not words else f"{safe(one.places[0])}: {words}"


def several_buses(report: Report) -> bool:
    """Return True if the name of an interface says anything."""
    return len({bus.name for capture in report.captures for bus in capture.buses}) > 1


def counted(problem: Problem) -> str:
    """Write `3x`."""
    return f"{problem.count}x"


def moment(t: int | None, start: int | None, *, utc: bool = True, form: str = "%H:%M:%S", ms: bool = True) -> str:
    """Write a time of day, or seconds from `start` in a capture whose times have no date; `-` without a time."""
    if t is None:
        return "-"
    if on_calendar(t):
        when = datetime.fromtimestamp(t // SECOND, UTC)
        text = (when if utc else when.astimezone()).strftime(form)
        return text + (f".{t % SECOND // 1_000_000:03d}" if ms else "")
    since = t - (start or 0)
    sign = "-" if since < 0 else ""
    return f"{sign}{abs(since) // SECOND}.{abs(since) % SECOND // 1_000_000:03d} s"


def full_moment(t: int | None, start: int | None) -> str:
    """Write date and time, the same on every machine."""
    text = moment(t, start, form="%Y-%m-%d %H:%M:%S")
    return f"{text} UTC" if t is not None and on_calendar(t) else text


def length(ns: int) -> str:
    """Write a length of time in its two largest units."""
    seconds, rest = divmod(max(ns, 0), SECOND)
    if seconds < 60:
        return f"{seconds}.{rest // 1_000_000:03d} s"
    minutes, seconds = divmod(seconds, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {seconds} s"


def command(problem: Problem, capture: CaptureSummary | None) -> str:
    """Return the command, for a POSIX shell, that shows the evidence; of a bus nobody recorded, what the rule says."""
    if capture is not None and not capture.form:
        return f"tailbyte explain {problem.head.rule}"
    path = problem.head.capture if capture is None else capture.path
    words = ["tailbyte", "decode", argument(path)]
    words += [quoted(word) for word in (() if capture is None else capture.arguments)]
    frame, t = problem.head.first.frame, problem.head.first.t_ns
    shown = window(t, frame, f"{t // SECOND}.{t % SECOND:09d}{_MARGIN}" if t is not None else "")
    if not shown:
        words[1] = "info"
    return " ".join([*words, *shown])


def triage(capture: CaptureSummary) -> str:
    """Return the command, for a POSIX shell, that says what happened; empty for a bus that nobody recorded."""
    return (
        " ".join(["tailbyte triage", argument(capture.path), *map(quoted, capture.arguments)]) if capture.form else ""
    )


def window(t: int | None, frame: int | None, around: str) -> list[str]:
    """Return the options that show a place: near a frame, or a time in words, or nothing where neither is known."""
    if frame is not None and t is not None:
        return ["--around", f"{frame}{_MARGIN}"]
    if frame is not None:
        return ["--frames", f"{max(frame - _NEAR, 1)}-{frame + _NEAR}"]
    return ["--around", around] if t is not None and t >= 0 else []


def argument(path: str) -> str:
    """Write a file as an argument for the shell."""
    return quoted(f"./{path}" if path.startswith("-") and path != "-" else path)


def quoted(word: str) -> str:
    """Write a word for the shell that is printable whatever is in it."""
    if word.isprintable() and not _COMMANDS.search(word):
        return word if _HARMLESS.fullmatch(word) else shlex.quote(word)
    out = []
    for c in word:
        if c in "'\\":
            out.append(f"\\{c}")
        elif c.isprintable() and c not in "#:":
            out.append(c)
        else:
            out += [f"\\x{byte:02x}" for byte in _bytes(c)]
    return f"$'{''.join(out)}'"


def _bytes(c: str) -> bytes:
    try:
        return c.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:
        return c.encode("utf-8", "surrogatepass")


def waivers(report: Report) -> list[str]:
    """Return what became of each waiver, those that are over first."""
    return [waived(one) for one in sorted(report.waivers, key=lambda one: not one.expired)]


def waived(one: WaiverUse) -> str:
    """Write a waiver in a line, with whether it still counts."""
    words = [safe(one.rule), "" if one.node is None else f"node {one.node}", safe(one.type)]
    state = "EXPIRED, does not count" if one.expired else "counts"
    covered = plural(one.findings, "finding") if one.findings else "no finding"
    return (
        f"waiver of {' '.join(filter(None, words))} until {safe(one.expires)} by {safe(one.owner)}: "
        f"{state}, {covered}: {safe(one.reason)}"
    )


def wanted(requirement: Requirement) -> str:
    """Say what is asked of a capture, with how much it counts."""
    return f"{'expects' if requirement.expected else 'requires'} {safe(requirement.what)}"


def verdict_counts(report: Report) -> list[str]:
    """Write `61 pass`, `2 fail`, ...; what there is none of is left out.

    A broken rule whose findings are all told by another rule's is counted as such: the other one counts for both.
    """
    told = [rule for rule in report.rules if not rule.findings and rule.verdict in _BROKEN]
    counts = Counter(rule.verdict for rule in report.rules if rule not in told)
    order = ("PASS", *(name for name in VERDICTS if name not in ("PASS", "INCONCLUSIVE", "NOT EXERCISED")),
             "NOT EXERCISED", "INCONCLUSIVE")  # fmt: skip
    words = [f"{counts[name]} {name.lower()}" for name in order if counts[name]]
    return words + [f"{len(told)} told elsewhere"] * bool(told)


def inconclusive(report: Report) -> dict[str, list[str]]:
    """Return the rules that this recording cannot prove, by the reason."""
    found: dict[str, list[str]] = {}
    for rule in report.rules:
        if rule.verdict == "INCONCLUSIVE":
            found.setdefault(rule.reason or "the recording does not show it", []).append(rule.rule)
    return found


def accounted(capture: CaptureSummary) -> str:
    """Say whether every frame has found its verdict."""
    balanced = sum(capture.verdicts.values()) == capture.frames
    return "all accounted for" if balanced else "NOT ALL ACCOUNTED FOR"


def judged(capture: CaptureSummary) -> list[str]:
    """Say what this recording can show: `timing yes`, `errors NO`."""
    answers = {"yes": "yes", "no": "NO", "unknown": "unknown"}
    return [f"{safe(what)} {answers.get(answer) or safe(answer)}" for what, answer in capture.can_judge.items()]


def timed(capture: CaptureSummary) -> bool:
    """Return True if times say how long it is."""
    known = capture.start_ns is not None and capture.end_ns is not None
    return known and capture.can_judge.get("timing") != "no"


def limits(report: Report, rules: Iterable[str] | None = None) -> list[str]:
    """Write the numbers that no document gives, as `RULE name=value ...`; a star marks what is not the default."""
    table = report.settings.get("limits") or {}
    changed = set(report.settings.get("changed") or ())
    wanted = table if rules is None else [rule for rule in dict.fromkeys(rules) if rule in table]
    lines = []
    for rule in wanted:
        numbers = [
            f"{safe(str(name))}={setting(value)}{'*' if f'{rule}.{name}' in changed else ''}"
            for name, value in table[rule].items()
        ]
        if numbers:
            lines.append(f"{safe(str(rule))} {' '.join(numbers)}")
    return lines


def setting(value: object) -> str:
    """Write a setting as text."""
    if isinstance(value, (list, tuple)):
        return ", ".join(map(setting, value)) or "-"
    if isinstance(value, dict):
        return ", ".join(f"{safe(str(name))}={setting(part)}" for name, part in value.items()) or "-"
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "-"}[value]
    if isinstance(value, float) and value.is_integer():
        return f"{value:.0f}"
    return safe(str(value)) or "-"
