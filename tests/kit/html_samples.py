"""Reports made by hand for the HTML tests, with courses to draw: a healthy one, a faulty, a hostile and a long one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from analyzer.report.model import BusUse, Example, Finding, Gate, NodeUse, Place, Report, Requirement, Waiver
from kit import reports
from kit.reports import SECOND, START

LENGTH = 1200  # s
GATE = Gate(
    ("protocol:error",), failed=False, judged=True, exit_status=0, reason="nothing at or above protocol:error",
    requirements=(Requirement("8 ESCs", met=True, found="8 ESCs"),),
)  # fmt: skip
NEVER_SEEN = tuple(
    replace(one, rule=f"PUSH-{k:03}", title="Packet is well formed", reason="no packet seen")
    for one in reports.rules()
    if one.verdict == "NOT EXERCISED"
    for k in range(5)
)
HOSTILE = (
    "<script>alert(1)</script>",
    "\x1b[2J\x1b]0;owned\x07",
    "\u202egpj.exe\u2066",
    "nul\0nul",
    "x" * 10_000,
    "</style><img src=x onerror=alert(1)>",
    "{{ 7 * 7 }}{% raw %}",
    "' onmouseover='alert(1)' \" & ; --><!--]]>",
    "\ud800\udcff",
    "javascript:alert(1)",
)
LINES = (
    "(1773475930.400000) can0 1F040A18#9C1E0410FC0C4689",
    "(1773475930.400131) can0 1F040A18#52AE2B4C4D000029",
    "(1773475930.400229) can0 1F040A18#000049",
)


def finding(rule: str, second: float = 600.4, until: float | None = None, **changes: Any) -> Finding:
    first, last = (
        Place(int(at * 2300) + 1, START + int(at * SECOND)) for at in (second, second if until is None else until)
    )
    text = "frame 2 of 3 is missing: toggle 0 where 1 was due"
    usual: dict[str, Any] = {
        "type": "ESCStatus", "count": 3, "frames": (1380921, 1380950, 1381002), "cause": "lost frame", "text": text,
        "examples": (Example(first.frame, first.t_ns, "frame 2 of 3 is missing", LINES),), "fails": False,
    }  # fmt: skip
    return replace(reports.finding(rule), **usual | {"first": first, "last": last} | changes)


def node(number: int, channel: int, **changes: Any) -> NodeUse:
    types = {"ESCStatus": 60_000, "NodeStatus": 1200, "ParamGet": 12}
    rates = tuple(50 + (k * number) % 7 for k in range(LENGTH))
    made = NodeUse(
        "can0", number, f"ch{channel}", "com.tmotor.esc", "ESC", "V2.2.07", types, 50.0, 0, START + 12_000_000,
        START + LENGTH * SECOND, rates,
    )  # fmt: skip
    return replace(made, **changes)


def bus(peak: int) -> BusUse:
    rates = tuple(900 + (k * 37) % 90 + (900 if 200 < k < 1000 else 0) for k in range(LENGTH - 1))
    rates = (*rates[:740], peak, *rates[741:])
    return BusUse(
        "can0", sum(rates), sum(rates) / len(rates), peak, 1_000_000, START, SECOND,
        tuple(rate * 146 / 1e6 for rate in rates), rates, {"motors turn": 2400, "motors rest": 4000},
    )  # fmt: skip


def report(*findings: Finding, peak: int, nodes: tuple[NodeUse, ...] = (), **of: Any) -> Report:
    """A report on a flight of `LENGTH`; `of` changes its capture."""
    use = bus(peak)
    capture = reports.capture(
        **{
            "path": "hover.log", "end_ns": START + LENGTH * SECOND, "frames": use.frames, "transfers": 612_044,
            "accounting": {"lines": use.frames + 2, "frames": use.frames, "error_frames": 0, "blank": 2},
            "verdicts": {"used": use.frames - 40, "foreign": 40, "orphan": 0}, "buses": (use,), "nodes": nodes,
        } | of
    )  # fmt: skip
    settings = {
        "profile": "", "changed": ["TRF-007.s"],
        "limits": {"BUS-001": {"limit_per_s": 2400}, "BUS-002": {"limit_per_s": 4000}, "TRF-007": {"s": 2.0}},
    }  # fmt: skip
    rules = (*reports.rules(findings), *NEVER_SEEN)
    return reports.report(*findings, captures=(capture,), settings=settings, gate=GATE, rules=rules)


def healthy() -> Report:
    flown = {"name": "org.ardupilot", "software": "4.6.3", "types": {"RawCommand": 480_000}, "hz": 400.1}
    pilot = node(1, 0, label="", role="autopilot", **flown)
    return report(peak=1980, nodes=(pilot, *(node(20 + k, k + 1) for k in range(8))))


def faulty() -> Report:
    nodes = list(healthy().captures[0].nodes)
    quiet = tuple(0 if k > 800 else rate for k, rate in enumerate(nodes[5].rates))
    nodes[5] = replace(nodes[5], bad=3, software="V2.2.05", rates=quiet)
    frames = bus(2688).frames
    once: dict[str, Any] = {"count": 1, "cause": ""}
    whole: dict[str, Any] = {"node": None, "label": "", "type": "", "cause": ""}
    foreign = ("(1773475330.100000) can0 18FEF100#FFFFFFFF", "no candump line")
    findings = (
        finding("TYP-306", 700.9, text="Operating -> Error mode", **once),
        finding("TRF-003", 600.4, 604.1, node=25, label="ch6", fails=True),
        finding(
            "TRF-010", 310.2, 988.0, node=25, label="ch6", title="Transfer CRC mismatch", cause="corrupted", count=48,
            text="CRC 0x2C11 received, 0x9A04 computed",
            waiver=Waiver("known cable, replaced in May", "j.doe", "2026-06-30"),
        ),
        finding("TYP-305", 697.4, 705, text="MOS overtemperature", **once),
        finding("BUS-028", 702, text="100 % commanded, 0 rpm", **once),
        finding(
            "BUS-001", 740, 741, count=1, text="2688 frames in 1 s, limit 2400; most: node 24 ESCStatus 900",
            baseline="new", examples=(), **whole,
        ),
        finding(
            "CAN-018", 2, 1190, title="Foreign 29-bit traffic", severity="note", origin="heuristic", clause="-",
            text="40 frames of 18FEF100", examples=(Example(9, START, "", foreign),), **whole,
        ),
    )  # fmt: skip
    made = report(
        *findings, peak=2688, nodes=tuple(nodes), path="crash flight 3.log", damage="the last line is cut",
        accounting={"lines": frames + 3, "frames": frames, "error_frames": 0, "unreadable": 3},
    )  # fmt: skip
    needs = (*GATE.requirements, Requirement("60 s with motors running", met=False, found="12 s"))
    why = "TRF-003 is at or above protocol:error"
    return replace(made, gate=replace(GATE, failed=True, exit_status=1, reason=why, requirements=needs))


def hostile(text: str) -> Report:
    """A report in which everything that a capture or a profile can say says `text`."""
    base = reports.hostile(text)
    of = base.captures[0]
    use = replace(bus(2688), name=text, limits={text: 2400})
    who = replace(of.nodes[0], rates=node(20, 1).rates)
    lines = (text, LINES[0].replace("can0", text))
    (first, *rest) = base.findings
    first = replace(first, examples=(Example(1, START, text, lines),))
    span = {"start_ns": START, "end_ns": START + LENGTH * SECOND}
    of = replace(of, buses=(use, replace(use, name=text + "2")), nodes=(who, replace(who, bus="other")), **span)
    return replace(base, captures=(of,), findings=(first, *rest))


def long(count: int = 5000, text: str = "frame 2 of 3 is missing") -> Report:
    """Many findings, each with 20 examples."""
    base = faulty()
    severities = ("error", "warning", "note")
    found = tuple(
        replace(
            finding(f"TRF-{k % 31:03}", k * LENGTH / count, node=20 + k % 8, label=f"ch{k % 8 + 1}", text=text),
            severity=severities[k * 3 // count],
            frames=tuple(range(1, 21)),
            examples=(Example(1, START, text, LINES),) * 20,
        )
        for k in range(count)
    )
    return replace(base, findings=found)
