"""JUnit XML by the rules that its readers share: elements, attributes, counts, names that stay the same."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree as ET

import pytest
from hypothesis import example, given
from kit import reports
from kit.reports import NASTY, TEXTS

from analyzer.report import junit
from analyzer.report.model import Example

# What may stand in an element, and the attributes that it must have.
INSIDE = {
    "testsuites": ("testsuite",),
    "testsuite": ("properties", "testcase"),
    "properties": ("property",),
    "testcase": ("failure", "skipped", "system-out"),
    "property": (), "failure": (), "skipped": (), "system-out": (),
}  # fmt: skip
COUNTS = ("tests", "failures", "errors", "skipped")
ATTRIBUTES = {
    "testsuites": {"name", *COUNTS}, "testsuite": {"name", "time", *COUNTS}, "properties": set(),
    "testcase": {"classname", "name", "time"}, "property": {"name", "value"}, "failure": {"type", "message"},
    "skipped": {"message"}, "system-out": set(),
}  # fmt: skip


def parsed(text: str) -> ET.Element:
    """The root of a document that keeps all rules; a parser of XML 1.0 refuses forbidden characters by itself."""
    root = ET.fromstring(text.encode())
    assert root.tag == "testsuites"
    for element in root.iter():
        assert set(element.attrib) == ATTRIBUTES[element.tag]
        assert {child.tag for child in element} <= set(INSIDE[element.tag])
        if element.tag in ("testsuite", "testsuites"):
            cases = list(element.iter("testcase"))
            failed, skipped = (sum(case.find(tag) is not None for case in cases) for tag in ("failure", "skipped"))
            assert [int(element.get(name, "")) for name in COUNTS] == [len(cases), failed, 0, skipped]
        elif element.tag == "testcase":
            assert len(element) <= 1
        elif element.tag == "properties":
            assert len(element) > 0
    names = [(case.get("classname"), case.get("name")) for case in root.iter("testcase")]
    assert len(set(names)) == len(names)
    return root


def case(root: ET.Element, classname: str, name: str) -> ET.Element:
    (found,) = [one for one in root.iter("testcase") if (one.get("classname"), one.get("name")) == (classname, name)]
    return found


@pytest.mark.parametrize("name", reports.SAMPLES)
def test_samples_keep_the_rules(name: str) -> None:
    report = reports.SAMPLES[name]()
    text = junit.render(report)
    root = parsed(text)
    assert text == junit.render(reports.SAMPLES[name]())
    failed = {
        one.get("classname", "").partition(".")[0] for one in root.iter("testcase") if one.find("failure") is not None
    }
    assert bool(failed - {"gate"}) == report.gate.failed
    assert bool(failed) == (report.gate.exit_status != 0)


def test_a_case_for_rule_node_and_type() -> None:
    root = parsed(junit.render(reports.faulty()))
    failure = case(root, "TRF.node25", "TRF-003 ESCStatus").find("failure")
    assert failure is not None
    assert failure.get("type") == "TRF-003"
    body = (failure.text or "").splitlines()
    assert "clause 4.1.3 Toggle" in body
    assert "3x, first 2026-03-14 12:49:55.490 UTC, last 2026-03-14 12:49:58.490 UTC" in body
    assert "tailbyte decode crash.log --around 41658575+-50ms" in body
    assert body[-1] == "  (1773492594.890000) can0 1504021A#A75A4C02CF000040"
    device = case(root, "TYP.node24", "TYP-306 ESCStatus")
    assert [child.tag for child in device] == ["system-out"], "an error that the gate lets pass"
    assert [child.tag for child in case(root, "BUS.bus", "BUS-001")] == ["system-out"]
    assert len(case(root, "CAP.all", "CAP-003")) == 0
    skipped = [case(root, *name).find("skipped") for name in (("TYP.all", "TYP-011"), ("CAN.all", "CAN-004"))]
    reasons = [one.get("message") for one in skipped if one is not None]
    assert reasons == ["not exercised: no unions seen", "inconclusive: error frames not recorded"]


def test_names_do_not_change_with_time_and_count() -> None:
    early = reports.report(reports.finding("TRF-003", 0, type="ESCStatus", key="1", text="a"))
    later = reports.report(
        reports.finding("TRF-003", 10**12, type="ESCStatus", key="2", text="b", frame=99, count=7, severity="warning"),
        reports.finding("TRF-003", 10**13, type="ESCStatus", key="3"),
    )
    names = [
        [(one.get("classname"), one.get("name")) for one in parsed(junit.render(r)).iter("testcase")]
        for r in (early, later)
    ]
    assert names[0] == names[1]


def test_waivers_requirements_and_damage() -> None:
    root = parsed(junit.render(reports.waived()))
    waived = case(root, "TRF.node24", "TRF-003 ESCStatus").find("skipped")
    assert waived is not None
    assert waived.get("message") == "waived until 2026-12-31 by Ada: known since V2.2.05"
    assert case(root, "gate", "requires 1 8 ESCs").find("failure") is not None
    assert case(root, "gate", "requires 2 BUS-001").find("failure") is None
    damaged = case(parsed(junit.render(reports.damaged())), "gate", "whole torn.mcap").find("failure")
    assert damaged is not None
    assert damaged.text == "torn.mcap: ends inside chunk 7"
    assert case(parsed(junit.render(reports.empty())), "gate", "judged").find("failure") is not None


def test_captures_are_told_apart() -> None:
    root = parsed(junit.render(reports.two_captures()))
    assert [suite.get("name") for suite in root] == ["gate", "crash.log", "second flight.log", "rules"]
    assert case(root, "TRF.node24", "TRF-003 ESCStatus can1 in second flight.log").find("failure") is not None


def test_twenty_examples() -> None:
    examples = tuple(Example(k, None, f"example {k}", (f"line {k}",) * 50) for k in range(1, 40))
    failure = parsed(junit.render(reports.report(reports.finding("TRF-003", examples=examples)))).find(".//failure")
    assert failure is not None
    body = failure.text or ""
    assert "frame 20: example 20\n" in body
    assert "example 21" not in body
    assert body.count("  line 20\n") == 40
    assert body.count("and 10 more frames") == 20


@pytest.mark.slow
def test_it_stays_below_30_megabytes(monkeypatch: pytest.MonkeyPatch) -> None:
    assert junit.MOST_BYTES == 30_000_000
    text = "<&>" * 2000
    examples = tuple(Example(k, None, text, (text,) * 40) for k in range(1, 21))
    notes = [reports.finding("CAN-013", node=k % 128, type=f"N{k}", text=text, examples=examples) for k in range(40)]
    found = [*(reports.finding("TRF-003", node=k % 128, type=f"T{k}", text=text) for k in range(200)), *notes]
    monkeypatch.setattr(junit, "MOST_BYTES", 300_000)
    monkeypatch.setattr(junit, "_BODIES", 200_000)
    monkeypatch.setattr(junit, "_RESERVE", 20_000)
    got = junit.render(reports.report(*notes, *found[:200]))
    assert len(got.encode()) < 300_000
    root = parsed(got)
    named = {one.get("name") for one in root.iter("testcase")}
    assert "TRF-003 T0" in named, "errors come before notes, wherever they stand"
    assert "CAN-013 N39" not in named
    assert "more cases would not fit" in got
    bodies = [len(one.text or "") > 0 for one in root.iter("failure")]
    assert bodies[0]
    assert not bodies[-1], "the last ones have no body"


@given(TEXTS)
@example("".join(NASTY))
@example("".join(map(chr, range(0x20))) + "\ufffe\uffff]]>")
def test_hostile_texts(nasty: str) -> None:
    text = junit.render(reports.hostile(nasty))
    assert text.startswith('<?xml version="1.0" encoding="UTF-8"?>\n<testsuites ')
    root = parsed(text)
    if nasty:
        plain = parsed(junit.render(reports.hostile("plain")))
        assert [one.tag for one in root.iter()] == [one.tag for one in plain.iter()]
    assert "##[" not in text


def test_a_text_is_cut() -> None:
    root = parsed(
        junit.render(reports.report(replace(reports.finding("TRF-003"), text="\u0301" * 10_000, title="x" * 10_000)))
    )
    assert max(len(value) for one in root.iter() for value in one.attrib.values()) == 500
