"""Pairs of simulated flights: another seed shows nothing, and one change shows that change first.

Changes are made by a sender that shares nothing with the decoder.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from kit.simulated import changed as flight
from kit.simulated import flown, unchanged

if TYPE_CHECKING:
    from collections.abc import Callable

    from kit.simulated import Change

    from analyzer import CaptureDiff
    from dissectors.traffic import Sending

    Compare = Callable[..., CaptureDiff]

START = 1_773_475_330
HOT = 13


def seconds(t: int | None) -> float:
    assert t is not None
    return t / 1e9 - START


# ---- the same --------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(4)
@pytest.mark.parametrize("seed", [2, 3])
def test_another_seed_is_noise(compare: Compare, seed: int) -> None:
    found = compare(flight(), flight(seed=seed))
    assert found.differences == ()
    assert found.judged
    counts = {one.what: one.count for one in found.compared}
    assert counts["nodes"] == 6
    assert counts["ESCs at equal command"] == 4
    assert counts["parameters"] > 50
    assert counts["rules"] > 100
    assert found.remarks == ("another vehicle: none of 5 unique IDs is in both",)


def test_a_capture_is_like_itself(compare: Compare) -> None:
    found = compare(flight(), flight())
    assert (found.differences, found.remarks) == ((), ())


@pytest.mark.slow
@pytest.mark.parametrize("plan", ["hover", "mission", "bench"])
@pytest.mark.parametrize("seed", range(1, 9))
def test_more_seeds_are_noise(compare: Compare, plan: str, seed: int) -> None:
    one, other = (flown(20, flight=plan, seed=k, escs=4 + 4 * (seed % 2)).text for k in (seed, seed + 100))
    assert compare(one, other).differences == ()


# ---- one change ------------------------------------------------------------------------------------------------------


def firmware(sending: Sending, _: int) -> dict[str, Any]:
    if sending.name != "uavcan.protocol.GetNodeInfo.Response":
        return {}
    version = sending.values["software_version"]
    return {"software_version": {**version, "minor": 3, "optional_field_flags": 1, "vcs_commit": 0xABCD0123}}


def other_firmware(sending: Sending, place: int) -> dict[str, Any]:
    return firmware(sending, place) if sending.node == HOT else {}


def without_node(sending: Sending, _: int) -> dict[str, Any] | None:
    return None if sending.node == HOT else {}


def halved(sending: Sending, place: int) -> dict[str, Any] | None:
    if sending.name != "ESCStatus" or sending.node != HOT:
        return {}
    return None if place % 2 else {"transfer_id": place // 2}


def halved_later(sending: Sending, place: int) -> dict[str, Any] | None:
    if sending.name != "ESCStatus" or sending.node != HOT or place < 90:
        return {}
    return None if place % 2 else {"transfer_id": 90 + (place - 90) // 2}


def halved_but_for_a_quarter(sending: Sending, place: int) -> dict[str, Any] | None:
    """30 a second in the seconds from 6 to 9."""
    if sending.name != "ESCStatus" or sending.node != HOT:
        return {}
    number = place // 2 if place < 180 else place - 90 if place < 270 else place // 2 + 45
    return {"transfer_id": number} if 180 <= place < 270 or not place % 2 else None


def without_status(sending: Sending, _: int) -> dict[str, Any] | None:
    return None if sending.name == "ESCStatus" and sending.node == HOT else {}


def status_from_six(sending: Sending, place: int) -> dict[str, Any] | None:
    return without_status(sending, place) if sending.t < 6_000_000_000 else {}


def hotter(sending: Sending, _: int) -> dict[str, Any]:
    if sending.name != "ESCStatus" or sending.node != HOT:
        return {}
    return {"temperature": sending.values["temperature"] + 15}


def hotter_later(sending: Sending, place: int) -> dict[str, Any]:
    return hotter(sending, place) if place >= 180 else {}


def slightly_hotter(sending: Sending, _: int) -> dict[str, Any]:
    if sending.name != "ESCStatus" or sending.node != HOT:
        return {}
    return {"temperature": sending.values["temperature"] + 5}


def all_hotter(sending: Sending, _: int) -> dict[str, Any]:
    return {"temperature": sending.values["temperature"] + 15} if sending.name == "ESCStatus" else {}


def parameter(sending: Sending, _: int) -> dict[str, Any]:
    return {"esc_timing": 21} if sending.name == "ParamGet" and sending.node == HOT else {}


def lossy(sending: Sending, place: int) -> dict[str, Any] | None:
    return None if sending.node == HOT and sending.name == "ESCStatus" and place in range(100, 240, 20) else {}


def silent_from_six(sending: Sending, _: int) -> dict[str, Any] | None:
    return None if sending.node == HOT and sending.t > 6_000_000_000 else {}


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("change", "kind", "what", "values"),
    [
        (other_firmware, "firmware", "software", None),
        (without_node, "node", "node on the bus", None),
        (halved, "rate", "ESCStatus rate", (30.0, 15.0)),
        (hotter, "telemetry", "temperature at", None),
        (parameter, "parameter", "ParamGet.esc_timing", None),
        (lossy, "loss", "lost transfers", None),
    ],
)
def test_one_change_is_first(
    compare: Compare, change: Change, kind: str, what: str, values: tuple[float, float] | None
) -> None:
    found = compare(flight(), flight(change))
    first = found.differences[0]
    assert (first.kind, first.node) == (kind, HOT), found.differences
    assert first.what.startswith(what)
    assert first.weight != "note"
    if values is not None:
        assert (first.good_value, first.bad_value) == pytest.approx(values, rel=0.1)
    alone = [one for one in found.differences if one.kind == kind]
    assert len(alone) == 1
    # Whatever else is told is of the same node, or of its bus.
    askers = {10, 125}
    assert {one.node for one in found.differences} <= {HOT, None, *askers}


def test_values_of_both_sides(compare: Compare) -> None:
    (one,) = (d for d in compare(flight(), flight(hotter)).differences if d.kind == "telemetry")
    assert one.bad_value - one.good_value == pytest.approx(15, abs=1)
    assert one.unit == "degC"
    assert one.support == "likely"
    assert (one.who, one.since, one.t_ns) == ("ch3", "throughout", None)
    assert 50 < min(one.good_count, one.bad_count) <= max(one.good_count, one.bad_count) < 100  # of about 360
    (one,) = (d for d in compare(flight(), flight(parameter)).differences if d.kind == "parameter")
    assert (one.good, one.bad, one.support) == ("15 deg", "21 deg", "well supported")
    (one,) = (d for d in compare(flight(), flight(other_firmware)).differences if d.kind == "firmware")
    assert (one.good, one.bad) == ("2.2", "2.3 abcd0123")


def test_losses_are_shares_of_what_was_sent(compare: Compare) -> None:
    (one,) = (d for d in compare(flight(), flight(lossy)).differences if d.kind == "loss")
    assert (one.good, one.bad) == ("none", f"7 of {one.bad_count}")
    assert one.bad_count == one.good_count
    assert one.bad_value == pytest.approx(7 / one.bad_count, abs=1e-6)


def second_device(sending: Sending, place: int) -> dict[str, Any]:
    other = sending.name == "ESCStatus" and sending.node == HOT + 1
    return {"src": HOT, "transfer_id": (place + 11) % 32} if other else {}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("ignore", ["", "BUS-010"])
def test_nothing_is_lost_of_two_devices_behind_one_node_id(compare: Compare, ignore: str) -> None:
    found = compare(flight(), flight(second_device), ignore)
    assert (("BUS-010", HOT) in {(one.rule, one.node) for one in found.differences}) is (not ignore)
    assert ("loss", HOT) not in {(one.kind, one.node) for one in found.differences}
    assert found.bad.lost == 0
    assert "what node 13 of can0 lost: two devices have this ID in the second capture" in found.cannot


@pytest.mark.slow
def test_where_it_begins(compare: Compare) -> None:
    (one,) = (d for d in compare(flight(), flight(silent_from_six)).differences if d.what == "ESCStatus silent")
    assert (one.weight, one.since, one.node) == ("error", "from", HOT)
    assert seconds(one.t_ns) == pytest.approx(6, abs=1.1)
    assert one.command.startswith("tailbyte decode ")
    assert one.command.endswith(f"--around {START + seconds(one.t_ns):.3f}+-1s")
    (one,) = (d for d in compare(flight(), flight(hotter_later)).differences if d.kind == "telemetry")
    assert one.since == "from"
    assert seconds(one.t_ns) == pytest.approx(6, abs=0.5)
    (one,) = (d for d in compare(flight(), flight(halved_later)).differences if d.what == "ESCStatus rate")
    assert one.since == "from"
    assert seconds(one.t_ns) == pytest.approx(3, abs=1)


@pytest.mark.slow
def test_another_rate_in_a_part(compare: Compare) -> None:
    (one,) = (d for d in compare(flight(halved), flight(halved_but_for_a_quarter)).differences if d.kind == "rate")
    assert (one.what, one.weight, one.since, one.node) == ("ESCStatus rate in a part", "warning", "from", HOT)
    assert (one.good_value, one.bad_value) == pytest.approx((15, 30), rel=0.1)
    assert seconds(one.t_ns) == pytest.approx(6, abs=0.8)
    (one,) = (d for d in compare(flight(halved_but_for_a_quarter), flight(halved)).differences if d.kind == "rate")
    assert (one.weight, one.since, one.t_ns) == ("note", "", None)
    assert (one.good_value, one.bad_value) == pytest.approx((30, 15), rel=0.1)


@pytest.mark.slow
def test_an_esc_that_no_longer_reports(compare: Compare) -> None:
    found = compare(flight(), flight(without_status)).differences
    (one,) = (d for d in found if d.what == "ESCStatus")
    assert (one.kind, one.weight, one.who, one.bad) == ("rate", "error", "ch3", "never")
    (one,) = (d for d in compare(flight(without_status), flight()).differences if d.what == "ESCStatus")
    assert (one.weight, one.who, one.good, one.since) == ("note", "ch3", "never", "")
    (one,) = (d for d in compare(flight(without_status), flight(status_from_six)).differences if d.what == "ESCStatus")
    assert one.since == "from"
    assert seconds(one.t_ns) == pytest.approx(6, abs=0.1)


@pytest.mark.slow
def test_another_reading_of_a_doubtful_field(compare: Compare) -> None:
    (one,) = compare(flight(), flight(unchanged, 1, "TYP-301:node=13")).differences
    assert (one.kind, one.weight, one.who, one.since) == ("reading", "warning", "ch3", "throughout")
    assert (one.what, one.good, one.bad) == ("ESCStatus.temperature read as", "degC", "K")


@pytest.mark.slow
def test_error_frames_that_nobody_recorded_are_not_none(compare: Compare) -> None:
    found = compare(flight(), flight(unchanged, 1, "CAN-004@5")).differences
    told = {one.what: (one.good, one.good_value, one.bad, one.support) for one in found}
    assert told["error frames"] == ("not recorded", None, "1", "possible")
    assert told["CAN-004 Error frame on the bus"] == ("not recorded", None, "1x", "possible")
    back = compare(flight(unchanged, 1, "CAN-004@5"), flight()).differences
    assert {(one.bad, one.bad_value) for one in back} == {("not recorded", None)}


def test_what_is_so_from_the_start_stands_before_what_begins_later(compare: Compare) -> None:
    def both(sending: Sending, place: int) -> dict[str, Any] | None:
        return parameter(sending, place) or hotter_later(sending, place)

    kinds = [one.kind for one in compare(flight(), flight(both)).differences]
    assert kinds[:2] == ["parameter", "telemetry"]


@pytest.mark.parametrize("change", [slightly_hotter])
def test_a_near_miss_is_none(compare: Compare, change: Change) -> None:
    assert compare(flight(), flight(change)).differences == ()


def test_what_all_escs_have_in_common_is_told_once(compare: Compare) -> None:
    (one,) = (d for d in compare(flight(), flight(all_hotter)).differences if d.kind == "telemetry")
    assert (one.who, one.node, one.weight) == ("all 4 ESCs", None, "note")


@pytest.mark.sampled(4)
@pytest.mark.parametrize("order", ["TRF-003@5:node=13", "TYP-306@5:node=13", "TRF-010@5:node=13", "BUS-005@5"])
def test_a_fault_is_first(compare: Compare, order: str) -> None:
    differences = compare(flight(), flight(unchanged, 1, order)).differences
    first = next(one for one in differences if one.kind != "flight")  # what triage makes of it
    assert first.rule == order[:7]
    assert seconds(first.t_ns) == pytest.approx(5, abs=1)
    assert first.good == ("not recorded" if order == "BUS-005@5" else "none")
    assert first.weight == "error"


@pytest.mark.slow
def test_a_fault_that_announces_itself(compare: Compare) -> None:
    """The ESC gets warm before it says that it is too hot."""
    found = compare(flight(), flight(unchanged, 1, "TYP-305@5:node=13")).differences
    assert [one.what[:11] for one in found[:2]] == ["temperature", "TYP-305 Fau"]
    assert seconds(found[0].t_ns) < seconds(found[1].t_ns)


# ---- swapped ---------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(4)
@pytest.mark.parametrize("change", [without_node, halved, hotter_later, lossy])
def test_swapped_sides_are_mirrored(compare: Compare, change: Change) -> None:
    there, back = compare(flight(), flight(change)), compare(flight(change), flight())
    assert {(one.kind, one.node, one.good, one.bad) for one in there.differences} == {
        (one.kind, one.node, one.bad, one.good) for one in back.differences
    }
