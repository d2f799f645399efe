"""What the ground station and the ESCs ask and answer: settings, queries, serial numbers (4.4.2, 4.4.4, 4.4.6)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from bench.outside.flight import FIRST, GROUND, Message, parameters, push, settings
from bench.outside.kinds import Kinds
from bench.outside.sending import altered, case, esc, moment, without

if TYPE_CHECKING:
    from random import Random

    from bench.outside.flight import Flight
    from bench.outside.kinds import Case

DIALOGUE = Kinds()
kind = DIALOGUE.kind


@kind("setting not answered", "BUS-011", "BUS-012 BUS-018")
def unanswered(flight: Flight, _: Random) -> Case:
    return without(flight, lambda m: m.name == "ParamGet" and m.t > 900, GROUND, FIRST)


@kind("query not answered by one", "BUS-012|BUS-011", "BUS-012 BUS-015 BUS-018 TYP-103")
def query_unanswered(flight: Flight, rng: Random) -> Case:
    node = rng.choice(flight.nodes[1:])
    return without(flight, lambda m: (m.name, m.src) == ("ParamGet", node), node, GROUND, about=f"node {node}")


@kind("setting not taken over", "BUS-013", "BUS-018")
def not_taken(flight: Flight, rng: Random) -> Case:
    new = rng.choice([{"esc_ov_threshold": 500}, {"esc_timing": 7}, {"esc_rotate_dir": 1}, {"esc_led_mode": 3}])
    chosen = [m for m in flight.messages if m.name == "ParamCfg" and m.t > 900]
    return altered(flight, chosen, lambda m: m.but(**new), GROUND, FIRST, about=str(new))


@kind("parameters that nobody asked for", "BUS-014", "")
def unasked(flight: Flight, rng: Random) -> Case:
    index = rng.randrange(flight.escs)
    new = Message(moment(rng), "ParamGet", FIRST + index, parameters(index, flight.rate))
    return case(flight, [*flight.messages, new], FIRST + index, about=f"node {FIRST + index}")


@kind("setting for an unknown ESC", "BUS-015", "BUS-011")
def unknown_esc(flight: Flight, rng: Random) -> Case:
    new = Message(1100, "ParamCfg", GROUND, settings(0, flight.rate) | {"esc_uuid": rng.randrange(1, 2**30)})
    return case(flight, [*flight.messages, new], GROUND, *flight.nodes)


@kind("serial number of another ESC", "TYP-403", "TYP-402 BUS-010 BUS-015")
def same_serial(flight: Flight, rng: Random) -> Case:
    node = rng.choice(flight.nodes[1:])
    chosen = [m for m in flight.messages if (m.name, m.src) == ("ParamGet", node)]
    return altered(flight, chosen, lambda m: m.but(esc_uuid=0x5EED0000), node, FIRST, GROUND, about=f"node {node}")


@kind("lifetime counter backward", "TYP-402", "")
def younger(flight: Flight, rng: Random) -> Case:
    name = rng.choice(["esc_startup_times", "esc_startup_duration"])
    chosen = [m for m in flight.messages if m.name == "ParamGet" and m.t > 900]
    return altered(flight, chosen, lambda m: m.but(**{name: 3}), FIRST, about=name)


@kind("ESCs set to different bus rates", "BUS-029|BUS-019", "BUS-013 BUS-019 BUS-029")
def bus_rates(flight: Flight, rng: Random) -> Case:
    node, code = rng.choice(flight.nodes[1:]), rng.randrange(1, 6)
    chosen = [m for m in flight.messages if (m.name, m.src) == ("ParamGet", node)]
    return altered(
        flight, chosen, lambda m: m.but(esc_can_rate=code), *flight.nodes, GROUND, about=f"node {node} {code}"
    )


@kind("FOC query not answered by one", "PUSH-201", "")
def foc_unanswered(flight: Flight, rng: Random) -> Case:
    node = esc(flight, rng)
    gone = without(flight, lambda m: m.src == node and m.packet.endswith("FocFeedback") and m.t < 990, node, GROUND)
    return replace(gone, about=f"node {node}")


@kind("FOC parameters not answered", "PUSH-102", "")
def foc_set_unanswered(flight: Flight, rng: Random) -> Case:
    node = esc(flight, rng)
    gone = without(flight, lambda m: m.src == node and m.packet.endswith("FocFeedback") and m.t > 990, node, GROUND)
    return replace(gone, about=f"node {node}")


@kind("FOC parameter not taken over", "PUSH-103", "")
def foc_not_taken(flight: Flight, rng: Random) -> Case:
    one = rng.choice([m for m in flight.messages if m.packet == "PUSHSCI.FocParameters"])
    new = rng.choice([{"acceleration_limit": 77}, {"rotation_direction": 1}, {"led": 5}])
    return altered(flight, [one], lambda m: m.but(**new), GROUND, FIRST + one.unit - 0xA1, about=str(new))


@kind("position set to zero while it turns", "PUSH-305", "PUSH-009")
def zero_in_flight(flight: Flight, rng: Random) -> Case:
    index = rng.randrange(flight.escs)
    asked = push(moment(rng), "PUSHSCI.SetZero", GROUND, 0xA1 + index)
    return case(flight, [*flight.messages, asked], GROUND, FIRST + index, about=f"unit {index + 1}")


@kind("settings saved while it turns", "TYP-210", "BUS-011 BUS-014")
def saved_in_flight(flight: Flight, rng: Random) -> Case:
    t = moment(rng)
    new = [
        Message(t, "ParamCfg", GROUND, settings(0, flight.rate)),
        Message(t + 4, "ParamGet", FIRST, parameters(0, flight.rate)),
    ]
    return case(flight, [*flight.messages, *new], GROUND, FIRST, about=f"at {t} ms")
