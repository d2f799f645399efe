"""The twenty stories and the right answer, with its words; the last ten."""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING, Any

import pytest
from kit.simulated import changed
from kit.stories import crash_log, excluded, said, told, triaged, without

if TYPE_CHECKING:
    from analyzer.simulate.bus import Sending

NODE = 12


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", ["duplicate-node", "duplicate-index"])
def test_11_two_devices_with_one_address(name: str) -> None:
    found = told(name, seed=31)
    assert found.first.kind == "address"
    words = "two devices have node ID" if name == "duplicate-node" else "two ESCs have one index"
    assert words in found.first.title


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", ["exchanged-esc", "two-interfaces"])
def test_11_not_if_it_was_exchanged_or_is_seen_on_two_interfaces(name: str) -> None:
    assert told(name, seed=31).first.kind == "none"


@pytest.mark.slow
def test_12_a_motor_that_turns_the_other_way_is_setup_and_at_most_possible() -> None:
    found = told("swap-flights:tail=no", seed=32)
    assert (found.first.kind, found.first.support) == ("setup", "possible")
    assert f"changed since flight 1: ch{found.first.ch} turns" in said(found)
    assert "it tips over" in said(found)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("seed", [7, 32, 33])
def test_12_a_flight_of_less_than_a_second_is_a_flight(seed: int) -> None:
    found = told("swapped-esc:tail=no", seed=seed)
    assert found.flight is not None
    assert found.first.kind in {"setup", "control", "unknown"}
    assert found.first.support == "possible"


@pytest.mark.slow
def test_12_not_if_nothing_was_exchanged() -> None:
    assert not any("changed since" in row for row in told("second-flight:tail=no:twin=no", seed=32).first.reasons)


def test_13_what_the_recorder_lost_is_no_evidence() -> None:
    found = told("lossy-crash:tail=no", seed=34)
    assert any(label == "Recorder" and "nothing in there is evidence" in text for label, text in found.lines)
    assert found.first.kind in {"control", "recorder", "unknown"}
    assert not any(one.kind in {"wiring", "bus", "battery", "commands-lost"} for one in found.verdicts)


@pytest.mark.slow
def test_13_a_moment_that_was_not_recorded_cannot_be_told() -> None:
    found = told("blind-crash:tail=no", seed=34)
    assert found.first.kind == "unknown"
    assert "the recorder lost frames when it began" in found.first.title


@pytest.mark.sampled(4)
@pytest.mark.parametrize("back", ["yes", "no"])
def test_14_a_clock_that_is_set_is_one_flight_without_a_gap(back: str) -> None:
    found = told(f"clock-step:back={back}", seed=35)
    assert (found.first.kind, len(found.flights)) == ("none", 1)
    (line,) = (text for label, text in found.lines if label == "Clock")
    assert "one flight, no gap" in line
    assert ("back by 72" if back == "yes" else "by +72") in line
    flight = found.flights[0]
    assert 0 < flight.last.ran - flight.first.ran < 30 * 10**9
    assert not any(one.kind in {"gap", "silence"} for one in found.events)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", ["autopilot-dies", "power-cut"])
def test_15_the_end_of_the_recording_may_be_that_of_the_autopilot(name: str) -> None:
    found = told(name, seed=36)
    assert found.first.kind == "unknown"
    (fits,) = (text for label, text in found.first.notes if label == "fits")
    assert "the vehicle's, the recorder's, or the autopilot's if that is the recorder" in fits


@pytest.mark.slow
def test_16_a_pack_that_is_unplugged_after_landing_is_an_event_and_no_cause() -> None:
    found = told("unplugged", seed=37)
    assert (found.first.kind, found.flights[-1].end) == ("none", "landed")
    assert len({one.node for one in found.events if one.kind == "silence" and one.after is None}) == 4


@pytest.mark.slow
def test_16_not_if_it_comes_off_in_the_air() -> None:
    assert told("pack-lost:twin=no:tail=no", seed=37).first.kind == "battery"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["coaxial", "aft-weight"])
def test_17_what_was_always_so_is_no_cause(name: str) -> None:
    assert told(name, seed=38, escs=8).first.kind == "none"


def test_17_the_odd_one_is_still_seen() -> None:
    found = told("coaxial-failure:twin=no:tail=no", seed=38, escs=8)
    assert found.first.kind == "propulsion"
    assert found.first.ch == found.primary[0].ch


def test_18_half_of_the_channels_share_a_supply() -> None:
    found = told("two-packs:twin=no:tail=no", seed=39, escs=8)
    assert found.first.kind == "battery"
    mine = " ".join(map(str, found.first.chs))
    assert mine in {"1 3 5 7", "2 4 6 8"}
    assert f"channels {mine} share a supply" in said(found)
    assert "the other 4 ESCs keep their voltage" in said(found)


def test_18_not_if_the_packs_are_only_uneven() -> None:
    assert told("uneven-packs", seed=39, escs=8).first.kind == "none"


def test_19_counted_errors_are_no_faults_and_no_bit_is_no_health() -> None:
    found = told("landing", seed=40, stock=True)
    assert found.first.kind == "none"
    assert "fault bits: not told by these ESCs (all ESCs)" in said(found)
    assert not any(one.kind in {"fault", "mode"} for one in found.events)
    assert "not told" not in said(told("landing", seed=40))


def test_19_a_cause_is_seen_without_bits() -> None:
    found = told("propeller-lost:twin=no:tail=no", seed=40, rate=50, stock=True)
    assert found.first.kind == "propulsion"
    assert "no fault bit" not in said(found)
    assert "not told by these ESCs" in said(found)


def test_20_an_esc_that_gets_nothing_while_the_bus_carries_it_is_wiring() -> None:
    found = told("deaf-esc:twin=no:tail=no", seed=41)
    assert (found.first.kind, found.first.ch) == ("wiring", found.primary[0].ch)
    assert "says that it got no commands, though the bus carried them" in found.first.title
    assert "throttle loss" in said(found)
    assert "its wire, its receive filter or its firmware" in said(found)
    assert excluded(found)["commands stopping"].startswith("40")


def test_20_not_if_the_commands_stopped_for_all() -> None:
    assert told("command-loss", seed=41).first.kind == "commands-lost"


# ---- a shaken plug, by hand: holes of 80 ms once a second, of one ESC


class _Holes:
    """Leaves out what a node sends in holes; if it `sends`, its transfer IDs run on meanwhile."""

    def __init__(self, *, sends: bool) -> None:
        self._sends = sends
        self._next: dict[str, Any] = {}

    def __call__(self, sending: Sending, _: int) -> dict[str, Any] | None:
        if sending.node != NODE:
            return {}
        t = sending.frames[0].t / 1e9
        if t > 5 and t % 1 < 0.08:
            return None
        return {} if self._sends else {"transfer_id": next(self._next.setdefault(sending.name, count())) % 32}


def test_3_holes_of_80_ms_with_ids_that_jump_are_the_wire() -> None:
    found = triaged(changed.__wrapped__(_Holes(sends=True)))
    assert (found.first.kind, found.first.node) == ("wiring", NODE)
    assert "stopped reporting" in found.first.title
    assert "went on sending" in said(found)


def test_3_with_ids_that_run_on_it_did_not_send() -> None:
    text = crash_log("landing", seed=42, rate=50)
    assert triaged(without(text, lambda *_: False)).first.kind == "none"
    found = triaged(changed.__wrapped__(_Holes(sends=False)))
    assert found.first.kind in {"esc", "unknown"}
    assert "wire" not in found.first.title


def test_15_an_autopilot_that_starts_anew_says_why_the_commands_stopped() -> None:
    found = told("autopilot-reboot:tail=yes:twin=no", seed=77)
    assert found.first.kind == "commands-lost"
    assert "node 10 (autopilot) starts anew: uptime" in said(found)
    assert not any(one.kind == "restart" for one in found.after)
