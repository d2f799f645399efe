"""The sample flight of four Hobbywing ESCs, of which one gets too hot, in every command; and flights that are fine."""

from __future__ import annotations

import csv
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pyarrow.parquet as pq
import pytest
from kit import CAPTURES, encode, vendors
from kit.flight import ESCS, SECOND, START, Sender, hover
from kit.judged import judge, outcome, whole
from kit.pictures import draw
from kit.vendors import HOT, SPACE, reports

import analyzer

if TYPE_CHECKING:
    from pathlib import Path

LOG = CAPTURES / "hobbywing.log"
VENDOR = ("HW", "TYP")


def text(net: Sender) -> str:
    return "".join(encode.log_line(row.frame) + "\n" for row in net.rows() if row.frame)


def report(*given: tuple[str, dict[str, Any]], node: int = ESCS[0], **more: Any) -> str:
    """Thirty reports of each kind that are fine, and those that are `given` at last, one a tenth of a second."""
    net = Sender()
    for k in range(30):
        for name, fields in reports(ESCS[1], 100).items():
            net.send(k * 100, SPACE + name, node, fields)
    for k, (name, fields) in enumerate(given):
        net.send(3000 + k * 100, SPACE + name, node, fields, **more)
    return text(net)


def told(capture: str) -> list[tuple[str, str, int, str]]:
    return [(one.rule, one.severity, one.count, one.text) for one in judge(capture) if one.rule.startswith(VENDOR)]


def test_what_is_wrong_with_the_sample_flight() -> None:
    checked = analyzer.check(LOG)
    assert [(one.rule, one.severity, one.category, one.node, one.count) for one in checked.findings] == [
        ("HW-003", "error", "device", HOT, 1),
        ("HW-001", "warning", "device", HOT, 9),
        ("HW-001", "warning", "device", HOT, 4),
        ("HW-001", "warning", "device", HOT, 3),
    ]
    assert checked.findings[1].text == "temperature 105 degC at onset, 138 degC at worst, safe is below 105"


def test_an_esc_is_called_by_the_channel_that_it_answers() -> None:
    assert {one.label for one in analyzer.check(LOG).findings} == {"ch3"}
    assert outcome(LOG.read_bytes(), step=1).labels == {(0, node): f"ch{k}" for k, node in enumerate(ESCS, 1)}


def test_a_flight_without_the_heat_is_clean(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vendors, "HOT", 0)
    assert judge(text(vendors.flight())) == []


def test_on_a_bus_with_the_other_vendor_each_is_read_as_its_own() -> None:
    """T-Motor's flight and Hobbywing's on two buses of a capture: as much is found as of each alone."""
    rows = [row.frame for row in hover().rows()]
    rows += [replace(row.frame, bus="can1") for row in vendors.flight().rows()]
    both = "".join(encode.log_line(frame) + "\n" for frame in sorted(rows, key=lambda frame: frame.t))
    assert {one.rule for one in judge(both)} == {"HW-001", "HW-003"} | {one.rule for one in judge(text(hover()))}


@pytest.mark.parametrize(
    ("kind", "fields", "found"),
    [
        ("StatusMsg2", {"input_voltage": 480, "current": -20, "temperature": 104}, []),
        ("StatusMsg2", {"input_voltage": 0, "current": 10, "temperature": 105},
         [("HW-001", "warning", 1, "temperature 105 degC, safe is below 105")]),
        ("StatusMsg2", {"input_voltage": -1, "current": 10, "temperature": 30},
         [("TYP-013", "warning", 1, "input_voltage = -0.1 V, at least 0 allowed")]),
        ("StatusMsg3", {"MOS_T": 104, "CAP_T": 104, "Motor_T": 149}, []),
        ("StatusMsg3", {"MOS_T": 20, "CAP_T": 110, "Motor_T": 150},
         [("HW-001", "warning", 1, "CAP_T 110 degC, safe is below 105"),
          ("HW-002", "warning", 1, "Motor_T 150 degC, safe is below 150")]),
        ("RawCommand", {"command": [8191, -8191, 0]}, []),
        ("RawCommand", {"command": [0, -8192]},
         [("TYP-013", "warning", 1, "command = -8192, -8191 to 8191 allowed")]),
    ],
)  # fmt: skip
def test_limits(kind: str, fields: dict[str, Any], found: list[Any]) -> None:
    assert told(report((kind, fields))) == found


@pytest.mark.parametrize(
    ("service", "fields", "found"),
    [
        ("SetReportingFrequency.Request", {"option": 0, "MSG_ID": 20051, "rate": 0}, []),
        ("SetReportingFrequency.Request", {"option": 1, "MSG_ID": 20050, "rate": 12}, ["TYP-014 rate = 12"]),
        ("SetReportingFrequency.Request", {"option": 1, "MSG_ID": 20049, "rate": 9}, ["TYP-014 MSG_ID = 20049"]),
        ("SelfTest.Response", {"status": 0}, []),
        ("SelfTest.Response", {"status": 2}, ["HW-003 status 2"]),
    ],
)
def test_codes(service: str, fields: dict[str, Any], found: list[str]) -> None:
    got = [f"{rule} {said.partition(',')[0]}" for rule, _, _, said in told(report((service, fields), dst=20))]
    assert got == found


def test_the_rules_do_not_depend_on_batches() -> None:
    """`whole` judges in one batch and in batches of seven lines."""
    found = whole(LOG.read_text(), ("HW",), (7,))
    assert [(one.rule, one.node, one.count) for one in found] == [
        ("HW-003", HOT, 1), ("HW-001", HOT, 9), ("HW-001", HOT, 4), ("HW-001", HOT, 3),
    ]  # fmt: skip


def busy(**last: Any) -> str:
    """A second with more frames than T-Motor's document allows when motors rest; `last` is commanded behind it."""
    frames = [
        replace(frame, t=START + k * 230_000)
        for k in range(6000)
        for frame in encode.transfer(f"{SPACE}StatusMsg1", reports(11, 2000)["StatusMsg1"], 11 + k % 4, k // 4).frames()
    ]
    frames += [
        one for name, fields in last.items() for one in encode.transfer(name, fields, 1).frames(START + 2 * SECOND)
    ]
    return "".join(encode.log_line(frame) + "\n" for frame in frames)


def test_nobody_says_that_motors_rest_whose_messages_the_document_does_not_have() -> None:
    rules = ("BUS-001", "BUS-002", "BUS-003")
    assert whole(busy(), rules, (997,), bit_rate=500_000) == []
    found = whole(busy(RawCommand={"cmd": [0, 0]}), rules, (997,), bit_rate=500_000)
    assert {one.rule for one in found} == {"BUS-002", "BUS-003"}


VEHICLE = "escs = 4\n[node.12]\nrates = { StatusMsg1 = 20 }\n[require]\nescs = 4\nrunning_s = 2\n"


def test_a_vehicle_file_counts_escs_and_turning_motors(command: Any, tmp_path: Path) -> None:
    vehicle = tmp_path / "quad.toml"
    vehicle.write_text(VEHICLE)
    _, out, _ = command("check", str(LOG), "--vehicle", str(vehicle))
    lines = [line.split() for line in out.splitlines()]
    for words in (
        "expects 4 ESCs: met, found 4",
        "expects StatusMsg1 of node 12 at 20/s: met, found 20/s",
        "requires at least 4 ESCs: met, found 4",
        "requires motors turning for 2 s: met, found 2.8 s",
    ):
        assert words.split() in lines


@pytest.mark.parametrize("lines", [1, 50, 10_000])
def test_motors_turn_from_the_first_speed_on(lines: int) -> None:
    facts = outcome(LOG.read_bytes(), step=lines).facts
    assert facts["escs"] == 4
    assert facts["running_s"] == pytest.approx(2.779, abs=0.001)  # 0.201 to 2.980 s


def test_info_counts_the_reports(command: Any) -> None:
    _, out, _ = command("info", str(LOG), "--types")
    lines = [line.split()[:5] for line in out.splitlines()]
    for channel, node in enumerate(ESCS, 1):
        assert [str(node), str(channel), "GetEscID", "3", "-"] in lines
        for name, rate in (("StatusMsg1", 20), ("StatusMsg2", 10), ("StatusMsg3", 5)):
            assert [str(node), "-", name, f"{3 * rate}", f"{rate}.0"] in lines


def test_details_name_units_and_codes(command: Any) -> None:
    _, out, _ = command("decode", str(LOG), "-V", "-O", "GetMajorConfig.Response", "--frames", "66")
    for line in ("direction: no (clockwise)", "throttle_source: no (CAN)", "led_color: 4 (red)", "MSG1_rate: 5 (50"):
        assert line in out


def test_the_picture_has_a_line_for_each_esc() -> None:
    drawn, _ = draw(LOG.read_bytes())
    for quantity in ("voltage", "current", "speed", "power", "temperature/ESC", "temperature/MOS", "temperature/motor"):
        assert [path.rpartition("/")[2] for path in drawn.under(f"/{quantity}/esc_node")] == [
            f"esc_node{n}" for n in ESCS
        ]
    assert drawn.under("/throttle/commanded") == [f"/throttle/commanded/channel{k}" for k in (1, 2, 3, 4)]
    assert max(drawn.values(f"/temperature/ESC/esc_node{HOT}")) == 138
    assert drawn.values(f"/voltage/esc_node{HOT}")[0] == pytest.approx(50.2)


def test_the_report_draws_no_limits_of_another_vendor() -> None:
    (bus,) = analyzer.check(LOG).captures[0].buses
    assert dict(bus.limits) == {}
    (bus,) = analyzer.check(CAPTURES / "hover.log").captures[0].buses
    assert dict(bus.limits) == {"motors running": 2400, "motors at rest": 4000}


def test_tables_have_physical_units(command: Any, tmp_path: Path) -> None:
    command("export", str(LOG), "-o", f"{tmp_path}/out/")
    table = pq.read_table(tmp_path / "out" / f"{SPACE}StatusMsg2.parquet")
    assert table.num_rows == 120
    assert table.schema.field("input_voltage").metadata[b"unit"] == b"V"
    assert table.column("input_voltage")[0].as_py() == pytest.approx(50.2)
    _, out, _ = command("decode", str(LOG), "-T", "csv", "--frames", "34")
    assert next(csv.DictReader(out.splitlines()))["type"] == f"{SPACE}StatusMsg2"
