"""Vehicle files: what they say, and every mistake with its line."""

from __future__ import annotations

from datetime import date
from typing import TYPE_CHECKING

import pytest
from kit.judged import registry

from analyzer.rules.catalogue import load as load_pages
from analyzer.rules.settings import Settings
from analyzer.rules.vehicle.expected import load
from dissectors import ProfileError, Registry

if TYPE_CHECKING:
    from pathlib import Path

    from analyzer.rules.vehicle.expected import Expected

PAGES = load_pages(registry())
WHOLE = """\
name = "hexa"
bit_rate = 500000
escs = 6
[node.11]
label = "front left"
rates = { ESCStatus = 50, "uavcan.protocol.NodeStatus" = 0.5 }
[unit]
0xA1 = 11
[rule.BUS-001]
severity = "note"
limit_per_s = 2000
[rule.PUSH-406]
enabled = true
[rule.TYP-308]
min_temperature_degc = -40.0
[[waiver]]
rule = "TRF-016"
node = 11
type = "ESCStatus"
reason = "known"
owner = "bench"
expires = 2027-01-31
[require]
types = ["ESCStatus"]
rules = ["TRF-010"]
escs = 6
running_s = 30
"""


def vehicle(tmp_path: Path, text: str) -> Expected:
    path = tmp_path / "vehicle.toml"
    path.write_text(text)
    return load(path, PAGES, registry())


def test_everything_that_a_file_can_say(tmp_path: Path) -> None:
    found = vehicle(tmp_path, WHOLE)
    assert (found.name, found.bit_rate, found.escs, found.units) == ("hexa", 500_000, 6, {0xA1: 11})
    assert found.nodes[11].label == "front left"
    assert found.nodes[11].rates == {"ESCStatus": 50.0, "uavcan.protocol.NodeStatus": 0.5}
    assert found.numbers == {"BUS-001": {"limit_per_s": 2000.0}, "TYP-308": {"min_temperature_degc": -40.0}}
    assert found.severities == {"BUS-001": "note"}
    assert found.enabled == {"PUSH-406": True}
    assert found.demand.types == ("ESCStatus",)
    assert (found.demand.rules, found.demand.escs, found.demand.running_s) == (("TRF-010",), 6, 30.0)


def test_names_of_types_mean_what_they_mean_everywhere(tmp_path: Path) -> None:
    text = """\
[node.11]
rates = { NodeStatus = 1 }
[[waiver]]
rule = "TYP-001"
type = "uavcan.protocol.NodeStatus"
reason = "known"
owner = "bench"
expires = 2027-01-31
[[waiver]]
rule = "TYP-001"
type = "type 20100"
reason = "known"
owner = "bench"
expires = 2027-01-31
[require]
types = ["NodeStatus", "PUSHCAN.MotorStatus", "MotorStatus"]
"""
    found = vehicle(tmp_path, text)
    assert found.nodes[11].rates == {"uavcan.protocol.NodeStatus": 1.0}
    assert found.demand.types == ("uavcan.protocol.NodeStatus", "MotorStatus", "MotorStatus")
    for kind in ("NodeStatus", "uavcan.protocol.NodeStatus", "type 20100"):
        assert found.excuse("TYP-001", 3, kind, date(2027, 1, 1)) is not None


def test_without_a_profile_that_says_how_many_any_number_of_escs_will_do(tmp_path: Path) -> None:
    plain = Registry([profile for profile in registry().profiles if not list(profile.having("packets"))])
    path = tmp_path / "vehicle.toml"
    path.write_text("escs = 30\n[unit]\n0xB1 = 12\n")
    found = load(path, PAGES, plain)
    assert (found.escs, found.units) == (30, {0xB1: 12})


def test_the_command_line_goes_before_the_file(tmp_path: Path) -> None:
    found = vehicle(tmp_path, WHOLE)
    asked = found.settings(Settings(bit_rate=125_000), PAGES)
    assert (asked.bit_rate, asked.numbers["BUS-001"]["limit_per_s"]) == (125_000, 2000.0)
    assert asked.select is not None
    assert set(asked.select) == {rule for rule, page in PAGES.items() if page.enabled} | {"PUSH-406"}
    assert found.settings(Settings(select={"TRF-010"}), PAGES).select == {"TRF-010"}
    assert found.settings(Settings(), PAGES).bit_rate == 500_000


@pytest.mark.parametrize(
    ("rule", "node", "kind", "day", "covered"),
    [
        ("TRF-016", 11, "ESCStatus", date(2027, 1, 31), True),
        ("TRF-016", 11, "ESCStatus", date(2027, 2, 1), False),
        ("TRF-016", 12, "ESCStatus", date(2026, 1, 1), False),
        ("TRF-016", 11, "RawCommand", date(2026, 1, 1), False),
        ("TRF-010", 11, "ESCStatus", date(2026, 1, 1), False),
    ],
)
def test_a_waiver_covers_what_it_names_until_its_day(
    tmp_path: Path, rule: str, node: int, kind: str, day: date, covered: bool
) -> None:
    excuse = vehicle(tmp_path, WHOLE).excuse(rule, node, kind, day)
    assert (excuse is not None) == covered


@pytest.mark.parametrize(
    ("text", "line", "reason"),
    [
        ("bit_rate = 0", 1, "outside 1 to"),
        ("name = 'x'\nspeed = 3", 2, "unknown key"),
        ("[node.128]\nlabel = 'x'", 1, "node ID from 1 to 127"),
        ("[node.one]", 1, "whole number"),
        ("[rule.TRF-099]\nseverity = 'note'", 1, "no rule is called 'TRF-099' (near: TRF-0"),
        ("[rule.TRF-010]\nseverity = 'bad'", 2, "allowed: error, warning, note"),
        ("[rule.BUS-001]\nlimit_per_s = -1", 2, "number from 0 on"),
        ("[rule.BUS-001]\nlimit = 1", 2, "unknown key (allowed: enabled, limit_per_s, severity)"),
        ("[[waiver]]\nrule = 'TRF-010'\nreason = 'x'\nowner = 'y'", 1, "expires is missing"),
        ("[[waiver]]\nrule = 'TRF-010'\nreason = 'x'\nowner = 'y'\nexpires = 'soon'", 5, "a day like 2027-01-31"),
        ("[require]\nrules = ['X']", 2, "no rule is called 'X'"),
        ("[require\n", 1, "Expected"),
        ("[require]\ntypes = ['ESCStatu']", 2, "no message is called 'ESCStatu' (near: ESCStatus"),
        ("[node.12]\nlabel = 'x'\nrates = { Foo = 3 }", 3, "no message is called 'Foo'"),
        ("[unit]\n0xA9 = 11\n0xB1 = 12", 3, "power unit from 0xA1 to 0xA9"),
        ("escs = 21", 1, "outside 0 to 20"),
        ("[require]\nescs = 21", 2, "outside 0 to 20"),
        ("[[waiver]]\nrule = 'TRF-010'\ntype = 'Bar'\nexpires = 2027-01-31", 3, "no message is called 'Bar'"),
    ],
)
def test_a_mistake_is_told_with_its_line(tmp_path: Path, text: str, line: int, reason: str) -> None:
    with pytest.raises(ProfileError) as error:
        vehicle(tmp_path, text)
    assert str(error.value).startswith(f"{tmp_path / 'vehicle.toml'}:{line}: ")
    assert reason in error.value.reason
