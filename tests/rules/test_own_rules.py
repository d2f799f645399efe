"""Rules of vehicle files: the ten of the manual, each with a capture that breaks it and one that nearly does; laws."""

from __future__ import annotations

import json
from functools import cache
from typing import TYPE_CHECKING

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit.flight import Vehicle
from kit.judged import judge, outcome, registry
from kit.pages import ROOT, blocks
from kit.strategies import examples

import analyzer
from analyzer.cli import main
from analyzer.rules.catalogue import load as load_pages
from analyzer.rules.vehicle.expected import load

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from analyzer.rules.vehicle.own import OwnRules
ALIVE = "uavcan.protocol.NodeStatus"
RESTART = "({}) can0 1E058BFE#1E1B55CEACC0\n"
TEN = [block.text for block in blocks(ROOT / "analyzer/manual/own-rules.md") if block.kind == "toml"][-1]


@pytest.fixture(scope="module")
def ten(tmp_path_factory: pytest.TempPathFactory) -> OwnRules:
    return own(TEN, tmp_path_factory.mktemp("ten"))


def own(text: str, folder: Path) -> OwnRules:
    path = folder / "vehicle.toml"
    path.write_text(text)
    found = load(path, load_pages(registry()), registry()).own
    assert found is not None
    return found


def found(text: str, rules: OwnRules, step: int | None = None) -> list[tuple[str, int, str, int]]:
    """Rule, node, key, count of what rules of one's own find."""
    names = tuple(one.rule for one in rules.rules)
    ignore = tuple(load_pages(registry()))
    return [
        (one.rule, one.node, one.key, one.count)
        for one in judge(text, None, step, own=rules, ignore=ignore)
        if one.rule in names
    ]


def flight(fly: Callable[[Vehicle], None]) -> str:
    vehicle = Vehicle()
    fly(vehicle)
    return vehicle.finish()


def _heat(per_second: float) -> Callable[[Vehicle], None]:
    return lambda v: [v.status(k * 250, temperature=40 + per_second * k / 4) for k in range(32)] and None


def _sag(*parts: tuple[int, float]) -> Callable[[Vehicle], None]:
    def fly(v: Vehicle) -> None:
        ms = 0
        for lasts, volts in parts:
            v.statuses(ms, ms + lasts, period=100, voltage=volts)
            ms += lasts

    return fly


def _draw(current: float, pct: int) -> Callable[[Vehicle], None]:
    return lambda v: v.statuses(0, 300, current=current, power_rating_pct=pct) and None


def _up(*uptimes: int) -> Callable[[Vehicle], None]:
    def fly(v: Vehicle) -> None:
        well = dict.fromkeys(("health", "mode", "sub_mode", "vendor_specific_status_code"), 0)
        for k, uptime in enumerate(uptimes):
            v.send(k * 1000, ALIVE, 11, well | {"uptime_sec": uptime})

    return fly


def _telemetry(until: int) -> Callable[[Vehicle], None]:
    def fly(v: Vehicle) -> None:
        v.commands(0, 2000, 500)
        v.statuses(5, until)
        v.statuses(7, 2000, 12)

    return fly


def _follow(lasts: int, cmd: int, rpm: int = 0) -> Callable[[Vehicle], None]:
    def fly(v: Vehicle) -> None:
        v.commands(0, lasts, cmd)
        v.statuses(5, lasts, rpm=rpm)

    return fly


def _health(health: int) -> Callable[[Vehicle], None]:
    rest = {"mode": 0, "sub_mode": 0, "vendor_specific_status_code": 0}
    return lambda v: v.send(0, ALIVE, 11, rest | {"health": health, "uptime_sec": 9}) and None


def _timing(*values: int) -> Callable[[Vehicle], None]:
    return lambda v: [v.parameters(k * 500, esc_timing=value) for k, value in enumerate(values)] and None


def _silence(ms: int) -> Callable[[Vehicle], None]:
    def fly(v: Vehicle) -> None:
        v.statuses(0, 1000)
        v.statuses(1000 + ms, 3500)
        v.statuses(3, 3500, 12)

    return fly


CASES: dict[str, tuple[Callable[[Vehicle], None], Callable[[Vehicle], None], list[tuple[int, str, int]]]] = {
    "ACME-001": (_heat(5), _heat(3.9), [(11, "of=ch1", 12)]),
    "ACME-002": (
        _sag((500, 50), (2400, 43.5), (500, 50)), _sag((2000, 43.5), (100, 44.5), (2000, 43.5)), [(11, "of=ch1", 4)]
    ),
    "ACME-003": (_draw(30, 50), _draw(30, 60), [(11, "of=ch1", 15)]),
    "ACME-004": (_up(7, 8, 9, 10, 0, 1, 12), _up(7, 8, 9, 10, 11), [(11, "", 2)]),
    "ACME-005": (_telemetry(600), _telemetry(2000), [(1, "", 2)]),
    "ACME-006": (_follow(1300, 1100), _follow(1000, 1100), [(11, "of=ch1", 15)]),
    "ACME-007": (_health(1), _health(0), [(11, "", 1)]),
    "ACME-008": (_timing(15, 15, 20, 20), _timing(15, 15, 15), [(11, "", 1)]),
    "ACME-009": (_silence(1100), _silence(900), [(11, "of=ch1", 1)]),
}  # fmt: skip


@pytest.mark.parametrize("rule", CASES)
def test_the_ten_of_the_manual(rule: str, ten: OwnRules) -> None:
    breaks, nearly, expected = CASES[rule]
    text = flight(breaks)
    for step in (None, 29):
        assert [one for one in found(text, ten, step) if one[0] == rule] == [(rule, *one) for one in expected]
    assert [one for one in found(flight(nearly), ten) if one[0] == rule] == []


def test_what_must_never_appear(ten: OwnRules) -> None:
    hover = flight(lambda v: v.statuses(0, 100) and None)
    assert found(hover, ten) == []
    assert found(hover + RESTART.format("1773475331.0"), ten) == [("ACME-010", 126, "", 1)]


TURN = """
[rule.ACME-1]
title = "The motor does not follow"
when = 'PUSHSCI.OutputControl.control_mode == "speed"'
then = "within(PUSHCAN.MotorStatus.speed, PUSHSCI.OutputControl.set_point, 10 %)"
within = "500 ms"
"""


@pytest.mark.parametrize(("speeds", "keys"), [((4500, 4600), []), ((4500, 900), ["of=unit 2"])])
def test_each_unit_of_a_gateway_follows_by_itself(speeds: tuple[int, int], keys: list[str], tmp_path: Path) -> None:
    """Packets of one node: what one unit says answers no demand of another one."""

    def fly(v: Vehicle) -> None:
        for k in range(20):
            for unit in (0, 1):
                at, number = k * 50 + unit * 7, 0xA1 + unit
                v.push(at, "PUSHSCI.OutputControl", 1, number, control_mode=0x33, set_point=4500)
                v.push(at + 3, "PUSHCAN.MotorStatus", 30, number, speed=speeds[unit])

    rules = own(TURN, tmp_path)
    for step in (None, 1):
        assert [one[2] for one in found(flight(fly), rules, step)] == keys


def test_what_was_is_that_of_the_same_row(tmp_path: Path) -> None:
    """Several senders in a batch, among other rows: each is compared with itself."""

    def fly(v: Vehicle) -> None:
        v.commands(0, 1000, 100)
        for node in (11, 12, 13):
            v.statuses(node, 1000, node, rpm=100 * node)
        v.status(1001, 12, rpm=7)

    rules = own('[rule.ACME-1]\ntitle = "t"\nwhen = "ESCStatus.rpm != lag(ESCStatus.rpm, 10 ms)"\n', tmp_path)
    for step in (None, 5):
        assert found(flight(fly), rules, step) == [("ACME-1", 12, "of=ch2", 1)]


SPEED = """
[rule.ACME-1]
title = "ch1 does not follow"
when = "RawCommand.cmd[0] > 100"
then = "ESCStatus.esc_index == 0 && within(ESCStatus.rpm, RawCommand.cmd[0], 10 %)"
within = "300 ms"
"""


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("commands", "rpm", "count"),
    [
        ([(0, 1000)], 1000, 0),
        ([(0, 1000)], 1110, 3),
        ([(0, 50)], 5000, 0),
        ([(k * 10, 1000 + k * 20) for k in range(100)], 0, 0),  # a new command every time: each has its 300 ms
        ([(0, 1000), (200, 50)], 0, 0),  # taken back in time
        ([(0, 1000), (320, 50)], 0, 1),
    ],
)
def test_a_demand_compares_with_what_was_demanded(
    commands: list[tuple[int, int]], rpm: int, count: int, tmp_path: Path
) -> None:
    def fly(v: Vehicle) -> None:
        ends = [*(start for start, _ in commands[1:]), max(1000, commands[-1][0] + 10)]
        for (start, value), end in zip(commands, ends, strict=True):
            v.commands(start, end, value)
        v.statuses(5, 1000, rpm=rpm)

    rules = own(SPEED, tmp_path)
    for step in (None, 3):
        assert sum(one[3] for one in found(flight(fly), rules, step)) == count


def test_a_demand_that_was_never_made_is_not_exercised(tmp_path: Path) -> None:
    rules = own(SPEED, tmp_path)
    assert "demand:ACME-1" not in outcome(flight(lambda v: v.commands(0, 900, 50) and None), own=rules).words
    assert "demand:ACME-1" in outcome(flight(_follow(900, 1000, 1000)), own=rules).words


def test_a_silent_bus_breaks_no_demand(ten: OwnRules) -> None:
    def fly(v: Vehicle) -> None:
        v.statuses(0, 1000)
        v.statuses(9000, 9500)

    assert [one for one in found(flight(fly), ten) if one[0] == "ACME-009"] == []


LASTING = '[rule.ACME-1]\ntitle = "t"\nwhen = "ESCStatus.voltage < 44"\nfor = "{} ms"\n'
Report = tuple[int, int, bool]  # node, ms since the one before, low


@cache
def _lasting(ms: int, folder: Path) -> OwnRules:
    return own(LASTING.format(ms), folder)


@given(st.lists(st.tuples(st.sampled_from((11, 12)), st.integers(3, 4000), st.booleans()), max_size=20), st.data())
@examples(40)
def test_what_lasts_is_what_a_plain_loop_says(
    tmp_path_factory: pytest.TempPathFactory, reports: list[Report], data: st.DataObject
) -> None:
    lasts, step = data.draw(st.sampled_from((1, 500, 2000, 5000))), data.draw(st.integers(1, 7))
    vehicle, ms = Vehicle(), 0
    sent = []
    for node, after, low in reports:
        ms += after
        vehicle.status(ms, node, voltage=43.0 if low else 50.0)
        sent.append((node, ms, low))
    expected: dict[int, int] = {}
    for node in (11, 12):
        since = last = None
        for t, low in ((t, low) for who, t, low in sent if who == node):
            if not low:
                since = None
                continue
            since = t if since is None or last is None or t - last > max(3000, lasts) else since
            last = t
            if t - since >= lasts:
                expected[node] = expected.get(node, 0) + 1
    rules = _lasting(lasts, tmp_path_factory.getbasetemp())
    text = vehicle.finish()
    for cut in (None, step):
        counts: dict[int, int] = {}
        for _, node, _, count in found(text, rules, cut):
            counts[node] = counts.get(node, 0) + count
        assert counts == expected


@pytest.mark.slow
def test_everywhere(tmp_path: Path, command: Callable[..., tuple[int, str, str]]) -> None:
    path, log = tmp_path / "vehicle.toml", "captures/pack-sag.log"
    path.write_text(TEN)
    given = ["--vehicle", str(path), "--select", "ACME"]
    report = analyzer.check(log, vehicle=path, select=["ACME"])
    verdicts = {one.rule: one.verdict for one in report.rules if one.rule.startswith("ACME")}
    assert {verdicts["ACME-001"], verdicts["ACME-002"], verdicts["ACME-008"]} == {"PASS", "WARN"}
    assert verdicts["ACME-010"] == "NOT EXERCISED"
    (finding,) = [one for one in report.findings if one.rule.startswith("ACME")]
    assert (finding.rule, finding.origin, finding.category) == ("ACME-002", "vehicle", "device")
    xml, data = tmp_path / "report.xml", tmp_path / "report.json"
    command("check", log, *given, "--junit", xml, "--json", data)
    schema = json.loads((ROOT / "analyzer/report/schema.json").read_text())
    jsonschema.Draft202012Validator(schema).validate(json.loads(data.read_text()))
    assert 'classname="ACME.' in xml.read_text()
    table = analyzer.open_capture(log).findings(vehicle=path, select=["ACME"])
    assert table.column("rule").to_pylist() == ["ACME-002"]
    path.write_text(TEN + WAIVER)
    assert "WAIVED" in {one.verdict for one in analyzer.check(log, vehicle=path, select=["ACME"]).rules}
    marked = command("decode", log, "--vehicle", str(path), "--findings", "-Y", 'finding.rule == "ACME-002"')
    assert "[ACME-002 TYP-305]" in marked[1]


WAIVER = """
[[waiver]]
rule = "ACME-002"
reason = "an old pack"
owner = "bench"
expires = 2099-01-31
"""


def test_its_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "vehicle.toml"
    path.write_text(TEN)
    assert main(["explain", "ACME-002", "--vehicle", str(path)]) == 0
    page = capsys.readouterr().out
    assert page.startswith("ACME-002  The pack sags")
    assert "ESCStatus.voltage < 44 V, for 2 s" in page
