"""Reports and findings made by hand: what `check` or a live session might say, without a capture.

The reports are of captures that are healthy, faulty, empty, damaged or hostile.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from hypothesis import strategies as st

from analyzer.report.model import (
    BusUse,
    CaptureSummary,
    Coverage,
    Example,
    Finding,
    Gate,
    NodeUse,
    Place,
    Report,
    Requirement,
    RuleVerdict,
    Waiver,
)
from analyzer.report.newest import Change

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analyzer.report.model import Category, Origin, Severity, Verdict

SECOND = 1_000_000_000
START = 1_773_475_330_600_000_000  # 2026-03-14 08:02:10.6 UTC
LINE = "(1773492594.890000) can0 1504021A#A75A4C02{:02X}000040"

TITLES: dict[str, tuple[str, Severity, Category, Origin, str]] = {
    "TYP-306": ("Error mode", "error", "device", "document", "4.4.3 status table"),
    "TYP-305": ("Device fault bit set", "warning", "device", "document", "4.4.3 status table"),
    "BUS-028": ("Throttle and speed disagree", "warning", "device", "heuristic", "4.4.1, 4.4.3"),
    "TRF-003": ("A frame was lost or came out of order", "error", "protocol", "document", "4.1.3 Toggle"),
    "BUS-001": ("Frame rate above the operating limit", "warning", "protocol", "document", "4.4.4 expl. 3"),
    "CAN-013": ("Priority is not the lowest", "note", "protocol", "document", "4.3.1"),
    "CAP-003": ("Line cannot be read", "error", "capture", "heuristic", "-"),
    "CAN-004": ("Error frame on the bus", "warning", "capture", "heuristic", "-"),
    "BUS-005": ("Error frames come often", "warning", "capture", "heuristic", "-"),
    "TYP-011": ("Union tag out of range", "error", "protocol", "dronecan", "-"),
}


# What a capture, a path or a profile might hold to fool a terminal, a browser, a parser or a runner of workflows.
NASTY = ("\x1b[2J", "<script>alert(1)</script>", "]]>", "::error::x", "##[error]x", "a|b", "`a`", "\u202eabc", "\0",
         "\n", "\r\n::error::x", "\udc80", "\U000e0001", "[x](http://x)", "@somebody", "![x](//x)", "%0A", "-rf",
         "'; ls #", "漢字", '" x="', "a,file=x", "```")  # fmt: skip
TEXTS = st.lists(st.sampled_from(NASTY) | st.text(st.characters(codec=None), max_size=9), max_size=4).map("".join)


def finding(rule: str, at: int | None = 0, *, node: int | None = 24, frame: int | None = 1, **more: Any) -> Finding:
    """One finding of a rule, which is called like TRF-003 if it stands not above; `at` is in ns from the start."""
    title, severity, category, origin, clause = TITLES.get(rule, TITLES["TRF-003"])
    t = None if at is None else START + at
    last = more.pop("last", 0)
    end = Place(None if frame is None else frame + bool(last), None if t is None else t + last)
    values: dict[str, Any] = {
        "rule": rule, "title": title, "severity": severity, "category": category, "origin": origin, "clause": clause,
        "capture": "1", "bus": "can0", "node": node, "label": "" if node is None else f"ch{node - 19}", "type": "",
        "key": "", "count": 1, "first": Place(frame, t), "last": end, "cause": "", "text": f"as {rule} says",
        "frames": () if frame is None else (frame,), "fails": (category, severity) == ("protocol", "error"),
    }  # fmt: skip
    values |= more
    if "examples" not in values and frame is not None:
        values["examples"] = (Example(frame, t, values["text"], (LINE.format(frame % 256),)),)
    return Finding(**values)


def change(
    rule: str = "TRF-010", severity: Severity = "error", t: int | None = None, *, fresh: bool = True, count: int = 1,
    **more: Any,
) -> Change:  # fmt: skip
    """A finding as a live session tells it: new, or come up again so often; `t` is its time in ns."""
    given = {"node": None, "severity": severity} | more
    since = given.pop("since", None)
    return Change(finding(rule, None if t is None else t - START, frame=None, **given), fresh, count, since)


def rules(findings: Iterable[Finding] = (), missing: Iterable[str] = ("CAN-004", "BUS-005")) -> tuple[RuleVerdict, ...]:
    """A verdict for every rule of `TITLES`."""
    counts: dict[str, int] = {}
    for one in findings:
        counts[one.rule] = counts.get(one.rule, 0) + 1
    out = []
    for rule, (title, severity, category, origin, clause) in TITLES.items():
        verdict: Verdict = "PASS"
        reason = ""
        if rule in counts:
            verdict = "FAIL" if severity == "error" else "WARN"
        elif rule in tuple(missing):
            verdict, reason = "INCONCLUSIVE", "error frames not recorded"
        elif rule == "TYP-011":
            verdict, reason = "NOT EXERCISED", "no unions seen"
        out.append(RuleVerdict(rule, title, severity, category, origin, clause, verdict, counts.get(rule, 0), reason))
    return tuple(out)


def capture(**more: Any) -> CaptureSummary:
    """The capture of a flight, with two nodes on one bus."""
    values: dict[str, Any] = {
        "id": "1", "path": "crash.log", "sha256": "9f2c" * 15 + "00e1", "form": "candump text", "start_ns": START,
        "end_ns": START + 17_268 * SECOND, "frames": 41_666_610, "transfers": 13_968_112,
        "accounting": {"lines": 41_666_667, "frames": 41_666_610, "events": 55, "unreadable": 2},
        "verdicts": {"used": 41_665_902, "foreign": 601, "wrong toggle": 107},
        "can_judge": {"transfers": "yes", "timing": "yes", "drops": "unknown", "errors": "no"},
        "dialects": {"can0:24": {"ESCStatus.error_count": "tm", "ESCStatus.temperature": "degC"}},
        "buses": (BusUse("can0", 41_666_610, 2413.0, 2688, 1_000_000, START, SECOND, (0.36, 0.37, 0.41)),),
        "nodes": (
            NodeUse("can0", 1, "", "org.example.fc", "autopilot", "4.6.3", {"RawCommand": 6_907_200}, 400.1, 0,
                    START, START + SECOND),
            NodeUse("can0", 24, "ch5", "", "ESC", "V2.2.05", {"ESCStatus": 863_400}, None, 3, START, None),
        ),
    }  # fmt: skip
    return CaptureSummary(**values | more)


COVERAGE = Coverage(
    types={"RawCommand": 6_907_200, "ESCStatus": 863_400, "ParamCfg": 0},
    packets={"PUSHCAN.MotorStatus": 0},
    values={"ESCStatus.status.mode": {"initializing": 0, "operating": 863_399, "error": 1}},
    clauses={"4.1.3 Toggle": "FAIL", "4.3.1": "PASS", "4.4.2": "NOT EXERCISED"},
    never=("2.1 shape of the connector", "5.2 when a value is stored"),
)
SETTINGS: dict[str, Any] = {
    "profile": "", "fail_on": ["protocol:error"], "select": [], "changed": [],
    "limits": {"BUS-001": {"limit_per_s": 2400}, "BUS-028": {"high_pct": 10.0, "zero_s": 2.5}, "CAP-003": {}},
}  # fmt: skip


def report(*findings: Finding, captures: tuple[CaptureSummary, ...] | None = None, **more: Any) -> Report:
    """A report of these findings, with the gate that follows from them."""
    failed = any(one.fails for one in findings)
    gate = Gate(("protocol:error",), failed, judged=True, exit_status=int(failed), reason="")
    values: dict[str, Any] = {
        "tool": "tailbyte 0.1.0", "settings": SETTINGS, "captures": captures or (capture(),), "findings": findings,
        "rules": rules(findings), "coverage": COVERAGE, "gate": gate,
    }  # fmt: skip
    return Report(**values | more)


def healthy() -> Report:
    return report()


def faulty() -> Report:
    late = 17_264_890_000_000
    return report(
        finding("TYP-306", late, frame=41_658_572, type="ESCStatus", text="mode 6, MOS overtemperature"),
        finding("TRF-003", late, node=25, frame=41_658_575, type="ESCStatus", count=3, last=3 * SECOND,
                frames=(41_658_575, 41_661_020, 41_664_811), cause="lost frame",
                text="toggle 0 where 1 was due, 1 frame missing before 41658576"),
        finding("TYP-305", late - 3 * SECOND, frame=41_652_001, type="ESCStatus", text="MOS overtemperature"),
        finding("BUS-028", late + 2 * SECOND, frame=41_660_101, text="commanded 100 %, 0 rpm"),
        *(finding("BUS-001", k * 3600 * SECOND, node=None, frame=10 + k, text=f"26{88 - k} frames/s, limit 2400")
          for k in range(3)),
        finding("CAN-013", 0, node=1, type="RawCommand", label="", key="7", text="priority 7, 31 is LOWEST"),
    )  # fmt: skip


def empty() -> Report:
    nothing = capture(
        path="empty.log", frames=0, transfers=0, start_ns=None, end_ns=None, accounting={"lines": 0}, verdicts={},
        can_judge={"transfers": "no"}, dialects={}, buses=(), nodes=(),
    )  # fmt: skip
    gate = Gate(("protocol:error",), failed=False, judged=False, exit_status=4, reason="nothing to judge")
    return report(captures=(nothing,), gate=gate, coverage=Coverage({}, {}, {}, {}), rules=(), settings={})


def damaged() -> Report:
    gate = Gate(("protocol:error",), failed=False, judged=True, exit_status=3, reason="the capture is damaged")
    one = finding("CAP-003", None, node=None, frame=None, bus="", text="record 7 is cut")
    return report(one, captures=(capture(damage="ends inside chunk 7", path="torn.mcap"),), gate=gate)


def waived() -> Report:
    waiver = Waiver("known since V2.2.05", "Ada", "2026-12-31")
    needs = (Requirement("8 ESCs", met=False, found="6"), Requirement("BUS-001", met=True, found="exercised"))
    gate = Gate(("protocol:error",), failed=False, judged=False, exit_status=4, reason="8 ESCs: found 6",
                requirements=needs)  # fmt: skip
    return report(
        finding("TRF-003", 5 * SECOND, type="ESCStatus", waiver=waiver, fails=False), finding("BUS-028"), gate=gate
    )


def compared() -> Report:
    return report(
        finding("TRF-003", type="ESCStatus", baseline="new"),
        finding("TYP-306", baseline="known", fails=False),
        finding("BUS-001", node=None, baseline="worse"),
    )


def many(count: int = 200) -> Report:
    names = list(TITLES)
    found = [finding(names[k % 7], k * SECOND, node=20 + k % 40, frame=k + 1, key=str(k)) for k in range(count)]
    found.sort(key=lambda one: ("error", "warning", "note").index(one.severity))
    return report(*found)


def two_captures() -> Report:
    other = capture(id="2", path="second flight.log", buses=(BusUse("can1", 5, 5.0, 5, None),))
    found = (finding("TRF-003", type="ESCStatus"), finding("TRF-003", type="ESCStatus", capture="2", bus="can1"))
    return report(*found, captures=(capture(), other))


def hostile(text: str) -> Report:
    """The same text in every place that a capture, a path or a profile can fill."""
    waiver = Waiver(text, text, text)
    filled = {"title": text, "label": text, "type": text, "key": text, "bus": text, "cause": text, "text": text}
    one = finding("TRF-003", **filled, examples=(Example(1, START, text, (text, text)),))
    gate = Gate((text,), failed=True, judged=True, exit_status=1, reason=text,
                requirements=(Requirement(text, met=False, found=text),))  # fmt: skip
    node = NodeUse(text, 1, text, text, text, text, {text: 1}, 1.0, 1, START, START)
    found = (one, replace(one, node=None), replace(one, waiver=waiver, fails=False, rule="BUS-001"))
    listed = tuple(replace(rule, title=text, reason=text, clause=text) for rule in rules(found))
    of = capture(path=text, sha256=text, form=text, accounting={text: 1}, verdicts={text: 1}, can_judge={text: "no"},
                 dialects={text: {text: text}}, buses=(BusUse(text, 1, 1.0, 1, None),), nodes=(node,), damage=text,
                 arguments=(text,))  # fmt: skip
    coverage = Coverage({text: 1}, {text: 0}, {text: {text: 1}}, {text: "PASS"}, (text,))
    settings = {"profile": text, "other": {text: [text]}, "limits": {"TRF-003": {text: text}}, "changed": [text]}
    return report(*found, captures=(of,), gate=gate, coverage=coverage, rules=listed, settings=settings, tool=text)


SAMPLES = {
    "healthy": healthy, "faulty": faulty, "empty": empty, "damaged": damaged, "waived": waived, "compared": compared,
    "many": many, "two captures": two_captures,
}  # fmt: skip
