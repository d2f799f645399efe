"""ESCs that are switched off after landing, and requests to them."""

from __future__ import annotations

from json import loads
from typing import TYPE_CHECKING

import jsonschema
import pytest
from kit.flight import Vehicle, found, node_status
from kit.judged import whole

import analyzer
from analyzer.report import json, markdown, text
from analyzer.report.html import page as html

if TYPE_CHECKING:
    from pathlib import Path

NODES = (11, 12, 13, 14)


def landed(*, rpm: int = 0, last: float = 3000, apart: float = 20, stays: int = 0) -> Vehicle:
    """Four ESCs report up to a time, each a little longer than the one before; the autopilot goes on."""
    vehicle = Vehicle()
    for k in range(90):
        vehicle.send(k * 100 + 3, "uavcan.protocol.NodeStatus", 1, node_status(k * 100))
    for k, node in enumerate(NODES):
        vehicle.statuses(k, 9000 if node == stays else last + k * apart, node, rpm=rpm)
    return vehicle


def test_escs_that_fall_silent_together_at_rest_were_switched_off() -> None:
    said = whole(landed().finish(), ("BUS-042", "BUS-025", "BUS-035"), (7,))
    assert {one.rule for one in said} == {"BUS-042"}
    off = [one for one in said if one.rule == "BUS-042"]
    assert [(one.node, one.severity) for one in off] == [(node, "note") for node in NODES]
    assert off[0].text == "4 ESCs silent together at 0 rpm, 5.9 s to the end"


@pytest.mark.sampled(4)
@pytest.mark.parametrize("what", [{"rpm": 900}, {"apart": 2000}, {"stays": 14}, {"last": 8500}])
def test_escs_that_turn_or_go_one_by_one_have_dropped_out(what: dict[str, int]) -> None:
    vehicle = landed(**what)
    assert found(vehicle, "BUS-042") == []
    assert {one.severity for one in found(vehicle, "BUS-025")} <= {"warning"}


def unanswered(vehicle: Vehicle, at: float) -> list[str]:
    vehicle.configure(at, esc_index=0, esc_timing=15)
    return [one.severity for one in whole(vehicle.finish(), ("BUS-011",), (7,))]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("at", [3070, 3500, 5900, 6500])
def test_who_has_just_been_switched_off_owes_no_answer(at: float) -> None:
    assert unanswered(landed(), at) == []


@pytest.mark.sampled(4)
@pytest.mark.parametrize("what", [{"rpm": 900}, {"stays": 14}, {"last": 8500}])
def test_who_turns_or_goes_on_owes_one(what: dict[str, int]) -> None:
    assert unanswered(landed(**what), 3500) == ["error"]


def test_one_esc_alone_may_have_failed() -> None:
    vehicle = Vehicle()
    vehicle.statuses(0, 3000, 11, rpm=0)
    for k in range(90):
        vehicle.send(k * 100 + 3, "uavcan.protocol.NodeStatus", 1, node_status(k * 100))
    assert unanswered(vehicle, 3500) == ["error"]


def test_a_drop_out_before_is_told() -> None:
    vehicle = Vehicle()
    for k in range(90):
        vehicle.send(k * 100 + 3, "uavcan.protocol.NodeStatus", 1, node_status(k * 100))
    for k, node in enumerate(NODES):
        vehicle.statuses(k, 2000, node)
        vehicle.statuses(4500 + k if node == 12 else 2000 + k, 6500, node, rpm=0)
    said = [one for one in whole(vehicle.finish(), ("BUS-042", "BUS-025"), (7,)) if one.rule == "BUS-025"]
    assert [(one.node, one.severity) for one in said] == [(12, "warning")]


def test_a_power_off_is_an_event_and_no_finding(tmp_path: Path) -> None:
    path = tmp_path / "landed.log"
    path.write_text(landed().finish())
    report = analyzer.check(path, select=["BUS-042", "BUS-025", "BUS-035"])
    assert report.findings == ()
    assert [(one.rule, one.node, one.label, one.text) for one in report.events] == [
        ("BUS-042", node, f"ch{k}", "4 ESCs silent together at 0 rpm, 5.9 s to the end")
        for k, node in enumerate(NODES, 1)
    ]
    assert [(one.rule, one.verdict, one.findings) for one in report.rules if one.rule == "BUS-042"] == [
        ("BUS-042", "PASS", 0)
    ]
    jsonschema.validate(loads(json.render(report)), json.schema())
    assert [one["node"] for one in loads(json.render(report))["events"]] == [*NODES]
    said = "ESCs were switched off"
    assert f"event    BUS-042 {said}: ch1 node 11, ch2 node 12" in text.render(report)
    assert text.render(report).startswith("PASS ")
    assert all(said in write(report) for write in (html.render, markdown.render))


@pytest.mark.slow
def test_who_is_switched_off_owes_no_answer() -> None:
    off, on = landed(), landed(last=8990)
    for vehicle in (off, on):
        vehicle.configure(6500, esc_index=0, esc_timing=15)
        vehicle.send(6500, "uavcan.protocol.GetNodeInfo.Request", 1, {}, dst=11)
    rules = ("BUS-011", "TRF-022")
    assert whole(off.finish(), rules, (7,)) == []
    assert {one.rule for one in whole(on.finish(), rules, (7,))} == set(rules)
