"""The report as JUnit XML: a test case for each rule, node and type that was found, and for each rule that was not.

Names hold neither times nor counts, so that a CI service knows a case again. A case fails if it fails the gate; other
findings pass with their text as output, waived ones are skipped.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.report import headline, wording
from analyzer.report.problems import WHERE, Problem, problems, ranked
from analyzer.views.terminal import ELLIPSIS
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.report.model import CaptureSummary, Report, RuleVerdict

MOST_BYTES = 30_000_000
_BODIES = 24_000_000  # what is left is for cases without a body, which come after it is used up
_RESERVE = 2_000_000  # for what is always said: the gate, and the rules
_LONGEST = 500  # characters of a text
_REQUIREMENTS = 200
_LINES = 40  # frames of an example


@dataclass(frozen=True, slots=True)
class _Case:
    classname: str
    name: str
    outcome: str  # failure, skipped, output, or empty
    message: str = ""
    kind: str = ""
    body: str = ""

    def xml(self, *, body: bool = True) -> str:
        start = f'  <testcase classname="{_attribute(self.classname)}" name="{_attribute(self.name)}" time="0"'
        if self.outcome == "output":
            text = self.body if body else _short(self.message)
            return f"{start}>\n   <system-out>{_content(text)}</system-out>\n  </testcase>\n"
        if self.outcome == "skipped":
            return f'{start}>\n   <skipped message="{_attribute(self.message)}"/>\n  </testcase>\n'
        if self.outcome == "failure":
            head = f'<failure type="{_attribute(self.kind)}" message="{_attribute(self.message)}"'
            inner = f">{_content(self.body)}</failure>" if body else "/>"
            return f"{start}>\n   {head}{inner}\n  </testcase>\n"
        return f"{start}/>\n"


class _Budget:
    """Bytes that are still free. The worst cases come first, so what has no room is what matters least."""

    def __init__(self) -> None:
        self.used = 0
        self.dropped = 0

    def take(self, case: _Case) -> str:
        for text, limit in ((case.xml(), _BODIES), (case.xml(body=False), MOST_BYTES - _RESERVE)):
            size = len(text.encode())
            if self.used + size <= limit:
                self.used += size
                return text
        self.dropped += 1
        return ""


def render(report: Report) -> str:
    """Write the whole document, in UTF-8 below 30 MB."""
    found = problems(report.findings, WHERE)
    several, buses = len(report.captures) > 1, wording.several_buses(report)
    captures = wording.captures_by_id(report)
    budget, written = _Budget(), dict[int, tuple[str, str]]()
    for one in ranked(found):
        case = _case(one, captures.get(one.head.capture), several=several, bus=buses)
        written[id(one)] = (case.outcome, budget.take(case))
    suites = [_suite("gate", list(_gate(report)), _properties(report))]
    for identity in dict.fromkeys([*captures, *(one.head.capture for one in found)]):
        own = [written[id(one)] for one in found if one.head.capture == identity and written[id(one)][1]]
        of = captures.get(identity)
        suites.append(_suite(identity if of is None else of.path, own, () if of is None else _facts(of)))
    if budget.dropped:
        text = f"{budget.dropped} more cases would not fit; the JSON report has all"
        suites.append(_suite("left out", [_pair(_Case("report", "complete", "skipped", text))]))
    named = {one.head.rule for one in found}
    rest = [_pair(_rule(rule)) for rule in report.rules if rule.rule not in named]
    suites.append(_suite("rules", rest))
    total = [sum(counts) for counts in zip(*(counts for counts, _ in suites), strict=True)]
    tests, failures, skipped = total
    head = f'<testsuites name="tailbyte check" tests="{tests}" failures="{failures}" errors="0" skipped="{skipped}">'
    body = "".join(text for _, text in suites)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{head}\n{body}</testsuites>\n'


_Suite = tuple[tuple[int, int, int], str]


def _suite(name: str, cases: list[tuple[str, str]], properties: Iterable[tuple[str, str]] = ()) -> _Suite:
    outcomes = [outcome for outcome, _ in cases]
    tests, failures, skipped = len(cases), outcomes.count("failure"), outcomes.count("skipped")
    counts = f'tests="{tests}" failures="{failures}" errors="0" skipped="{skipped}" time="0"'
    lines = [f'   <property name="{_attribute(key)}" value="{_attribute(value)}"/>\n' for key, value in properties]
    inner = f"  <properties>\n{''.join(lines)}  </properties>\n" if lines else ""
    inner += "".join(text for _, text in cases)
    return (tests, failures, skipped), f' <testsuite name="{_attribute(name)}" {counts}>\n{inner} </testsuite>\n'


def _pair(case: _Case) -> tuple[str, str]:
    return case.outcome, case.xml()


def _case(one: Problem, capture: CaptureSummary | None, *, several: bool, bus: bool) -> _Case:
    head = one.head
    layer = head.rule.partition("-")[0]
    node = "bus" if head.node is None else f"node{head.node}"
    words = [head.rule, head.type, head.bus if bus else ""]
    if several:
        words += ["in", head.capture if capture is None else capture.path]
    name = " ".join(filter(None, words))
    message = f"{one.severity}: {head.title}: {head.text}"
    if one.waiver is not None:
        text = f"waived until {one.waiver.expires} by {one.waiver.owner}: {one.waiver.reason}"
        return _Case(f"{layer}.{node}", name, "skipped", text)
    body = "\n".join(_body(one, capture))
    return _Case(f"{layer}.{node}", name, "failure" if one.fails else "output", message, head.rule, body)


def _body(one: Problem, capture: CaptureSummary | None) -> Iterator[str]:
    head, start = one.head, None if capture is None else capture.start_ns
    yield _short(f"{head.rule} {one.severity}, {head.category}: {head.title}")
    yield _short(f"{wording.place(head, bus=True)} {head.type}".rstrip())
    if head.clause not in ("", "-"):
        yield _short(f"clause {head.clause}")
    first, last = (wording.full_moment(t, start) for t in (one.first.t_ns, one.last.t_ns))
    yield f"{one.count}x, first {first}, last {last}"
    if one.baseline:
        yield f"compared with the baseline: {one.baseline}"
    yield f"frames {' '.join(map(str, one.frames))}" if one.frames else "no frames"
    yield wording.command(one, capture)
    yield f"tailbyte explain {wording.safe(head.rule)}"
    told = 0
    for example in one.examples:
        told += 1
        yield ""
        yield _short(f"{wording.full_moment(example.t_ns, start)} frame {example.frame or '-'}: {example.text}")
        yield from (f"  {_short(line)}" for line in example.lines[:_LINES])
        if len(example.lines) > _LINES:
            yield f"  and {len(example.lines) - _LINES} more frames"
    if not told:
        yield _short(head.text)


def _rule(rule: RuleVerdict) -> _Case:
    layer = rule.rule.partition("-")[0]
    if rule.verdict in ("NOT EXERCISED", "INCONCLUSIVE"):
        reason = f"{rule.verdict.lower()}: {rule.reason}" if rule.reason else rule.verdict.lower()
        return _Case(f"{layer}.all", rule.rule, "skipped", reason)
    return _Case(f"{layer}.all", rule.rule, "")


def _gate(report: Report) -> Iterator[tuple[str, str]]:
    for capture in report.captures:
        damaged = f"{capture.path}: {capture.damage}"
        name = f"whole {capture.path}"
        yield _pair(_Case("gate", name, "failure" if capture.damage else "", damaged, "damaged", _short(damaged)))
    for k, requirement in enumerate(report.gate.requirements[:_REQUIREMENTS]):
        found = f"{requirement.what}: found {requirement.found}"
        name = f"{'expects' if requirement.expected else 'requires'} {k + 1} {requirement.what}"
        yield _pair(_Case("gate", name, "" if requirement.met else "failure", found, "not met", _short(found)))
    for k, waiver in enumerate(report.waivers[:_REQUIREMENTS]):
        line = wording.waived(waiver)
        outcome = "skipped" if waiver.expired else "output"
        yield _pair(_Case("gate", f"waiver {k + 1} {waiver.rule}", outcome, line, "waiver", _short(line)))
    judged = report.gate.judged or any(not requirement.met for requirement in report.gate.requirements)
    yield _pair(_Case("gate", "judged", "" if judged else "failure", report.gate.reason, "nothing to judge"))


def _properties(report: Report) -> Iterator[tuple[str, str]]:
    head = headline.of(report)
    yield "tool", report.tool
    yield "schema", report.schema
    yield "verdict", head.verdict
    yield "headline", head.summary
    yield "worst", head.worst
    yield "counted", "test cases: one for each rule, node and type, and for each rule without a finding"
    for name, value in report.settings.items():
        if name not in ("limits", "changed"):
            yield f"setting.{name}", wording.setting(value)
    for line in wording.limits(report):
        rule, _, numbers = line.partition(" ")
        yield f"limits.{rule}", numbers


def _facts(capture: CaptureSummary) -> Iterator[tuple[str, str]]:
    yield "sha256", capture.sha256
    yield "form", capture.form
    yield "frames", f"{capture.frames}, {wording.accounted(capture)}"
    yield "can judge", ", ".join(wording.judged(capture)) or "nothing"


def _short(text: str) -> str:
    text = wording.safe(text)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + ELLIPSIS


def _attribute(text: str) -> str:
    return _content(_short(text)).replace('"', "&quot;")


def _content(text: str) -> str:
    """Escape text of this module's lines; what is in them is printable already, so XML can hold it."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
