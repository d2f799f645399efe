"""What the ground station says and what the ESCs answer: parameters and packets (4.4.2, 4.4.4 to 4.4.6)."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest
from kit import encode
from kit.simulated import FLIGHT_PLANS, Flown, end, flown, simulation, status_bits

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic import packets
from dissectors.tmotor.traffic.parameters import QUERY

# ParamGet's name for what ParamCfg sets, where it has another.
REPORTED = {"esc_id_set": "esc_id_req"}


def seconds_of(plan: str) -> float:
    return 12 if plan == "startup" else 8


@pytest.fixture(params=FLIGHT_PLANS)
def flight(request: pytest.FixtureRequest) -> Flown:
    return flown(seconds_of(request.param), flight=request.param, escs=4)


def told(configuration: dict[str, Any]) -> dict[str, Any]:
    """What a ParamCfg sets, by the names of ParamGet."""
    return {
        REPORTED.get(name, name): value
        for name, value in configuration.items()
        if value != QUERY[name] and name not in {"esc_uuid", "esc_index"}
    }


def early(flight: Flown, name: str, *, by: int = SECOND) -> list[Any]:
    """The transfers of a type that leave time for an answer."""
    return [one for one in flight.of(name) if end(one) < flight.frames[-1].t - by]


@pytest.mark.sampled(2)
def test_every_configuration_is_answered_and_taken_over(flight: Flown) -> None:
    """BUS-011, BUS-012, BUS-013, BUS-015: within 50 ms, by the ESC that it names or by all."""
    uuids = {esc.uuid: esc.index for esc in flight.vehicle.escs}
    known: set[int] = set()
    asked = early(flight, "ParamCfg")
    assert len(asked) > 3
    for one in asked:
        uuid = one.values["esc_uuid"]
        addressed = set(range(4)) if uuid == QUERY["esc_uuid"] else {uuids[uuid]}
        answers = [row for row in flight.of("ParamGet") if end(one) < end(row) < end(one) + 50 * MILLISECOND]
        assert {row.node - 11 for row in answers} == addressed
        assert {row.values["esc_uuid"] for row in answers} == {
            key for key, index in uuids.items() if index in addressed
        }
        for row in answers:
            assert told(one.values).items() <= row.values.items()
        assert uuid == QUERY["esc_uuid"] or (uuid in known and one.values["esc_index"] == uuids[uuid])
        known |= {row.values["esc_uuid"] for row in answers}
    assert any(told(one.values).get("esc_save_option") == 1 for one in asked)


def test_reports_come_only_when_they_are_asked_for(flight: Flown) -> None:
    """BUS-014; and what a lifetime counts never falls (TYP-402)."""
    asked = [end(one) for one in flight.of("ParamCfg")]
    for one in flight.of("ParamGet"):
        assert any(0 < one.t - t < 100 * MILLISECOND for t in asked)
        assert len(one.values["rsvd"]) == 32
    for node in flight.escs:
        for before, after in pairwise(flight.of("ParamGet", node)):
            for name in ("esc_startup_times", "esc_startup_duration", "esc_error_count"):
                assert before.values[name] <= after.values[name]


def test_nothing_is_stored_while_motors_turn(flight: Flown) -> None:
    """TYP-210."""
    stored = [one.t for one in flight.of("ParamCfg") if one.values["esc_save_option"] == 1]
    assert stored
    busy = [one.t for one in flight.of("RawCommand") if any(one.values["cmd"])]
    busy += [one.t for one in flight.of("ESCStatus") if one.values["rpm"]]
    assert not any(0 <= t - other <= SECOND for t in stored for other in busy)


def test_an_esc_that_reports_late_is_not_told_to_store() -> None:
    """TYP-210: at one report a second a short flight has begun before everybody is known."""
    flight = flown(4, escs=8, rate=1)
    first = min(one.t for one in flight.of("ParamCfg"))
    assert any(any(one.values["cmd"]) for one in flight.of("RawCommand") if one.t < first + SECOND)
    assert {one.values["esc_save_option"] for one in flight.of("ParamCfg")} == {0, 0xFF}


def test_every_packet_of_the_document_is_sent_and_answered(flight: Flown) -> None:
    """PUSH-102, PUSH-201, PUSH-304."""
    feedback = [(end(one), values["unit_id"]) for one, values in flight.packets("FocFeedback")]
    status = [(end(one), values["unit_id"]) for one, values in flight.packets("MotorStatus")]
    for name, answers, within in (
        ("FocQuery", feedback, 100 * MILLISECOND),
        ("FocParameters", feedback, 100 * MILLISECOND),
        ("OutputControl", status, 200 * MILLISECOND),
        ("SetZero", None, 0),
    ):
        rows = [(one, values) for one, values in flight.packets(name) if end(one) < flight.frames[-1].t - within]
        assert rows, name
        for one, values in rows if answers is not None else ():
            units = {values["unit_id"]} if values["unit_id"] != 0xFF else {0xA1, 0xA2, 0xA3, 0xA4}
            assert {unit for t, unit in answers if end(one) < t < end(one) + within} >= units, name


def test_feedback_is_what_was_set(flight: Flown) -> None:
    """PUSH-103."""
    rows = list(flight.packets("FocParameters"))
    shared = {"acceleration_limit", "deceleration_limit", "rotation_direction", "led", "bus_rate", "report_rate"}
    checked = 0
    for one, values in rows:
        after = (row for row in flight.packets("FocFeedback") if row[0].t > end(one))
        answer = next((found for _, found in after if found["unit_id"] == values["unit_id"]), None)
        if answer is not None:
            set_ones = {name: values[name] for name in shared if values[name] not in {0xFFFF, 0xFF}}
            assert set_ones.items() <= answer.items()
            checked += len(set_ones)
    assert checked


def test_numbers_of_packets_follow_each_other(flight: Flown) -> None:
    """PUSH-009 per sender, direction and unit; TYP-501 per sender and type."""
    counts: dict[tuple[int, int], int] = {}
    sequences: dict[int, int] = {}
    for carrier in ("PUSHSCI", "PUSHCAN"):
        for one in flight.of(carrier):
            _, values = packets.split(one.values["data"])
            key = (one.node, values["unit_id"])
            assert values["frame_count"] == (counts.get(key, -1) + 1) % 256
            counts[key] = values["frame_count"]
            assert one.values["data_sequence"] == sequences.get(one.node, -1) + 1
            sequences[one.node] = one.values["data_sequence"]
            if carrier == "PUSHCAN":
                assert values["unit_id"] == 0xA1 + one.node - 11


def test_packets_are_those_of_a_foreign_builder(flight: Flown) -> None:
    """Layouts and checksums, against the tables of the tests' own encoder."""
    seen = set()
    for carrier in ("PUSHSCI", "PUSHCAN"):
        for one in flight.of(carrier):
            name, values = packets.split(one.values["data"])
            head = {"header", "frame_id", "frame_count", "unit_id", "length", "checksum"}
            body = {key: value for key, value in values.items() if key not in head}
            foreign = encode.packet(f"{carrier}.{name}", values["frame_count"], values["unit_id"], **body)
            assert foreign == one.values["data"]
            seen.add(name)
    assert seen == {"MotorStatus", "FocFeedback", "SetZero", "FocParameters", "FocQuery", "OutputControl"}


def test_zero_is_where_it_was_set() -> None:
    """4.4.4 table 1."""
    flight = flown(8, escs=4)
    (zeroed,) = [end(one) for one, values in flight.packets("SetZero") if values["unit_id"] == 0xA2]
    before = [status_bits(one)[2] for one in flight.of("ESCStatus", 12) if one.t < zeroed]
    after = [status_bits(one)[2] for one in flight.of("ESCStatus", 12) if zeroed < one.t < 1.5 * SECOND]
    assert set(before) != {0}
    assert set(after) == {0}


def test_uuids_are_unique_and_not_ambiguous() -> None:
    """TYP-403, TYP-209: no byte says "no change"."""
    for seed in range(20):
        escs = simulation(1, seed=seed, escs=20).vehicle.escs
        assert len({esc.uuid for esc in escs}) == 20
        assert not any({0x00, 0xFF} & set(esc.uuid.to_bytes(4, "little")) for esc in escs)


def test_no_setting_is_ambiguous(flight: Flown) -> None:
    """TYP-209: a 16-bit field that is 0x00FF could mean 255 or "no change"."""
    short = {"esc_index", "esc_timing", "esc_signal_priority", "esc_can_rate", "esc_save_option"}
    rows = [one.values for name in ("ParamCfg", "ParamGet") for one in flight.of(name)]
    assert rows
    for values in rows:
        assert 0x00FF not in {value for name, value in values.items() if name not in short}


def test_who_is_on_the_bus() -> None:
    flight = flown(3, escs=10, seed=4)
    key = flight.simulation.key()["vehicle"]
    assert (key["autopilot"], key["ground"]) == (10, 125)
    reported = {one.node: one.values for one in flight.of("ParamGet")}
    for index, esc in enumerate(key["escs"]):
        assert (esc["node"], esc["esc_index"], esc["unit"]) == (11 + index, index, index + 1 if index < 9 else None)
        assert reported[esc["node"]]["esc_index"] == index
        assert f"{reported[esc['node']]['esc_uuid']:08X}" == esc["uuid"]
    names = {one.node: bytes(one.values["name"]).decode() for one in flight.of("uavcan.protocol.GetNodeInfo.Response")}
    assert names.items() >= {esc["node"]: esc["name"] for esc in key["escs"][:5]}.items()
    assert not flight.of("PUSHCAN", 20)
