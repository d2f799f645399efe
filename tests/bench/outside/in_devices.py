"""Devices that do what the document does not say: they stop, restart, report late or never, or follow no command."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from bench.outside.flight import (
    ALIVE,
    AUTOPILOT,
    END,
    FIRST,
    GROUND,
    REST,
    STOP,
    Message,
    alive,
    motor,
    status,
)  # fmt: skip
from bench.outside.kinds import Kinds
from bench.outside.sending import altered, case, esc, moment, one_of, sent, without
from kit import encode
from kit.flight import half

if TYPE_CHECKING:
    from collections.abc import Callable
    from random import Random

    from bench.outside.flight import Flight
    from bench.outside.kinds import Case

DEVICES = Kinds()
kind = DEVICES.kind
SILENT = "BUS-025|BUS-035|BUS-020"
GONE = "BUS-020 BUS-025 BUS-026 BUS-027 BUS-035 BUS-028 TYP-103 PUSH-304"
ANEW = (
    "TRF-016 TRF-019 TRF-017 TRF-018 TYP-502 TYP-503 PUSH-009 PUSH-407 BUS-020 BUS-021 "
    "BUS-022 BUS-025 BUS-028 BUS-035 BUS-037"
)
COMMANDS = "BUS-007 BUS-006 BUS-017 BUS-034 BUS-035 BUS-028 BUS-038 TYP-305"
READ = "ESCStatus", "PUSHCAN"


@kind("ESC dies", SILENT, GONE)
def dies(flight: Flight, rng: Random) -> Case:
    node, t = esc(flight, rng), moment(rng)
    return without(flight, lambda m: m.src == node and m.t > t, node, AUTOPILOT, about=f"node {node} at {t} ms")


@kind("ESC stops its ESCStatus", "BUS-025|BUS-035", GONE)
def stops(flight: Flight, rng: Random) -> Case:
    node, t = esc(flight, rng), moment(rng)
    return without(
        flight, lambda m: (m.name, m.src) == ("ESCStatus", node) and m.t > t, node, AUTOPILOT, about=f"node {node}"
    )


@kind("ESC stops its PUSHCAN", "BUS-035|BUS-025", GONE)
def stops_packets(flight: Flight, rng: Random) -> Case:
    node, t = esc(flight, rng), moment(rng)
    return without(flight, lambda m: (m.name, m.src) == ("PUSHCAN", node) and m.t > t, node, about=f"node {node}")


@kind("ESC pauses its reports", "BUS-025|BUS-035", GONE)
def pauses(flight: Flight, rng: Random) -> Case:
    node, t, length = esc(flight, rng), rng.randrange(2600, 4200), rng.randrange(500, 1400)
    gone = without(flight, lambda m: m.src == node and m.name == "ESCStatus" and t < m.t < t + length, node, AUTOPILOT)
    return replace(gone, about=f"node {node} from {t} ms for {length} ms")


@kind("ESC restarts", "BUS-021|BUS-037", ANEW)
def restarts(flight: Flight, rng: Random) -> Case:
    """Its uptime, its counters and its runtime begin anew, the power-on count goes up by one (4.4.5 no 24-27)."""
    node, t = esc(flight, rng), rng.randrange(2600, 4500)
    back, seen = t + rng.randrange(150, 700), dict[str, int]()

    def change(one: Message) -> Message | None:
        if one.src != node or one.t < t:
            return one
        if one.t < back:
            return None
        key = f"{one.name} {one.dst}"
        seen[key] = number = seen.get(key, -1) + 1
        new = replace(one, number=number)
        if one.packet:
            seen["packet"] = count = seen.get("packet", -1) + 1
            new = replace(new, sequence=number, count=count)
        if one.packet.endswith("MotorStatus"):
            values = {"power_on_count": one.values["power_on_count"] + 1, "runtime": int(one.t - back) // 1000}
            new = new.but(**values)
        return new.but(uptime_sec=int(one.t - back) // 1000) if one.name == ALIVE else new

    ordered = sorted(flight.messages, key=lambda m: m.t)
    return case(flight, [new for m in ordered if (new := change(m))], node, about=f"node {node} {t} to {back} ms")


@kind("ESC reports at another rate than set", "BUS-018", "BUS-024 BUS-025")
def other_rate(flight: Flight, rng: Random) -> Case:
    node, share = esc(flight, rng), rng.choice([2, 3, 4])
    every = sorted((m for m in flight.messages if (m.name, m.src) == ("ESCStatus", node)), key=lambda m: m.t)
    keep = {m for k, m in enumerate(every) if k % share == 0}
    gone = without(flight, lambda m: (m.name, m.src) == ("ESCStatus", node) and m not in keep, node, GROUND)
    return replace(gone, about=f"node {node} at 1/{share}")


@kind("motor does not turn", "BUS-028", "PUSH-409")
def still(flight: Flight, rng: Random) -> Case:
    return turning(flight, rng, lambda _: 0, REST, END)


@kind("motor turns without throttle", "BUS-028", "PUSH-409 BUS-017 CAP-005")
def runs_on(flight: Flight, rng: Random) -> Case:
    """The throttle of a channel is 0 from a moment on, and the motor goes on (4.4.1)."""
    index, t = rng.randrange(flight.escs), rng.randrange(2600, 3000)

    def change(one: Message) -> Message:
        if one.name == "RawCommand" and t < one.t:
            return one.but(cmd=[0 if k == index else value for k, value in enumerate(one.fields["cmd"])])
        return one

    return case(flight, flight.made(change), FIRST + index, AUTOPILOT, about=f"channel {index} from {t} ms")


def turning(flight: Flight, rng: Random, new: Callable[[int], int], begin: float, end: float) -> Case:
    node = esc(flight, rng)

    def change(one: Message) -> Message:
        if one.src != node or not begin < one.t < end:
            return one
        if one.name == "ESCStatus":
            return one.but(rpm=new(one.fields["rpm"]))
        return one.but(speed=new(one.values["speed"])) if one.packet.endswith("MotorStatus") else one

    return case(flight, flight.made(change), node, AUTOPILOT, about=f"node {node}")


@kind("throttle commands pause", "BUS-007", COMMANDS)
def commands_pause(flight: Flight, rng: Random) -> Case:
    t, length = rng.randrange(2600, 4200), rng.randrange(200, 900)
    gone = without(flight, lambda m: m.name == "RawCommand" and t < m.t < t + length, AUTOPILOT, *flight.nodes)
    return replace(gone, about=f"from {t} ms for {length} ms")


@kind("throttle commands end in flight", "BUS-007", f"{COMMANDS} CAP-005 TYP-103")
def commands_end(flight: Flight, rng: Random) -> Case:
    t = moment(rng)
    return without(flight, lambda m: m.name == "RawCommand" and m.t > t, AUTOPILOT, *flight.nodes, about=f"at {t} ms")


@kind("throttle commands too seldom", "BUS-006", "BUS-007")
def seldom(flight: Flight, rng: Random) -> Case:
    share = rng.choice([2, 4, 8])
    keep = {m for k, m in enumerate(m for m in flight.messages if m.name == "RawCommand") if k % share == 0}
    return without(flight, lambda m: m.name == "RawCommand" and m not in keep, AUTOPILOT, about=f"{400 // share} Hz")


@kind("second node commands throttle", "BUS-023", "BUS-001 BUS-006 BUS-028")
def second_source(flight: Flight, rng: Random) -> Case:
    t, node = moment(rng), rng.choice([2, 3, GROUND])
    new = [
        Message(t + 20 * k + 3, "RawCommand", node, {"cmd": [0] * flight.escs}) for k in range(rng.randrange(10, 40))
    ]
    extra = [] if node == GROUND else [alive(1000 * k + 500, node) for k in range(8)]
    return case(
        flight, [*flight.messages, *new, *extra], node, AUTOPILOT, *flight.nodes, about=f"node {node} at {t} ms"
    )


@kind("two ESCs with one index", "BUS-009", "BUS-025 BUS-026 BUS-027 TYP-103 PUSH-011 BUS-028 BUS-032")
def same_index(flight: Flight, rng: Random) -> Case:
    node = rng.choice(flight.nodes[1:])
    chosen = [m for m in flight.messages if (m.name, m.src) == ("ESCStatus", node)]
    return altered(flight, chosen, lambda m: m.but(esc_index=0), node, FIRST, AUTOPILOT, about=f"node {node}")


@kind("ESC beyond the channels", "BUS-026", "TYP-103 BUS-027 BUS-028 PUSH-011")
def beyond(flight: Flight, _: Random) -> Case:
    def change(one: Message) -> Message:
        return one.but(cmd=one.fields["cmd"][:-1]) if one.name == "RawCommand" else one

    return case(flight, flight.made(change), flight.nodes[-1], AUTOPILOT, about="the last one")


@kind(
    "two devices with one node ID",
    "BUS-010",
    f"BUS-009 BUS-018 TRF-0* TYP-403 PUSH-011 {ANEW} TYP-501 PUSH-409 BUS-032 PUSH-201",
)
def same_node(flight: Flight, rng: Random) -> Case:
    """Another ESC answers to the node ID of the first, with counters and times of its own (4.1.2)."""
    twin, node = rng.choice(flight.nodes[1:]), FIRST
    counts: dict[str, int] = {}
    made = []
    for one in sorted(flight.messages, key=lambda m: m.t):
        if one.src != twin or one.name == "ParamGet":
            made.append(one)
            continue
        key = one.name
        counts[key] = number = counts.get(key, 10) + 1
        new = replace(one, src=node, number=number)
        if one.packet:
            new = replace(new, sequence=number + 500, count=number)
        made.append(new)
    made = [one for one in made if not (one.name == "ParamGet" and one.src == twin)]
    return case(flight, made, node, twin, GROUND, AUTOPILOT, about=f"{twin} as {node}")


@kind("more than 8 ESCs", "BUS-008", "BUS-001 BUS-024 BUS-026 TYP-103 BUS-004 BUS-012 BUS-020 PUSH-201 TYP-301")
def too_many(flight: Flight, rng: Random) -> Case:
    more = range(flight.escs, rng.randrange(9, 12))
    new = [alive(1000 * k + 100 + index, FIRST + index) for index in more for k in range(9)]
    for index in more:
        new += [Message(50.0 * k + 2 * index, "ESCStatus", FIRST + index, status(index, 0)) for k in range(END // 50)]
    return case(flight, [*flight.messages, *new], *range(FIRST, FIRST + 12), AUTOPILOT, GROUND, about=f"{more.stop}")


@kind("too many frames in flight", "BUS-001", "BUS-003 BUS-004 BUS-006 BUS-018 BUS-024 TRF-* BUS-023")
def crowded(flight: Flight, _: Random) -> Case:
    """More than 2400 frames a second (4.4.4 explanation 3): ESCs report far above their rate."""
    more = [
        Message(t + 1.5, "ESCStatus", node, status(node - FIRST, t + 1.5))
        for node in flight.nodes
        for t in range(2500, 5500, 1000 * flight.escs // 600)
    ]
    return case(flight, [*flight.messages, *more], *flight.nodes, AUTOPILOT, about="600 reports a second more")


@kind("NodeStatus ends", "BUS-020|BUS-035", "BUS-035")
def no_heartbeat(flight: Flight, rng: Random) -> Case:
    node = rng.choice([AUTOPILOT, *flight.nodes])
    return without(flight, lambda m: (m.name, m.src) == (ALIVE, node) and m.t > 3500, node, about=f"node {node}")


@kind("node not healthy", "BUS-022", "")
def unhealthy(flight: Flight, rng: Random) -> Case:
    new = rng.choice([{"health": 1}, {"health": 2}, {"health": 3}, {"mode": 2}, {"mode": 3}, {"mode": 7}])
    one = one_of(flight, rng, lambda m: m.name == ALIVE)
    chosen = [m for m in flight.messages if (m.name, m.src) == (ALIVE, one.src) and m.t >= one.t]
    return altered(flight, chosen, lambda m: m.but(**new), one.src, about=f"node {one.src} {new}")


@kind("all ESCs under voltage", "BUS-036|TYP-305", "BUS-036 TYP-305 PUSH-409 BUS-032")
def low_battery(flight: Flight, rng: Random) -> Case:
    t = moment(rng)
    chosen = [m for m in flight.messages if m.name == "ESCStatus" and t < m.t < STOP]
    new = {m: {"error_count": m.fields["error_count"] | 2, "voltage": half(m.fields["voltage"])} for m in chosen}
    return altered(flight, chosen, lambda m: m.but(**new[m]), *flight.nodes, about=f"from {t} ms")


@kind("messages of another device stop", "BUS-035", "BUS-020 TRF-016")
def other_stops(flight: Flight, rng: Random) -> Case:
    """A device that is no ESC tells its arming state at a steady pace, and then no more, or not for long."""
    node, period, t = rng.randrange(30, 60), rng.choice([50, 100, 200, 400]), moment(rng)
    back = rng.choice([END, t + 8 * period])
    times = [k * period + 11.3 for k in range(END // period)]
    name = "uavcan.equipment.safety.ArmingStatus"
    new = [Message(ms, name, node, {"status": 0}, number=k) for k, ms in enumerate(times) if not t < ms < back]
    beats = [alive(1000 * k + 333, node) for k in range(8)]
    return case(flight, [*flight.messages, *new, *beats], node, about=f"node {node} every {period} ms until {t} ms")


@kind("service not answered", "TRF-022", "")
def service_unanswered(flight: Flight, rng: Random) -> Case:
    node = esc(flight, rng)
    new = Message(rng.randrange(2200, 5000), "uavcan.protocol.GetNodeInfo.Request", AUTOPILOT, {}, dst=node)
    return case(flight, [*flight.messages, new], AUTOPILOT, node, about=f"node {node}")


@kind(
    "ESC with node ID 0",
    "CAN-009|CAN-008",
    f"{GONE} BUS-012 PUSH-201 PUSH-102 BUS-011 TRF-* TYP-301 BUS-018 CAN-* PUSH-011 BUS-014 BUS-015",
)
def nameless(flight: Flight, rng: Random) -> Case:
    node = rng.choice(flight.nodes[1:])
    chosen = [m for m in flight.messages if m.src == node and m.name in READ]
    return altered(flight, chosen, lambda m: sent(m, src=0), 0, node, GROUND, AUTOPILOT, about=f"node {node}")


@kind("anonymous message in several frames", "CAN-009", "CAN-008 BUS-030 CAN-010")
def anonymous(flight: Flight, rng: Random) -> Case:
    """Only single frames can be anonymous (DroneCAN, message transfers); this is a node that asks for an ID."""
    fields = {"node_id": 0, "first_part_of_unique_id": 1, "unique_id": [rng.randrange(256) for _ in range(12)]}
    one = encode.transfer("uavcan.protocol.dynamic_node_id.Allocation", fields, 0, rng.randrange(32), kind="anonymous")
    return case(flight, flight.messages, 0, about="allocation", extra=[(moment(rng), one.frames())])


@kind("ESC with a node ID kept for tools", "CAN-011", "TYP-301")
def reserved(flight: Flight, rng: Random) -> Case:
    node, new = flight.nodes[-1], rng.choice([126, 127])
    chosen = [m for m in flight.messages if m.src == node]
    return altered(flight, chosen, lambda m: sent(m, src=new), new, about=f"node {new}")


@kind("priority of an ESC not the lowest", "CAN-013", "")
def urgent(flight: Flight, rng: Random) -> Case:
    node, high, name = esc(flight, rng), rng.randrange(31), rng.choice(READ)
    chosen = [m for m in flight.messages if (m.name, m.src) == (name, node)]
    return altered(flight, chosen, lambda m: sent(m, priority=high), node, about=f"node {node} {name} {high}")


@kind("burst of error frames", "CAN-004 BUS-005", "TRF-004")
def errors(flight: Flight, rng: Random) -> Case:
    t, bad = moment(rng), encode.Frame(0x8, bytes(8), error=True)
    extra = [(t + 0.7 * k, [bad]) for k in range(rng.randrange(150, 400))]
    return case(flight, flight.messages, about=f"at {t} ms", extra=extra)


@kind("temperatures in the wrong unit", "PUSH-405|TYP-308|PUSH-409", "PUSH-*")
def kelvin(flight: Flight, rng: Random) -> Case:
    """4.4.5 no 19-20 is in 0.01 degrees Celsius, and says 31,000 for 36.85."""
    node = esc(flight, rng)
    chosen = [m for m in flight.messages if m.src == node and m.packet.endswith("MotorStatus")]
    new = {m: motor(node - FIRST, m.t)["temperature"] + 27315 for m in chosen}
    return altered(flight, chosen, lambda m: m.but(temperature=new[m]), node, about=f"node {node}")
