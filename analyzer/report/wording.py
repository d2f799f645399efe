"""What every format says in the same words: places, times, commands, and the verdict in one line."""

from __future__ import annotations

import re
import shlex
from collections import Counter
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from analyzer.report.model import SEVERITIES, VERDICTS
from analyzer.report.moments import SECOND, on_calendar
from analyzer.report.problems import problems
from analyzer.rules.gate import NEVER
from analyzer.views.terminal import escape

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.report.model import Capture, Finding, Report, Requirement, WaiverUse
    from analyzer.report.problems import Problem

_NEAR = 5  # frames to each side, where no time says what is near
_MARGIN = "+-50ms"
_NAMED = 3
_BROKEN = ("FAIL", "WARN", "WAIVED", "KNOWN")
_RANKS = ("protocol", "device", "capture")
_COMMANDS = re.compile(r"#(#)(?=\w*\[)|:(:)(?=\w)")  # how commands to CI services begin in their logs
_HARMLESS = re.compile(r"[\w%+,./:=@^-]+", re.ASCII)


def safe(text: str) -> str:
    """One line of text from anywhere, harmless on a terminal and in the log of a CI service."""
    return _COMMANDS.sub(lambda found: rf"{found[0][0]}\x{ord(found[0][0]):02x}", escape(text))


def plural(count: int, noun: str) -> str:
    """`1 error`, `2 errors`."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def captures_by_id(report: Report) -> dict[str, Capture]:
    """The captures that findings name."""
    return {capture.id: capture for capture in report.captures}


def place(finding: Finding, *, bus: bool = False) -> str:
    """Who it was: `ch6 node 25`, or the interface alone; `bus` says that there are several to tell apart."""
    words = [safe(finding.label)] if finding.label else []
    if finding.node is not None:
        words.append(f"node {finding.node}")
    if finding.bus and (bus or not words):
        words.append(safe(finding.bus))
    return " ".join(words) or "bus"


def several_buses(report: Report) -> bool:
    """Whether the name of an interface says anything."""
    return len({bus.name for capture in report.captures for bus in capture.buses}) > 1


def counted(problem: Problem) -> str:
    """`3x`."""
    return f"{problem.count}x"


def moment(t: int | None, start: int | None, *, utc: bool = True, form: str = "%H:%M:%S", ms: bool = True) -> str:
    """A time of day, or seconds from `start` in a capture whose times have no date; `-` without a time."""
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
    """Date and time, the same on every machine."""
    text = moment(t, start, form="%Y-%m-%d %H:%M:%S")
    return f"{text} UTC" if t is not None and on_calendar(t) else text


def length(ns: int) -> str:
    """A length of time in its two largest units."""
    seconds, rest = divmod(max(ns, 0), SECOND)
    if seconds < 60:
        return f"{seconds}.{rest // 1_000_000:03d} s"
    minutes, seconds = divmod(seconds, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {seconds} s"


def command(problem: Problem, capture: Capture | None) -> str:
    """The command that shows the evidence, for a POSIX shell; of a bus that nobody recorded, what the rule says."""
    if capture is not None and not capture.form:
        return f"tailbyte explain {problem.head.rule}"
    path = problem.head.capture if capture is None else capture.path
    words = ["tailbyte", "decode", argument(path)]
    words += [quoted(word) for word in (() if capture is None else capture.arguments)]
    frame, t = problem.head.first.frame, problem.head.first.t_ns
    if frame is not None and t is not None:
        words += ["--around", f"{frame}{_MARGIN}"]
    elif frame is not None:
        words += ["--frames", f"{max(frame - _NEAR, 1)}-{frame + _NEAR}"]
    elif t is not None and t >= 0:
        words += ["--around", f"{t // SECOND}.{t % SECOND:09d}{_MARGIN}"]
    else:
        words[1] = "info"
    return " ".join(words)


def argument(path: str) -> str:
    """A file as an argument for the shell."""
    return quoted(f"./{path}" if path.startswith("-") and path != "-" else path)


def quoted(word: str) -> str:
    """A word for the shell that is printable whatever is in it."""
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


def verdict(report: Report) -> str:
    """The answer in a word."""
    if report.gate.failed:
        return "FAIL"
    if report.gate.exit_status == 0 and report.gate.fail_on == (NEVER,):
        return "NOT GATED"
    return {0: "PASS", 3: "DAMAGED", 4: "NOT JUDGED"}.get(report.gate.exit_status, "FAIL")


def summary(report: Report, found: Sequence[Problem]) -> str:
    """`1 protocol error (ch6), 9 warnings, 3 waived`: errors by category and place, the rest by number.

    Before them stands how much of what a vehicle file expects is not there.
    """
    shown = [one for one in found if one.open]
    missed = sum(one.expected and not one.met for one in report.gate.requirements)
    parts = [f"{plural(missed, 'expectation')} not met"] if missed else []
    for category in _RANKS:
        errors = [one for one in shown if one.severity == "error" and one.head.category == category]
        if errors:
            parts.append(plural(len(errors), f"{category} error") + _names(errors))
    for severity in SEVERITIES[1:]:
        count = sum(one.severity == severity for one in shown)
        if count:
            parts.append(plural(count, severity))
    excused = sum(one.waiver is not None for one in found)
    known = sum(one.waiver is None and not one.open for one in found)
    parts += [f"{count} {word}" for count, word in ((excused, "waived"), (known, "known")) if count]
    return ", ".join(parts) or "no findings"


def ungated(report: Report) -> str:
    """What a pass does not mean: errors that the limits let through, if any."""
    shown = [one for one in problems(report.findings) if one.open and one.severity == "error" and not one.fails]
    if not shown or report.gate.failed:
        return ""
    return f"--fail-on {','.join(report.gate.fail_on)}: {plural(len(shown), 'error')} not counted"


def worst(found: Sequence[Problem]) -> Problem:
    """The problem to look at first, of at least one: what fails, then by severity and category."""
    return min(found, key=lambda one: (not one.fails, SEVERITIES.index(one.severity), _RANKS.index(one.head.category)))


def waivers(report: Report) -> list[str]:
    """What became of each waiver, those that are over first."""
    return [waived(one) for one in sorted(report.waivers, key=lambda one: not one.expired)]


def waived(one: WaiverUse) -> str:
    """A waiver in a line, with whether it still counts."""
    words = [safe(one.rule), "" if one.node is None else f"node {one.node}", safe(one.type)]
    state = "EXPIRED, does not count" if one.expired else "counts"
    covered = plural(one.findings, "finding") if one.findings else "no finding"
    return (
        f"waiver of {' '.join(filter(None, words))} until {safe(one.expires)} by {safe(one.owner)}: "
        f"{state}, {covered}: {safe(one.reason)}"
    )


def _names(found: Sequence[Problem]) -> str:
    names = list(dict.fromkeys(_name(one.head) for one in found))
    if names == [""] or not names:
        return ""
    named = [name for name in names if name]
    more = ", ..." if len(named) > _NAMED else ""
    return f" ({', '.join(named[:_NAMED])}{more})"


def _name(finding: Finding) -> str:
    return safe(finding.label) or ("" if finding.node is None else f"node {finding.node}")


def wanted(requirement: Requirement) -> str:
    """What is asked of a capture, with how much it counts."""
    return f"{'expects' if requirement.expected else 'requires'} {safe(requirement.what)}"


def verdict_counts(report: Report) -> list[str]:
    """`61 pass`, `2 fail`, ...; what there is none of is left out.

    A broken rule whose findings are all told by another rule's is counted as such: the other one counts for both.
    """
    told = [rule for rule in report.rules if not rule.findings and rule.verdict in _BROKEN]
    counts = Counter(rule.verdict for rule in report.rules if rule not in told)
    order = ("PASS", *(name for name in VERDICTS if name not in ("PASS", "INCONCLUSIVE", "NOT EXERCISED")),
             "NOT EXERCISED", "INCONCLUSIVE")  # fmt: skip
    words = [f"{counts[name]} {name.lower()}" for name in order if counts[name]]
    return words + [f"{len(told)} told elsewhere"] * bool(told)


def inconclusive(report: Report) -> dict[str, list[str]]:
    """The rules that this recording cannot prove, by the reason."""
    found: dict[str, list[str]] = {}
    for rule in report.rules:
        if rule.verdict == "INCONCLUSIVE":
            found.setdefault(rule.reason or "the recording does not show it", []).append(rule.rule)
    return found


def accounted(capture: Capture) -> str:
    """Whether every frame has found its verdict."""
    balanced = sum(capture.verdicts.values()) == capture.frames
    return "all accounted for" if balanced else "NOT ALL ACCOUNTED FOR"


def judged(capture: Capture) -> list[str]:
    """What this recording can show: `timing yes`, `errors NO`."""
    answers = {"yes": "yes", "no": "NO", "unknown": "unknown"}
    return [f"{safe(what)} {answers.get(answer) or safe(answer)}" for what, answer in capture.can_judge.items()]


def timed(capture: Capture) -> bool:
    """Whether times say how long it is."""
    known = capture.start_ns is not None and capture.end_ns is not None
    return known and capture.can_judge.get("timing") != "no"


def limits(report: Report, rules: Iterable[str] | None = None) -> list[str]:
    """The numbers that the document does not give, as `RULE name=value ...`; a star marks what is not the default."""
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
    """A setting in text."""
    if isinstance(value, (list, tuple)):
        return ", ".join(map(setting, value)) or "-"
    if isinstance(value, dict):
        return ", ".join(f"{safe(str(name))}={setting(part)}" for name, part in value.items()) or "-"
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "-"}[value]
    if isinstance(value, float) and value.is_integer():
        return f"{value:.0f}"
    return safe(str(value)) or "-"
