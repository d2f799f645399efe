"""Reports made by hand for the HTML tests: a healthy one, a faulty one, a hostile one and a very long one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from analyzer.report.model import (
    BusUse,
    Capture,
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

SECOND = 1_000_000_000
T0 = 1_773_475_330 * SECOND  # 2026-03-14 08:02:10 UTC
LENGTH = 1200
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


def place(second: float, frame: int | None = None) -> Place:
    return Place(int(second * 2300) + 1 if frame is None else frame, T0 + int(second * SECOND))


def finding(rule: str, second: float = 600.4, until: float | None = None, **changes: Any) -> Finding:
    first, last = place(second), place(second if until is None else until)
    made = Finding(
        rule=rule,
        title="A frame was lost",
        severity="error",
        category="protocol",
        origin="document",
        clause="4.1.3 Toggle",
        capture="1",
        bus="can0",
        node=24,
        label="ch5",
        type="ESCStatus",
        key="",
        count=3,
        first=first,
        last=last,
        frames=(1380921, 1380950, 1381002),
        cause="lost frame",
        text="frame 2 of 3 is missing: toggle 0 where 1 was due",
        examples=(Example(first.frame, first.t_ns, "frame 2 of 3 is missing", LINES),),
    )
    return replace(made, **changes)


def node(number: int, channel: int, **changes: Any) -> NodeUse:
    made = NodeUse(
        bus="can0",
        node=number,
        label=f"ch{channel}",
        name="com.tmotor.esc",
        role="ESC",
        software="V2.2.07",
        types={"ESCStatus": 60_000, "NodeStatus": 1200, "ParamGet": 12},
        hz=50.0,
        bad=0,
        first_ns=T0 + 12_000_000,
        last_ns=T0 + LENGTH * SECOND,
        rates=tuple(50 + (k * number) % 7 for k in range(LENGTH)),
    )
    return replace(made, **changes)


def bus(peak: int) -> BusUse:
    rates = tuple(900 + (k * 37) % 90 + (900 if 200 < k < 1000 else 0) for k in range(LENGTH - 1))
    rates = (*rates[:740], peak, *rates[741:])
    return BusUse(
        name="can0",
        frames=sum(rates),
        mean=sum(rates) / len(rates),
        peak=peak,
        bit_rate=1_000_000,
        start_ns=T0,
        load=tuple(rate * 146 / 1e6 for rate in rates),
        rates=rates,
        limits={"motors turn": 2400, "motors rest": 4000},
    )


def rule(name: str, title: str, verdict: Any = "PASS", **changes: Any) -> RuleVerdict:
    return replace(RuleVerdict(name, title, "error", "protocol", "document", "4.1.3", verdict, 0), **changes)


def healthy() -> Report:
    use = bus(1980)
    esc = [node(20 + k, k + 1) for k in range(8)]
    pilot = node(
        1,
        0,
        label="",
        role="autopilot",
        name="org.ardupilot",
        software="4.6.3",
        types={"RawCommand": 480_000},
        hz=400.1,
    )
    capture = Capture(
        id="1",
        path="hover.log",
        sha256="9f2c" * 16,
        form="candump text",
        start_ns=T0,
        end_ns=T0 + LENGTH * SECOND,
        frames=use.frames,
        transfers=612_044,
        accounting={"lines": use.frames + 2, "frames": use.frames, "error_frames": 0, "blank": 2},
        verdicts={"used": use.frames - 40, "foreign": 40, "orphan": 0},
        can_judge={"transfers": "yes", "timing": "yes", "drops": "unknown", "errors": "no"},
        dialects={"node 20": {"ESCStatus": "T-Motor", "temperature": "kelvin"}},
        buses=(use,),
        nodes=(pilot, *esc),
    )
    rules = [rule(f"TRF-{k:03}", "Transfers are whole and in order") for k in range(1, 26)]
    rules += [rule(f"PUSH-{k:03}", "Packet is well formed", "NOT EXERCISED", reason="no packet seen") for k in range(6)]
    rules += [rule("CAN-004", "Error frame in capture", "INCONCLUSIVE", reason="error frames are not recorded")]
    return Report(
        tool="tailbyte 0.1.0",
        settings={
            "profile": "",
            "limits": {"BUS-001": {"limit_per_s": 2400}, "BUS-002": {"limit_per_s": 4000}, "TRF-007": {"s": 2.0}},
            "changed": ["TRF-007.s"],
        },
        captures=(capture,),
        findings=(),
        rules=tuple(rules),
        coverage=Coverage(
            types={"RawCommand": 480_000, "ESCStatus": 480_000, "ParamCfg": 0},
            packets={"PUSHCAN.MotorStatus": 0},
            values={"ESCStatus.status.mode": {"operating": 470_000, "standby": 10_000, "error": 0}},
            clauses={"4.1.3": "PASS", "4.4.3": "PASS", "4.4.5": "NOT EXERCISED"},
            never=("4.2.1 termination of the bus",),
        ),
        gate=Gate(
            ("protocol:error",),
            failed=False,
            judged=True,
            exit_status=0,
            reason="nothing at or above protocol:error",
            requirements=(Requirement("8 ESCs", met=True, found="8 ESCs"),),
        ),
    )


def faulty() -> Report:
    clean = healthy()
    use = bus(2688)
    nodes = list(clean.captures[0].nodes)
    quiet = tuple(0 if k > 800 else rate for k, rate in enumerate(nodes[5].rates))
    nodes[5] = replace(nodes[5], bad=3, software="V2.2.05", rates=quiet)
    warning: dict[str, Any] = {"severity": "warning", "count": 1}
    device: dict[str, Any] = {"category": "device", "clause": "4.4.3 status table", "cause": ""}
    findings = (
        finding("TYP-306", 700.9, title="Error mode", text="Operating -> Error mode", **device | {"count": 1}),
        finding("TRF-003", 600.4, 604.1, node=25, label="ch6", fails=True),
        finding(
            "TRF-010",
            310.2,
            988.0,
            node=25,
            label="ch6",
            title="Transfer CRC mismatch",
            cause="corrupted",
            text="CRC 0x2C11 received, 0x9A04 computed",
            count=48,
            waiver=Waiver("known cable, replaced in May", "j.doe", "2026-06-30"),
        ),
        finding("TYP-305", 697.4, 705, title="Device fault bit set", text="MOS overtemperature", **warning | device),
        finding("BUS-028", 702, title="Throttle and speed disagree", text="100 % commanded, 0 rpm", **warning | device),
        finding(
            "BUS-001",
            740,
            741,
            title="Too many frames while motors turn",
            node=None,
            label="",
            type="",
            clause="4.4.4 expl. 3",
            cause="",
            text="2688 frames in 1 s, limit 2400; most: node 24 ESCStatus 900",
            baseline="new",
            examples=(),
            **warning,
        ),
        finding(
            "CAN-018",
            2,
            1190,
            title="Foreign 29-bit traffic",
            severity="note",
            category="protocol",
            origin="heuristic",
            clause="-",
            node=None,
            label="",
            type="",
            cause="",
            text="40 frames of 18FEF100",
            examples=(Example(9, T0, "", ("(1773475330.100000) can0 18FEF100#FFFFFFFF", "no candump line")),),
        ),
    )
    rules = [
        replace(r, verdict="FAIL", findings=1, title="A frame was lost") if r.rule in ("TRF-003", "TRF-010") else r
        for r in clean.rules
    ]
    rules += [
        rule("TYP-306", "Error mode", "FAIL", category="device", findings=1),
        rule("TYP-305", "Device fault bit set", "WARN", severity="warning", category="device", findings=1),
        rule("BUS-028", "Throttle and speed disagree", "WARN", severity="warning", category="device", findings=1),
        rule("BUS-001", "Too many frames while motors turn", "WARN", severity="warning", findings=1),
    ]
    capture = replace(
        clean.captures[0],
        path="crash flight 3.log",
        buses=(use,),
        nodes=tuple(nodes),
        damage="the last line is cut",
        accounting={"lines": use.frames + 3, "frames": use.frames, "error_frames": 0, "unreadable": 3},
    )
    return replace(
        clean,
        captures=(capture,),
        findings=findings,
        rules=tuple(rules),
        gate=Gate(
            ("protocol:error",),
            failed=True,
            judged=True,
            exit_status=1,
            reason="TRF-003 is at or above protocol:error",
            requirements=(
                Requirement("8 ESCs", met=True, found="8 ESCs"),
                Requirement("60 s with motors running", met=False, found="12 s"),
            ),
        ),
    )


def hostile(text: str) -> Report:
    """A report in which everything that a capture or a profile can say says `text`."""
    base = faulty()
    example = Example(1, T0, text, (text, LINES[0].replace("can0", text)))
    changes: dict[str, Any] = dict.fromkeys(("bus", "label", "type", "key", "cause", "text", "title"), text)
    found = finding("TRF-003", examples=(example,), waiver=Waiver(text, text, text), **changes)
    use = replace(base.captures[0].buses[0], name=text, limits={text: 2400})
    who = replace(node(20, 1), bus=text, label=text, name=text, role=text, software=text, types={text: 1})
    capture = replace(
        base.captures[0],
        path=text,
        form=text,
        damage=text,
        accounting={text: 1},
        verdicts={text: 1},
        dialects={text: {text: text}},
        buses=(use, replace(use, name=text + "2")),
        nodes=(who, replace(who, bus="other")),
    )
    return replace(
        base,
        settings={text: text, "scope": {text: [text]}},
        captures=(capture,),
        findings=(found,),
        rules=(rule("TRF-003", text, "FAIL", reason=text),),
        coverage=Coverage({text: 1}, {text: 0}, {text: {text: 1}}, {text: "PASS"}, (text,)),
        gate=replace(base.gate, reason=text, requirements=(Requirement(text, met=False, found=text),)),
    )


def long(count: int = 5000, text: str = "frame 2 of 3 is missing") -> Report:
    """Many findings, each with 20 examples."""
    base = faulty()
    severities = ("error", "warning", "note")
    found = tuple(
        replace(
            finding(f"TRF-{k % 31:03}", k * LENGTH / count, node=20 + k % 8, label=f"ch{k % 8 + 1}", text=text),
            severity=severities[k * 3 // count],
            frames=tuple(range(1, 21)),
            examples=(Example(1, T0, text, LINES),) * 20,
        )
        for k in range(count)
    )
    return replace(base, findings=found)
