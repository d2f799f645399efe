"""What looks like a fault and is none: nothing may be said, or no more than that a capture has a begin and an end."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from bench.outside.flight import ALIVE, AUTOPILOT, FIRST, STOP, Message
from bench.outside.kinds import Kinds
from bench.outside.sending import altered, case, esc, moment, without

if TYPE_CHECKING:
    from random import Random

    from bench.outside.flight import Flight
    from bench.outside.kinds import Case
    from bench.outside.trace import Trace

OF_CAPTURES, OF_FLIGHTS = Kinds(), Kinds()
MS = 10**6
REPORTS = "ESCStatus", "PUSHCAN"
# Of transfers and requests that are there in part, and of what a recording says once.
CUT = (
    "TRF-005:note TRF-008 TRF-016:note TRF-021:note CAP-005 BUS-020:note TYP-103:note TYP-301 TYP-404 BUS-006 BUS-014 "
    "BUS-015:note BUS-027 PUSH-102:note PUSH-201:note PUSH-304:note PUSH-405 CAN-011:note"
)


@OF_CAPTURES.kind("capture begins later", "", CUT)
def later(trace: Trace, rng: Random) -> Case:
    at = rng.randrange(len(trace.frames) // 2)
    return trace.made(trace.frames[at:], *{one.session & 0x7F for one in trace.whole}, about=f"frame {at + 1}")


@OF_CAPTURES.kind("capture ends sooner", "", CUT)
def sooner(trace: Trace, rng: Random) -> Case:
    at = rng.randrange(len(trace.frames) // 2, len(trace.frames))
    nodes = {one.session & 0x7F for one in trace.whole}
    return trace.made(trace.frames[:at], *nodes, about=f"after frame {at}")


@OF_CAPTURES.kind("time stamps in whole milliseconds", "", "TRF-004:note CAP-001:note BUS-006")
def coarse(trace: Trace, _: Random) -> Case:
    return trace.made([replace(frame, t=frame.t // MS * MS) for frame in trace.frames])


@OF_CAPTURES.kind("clock of another year", "", "")
def dated(trace: Trace, rng: Random) -> Case:
    by = rng.randrange(1, 400_000_000) * 10**9
    return trace.made([replace(frame, t=frame.t - by) for frame in trace.frames], about=f"{by // 10**9} s ago")


@OF_FLIGHTS.kind("node IDs from elsewhere", "", "TYP-301 TYP-404")
def moved(flight: Flight, rng: Random) -> Case:
    by = rng.randrange(20, 80)
    new = flight.made(lambda m: replace(m, src=m.src + by) if m.src >= FIRST and m.src < 100 else m)
    return case(flight, new, *(node + by for node in flight.nodes), about=f"{by} higher")


@OF_FLIGHTS.kind("ESC that reports less often at rest", "", "BUS-018:note")
def slower_at_rest(flight: Flight, rng: Random) -> Case:
    """The transfer IDs stay consecutive; after landing every tenth report is sent."""
    node = esc(flight, rng)
    mine = sorted((m for m in flight.messages if (m.name, m.src) == ("ESCStatus", node)), key=lambda m: m.t)
    gone = {m for k, m in enumerate(mine) if m.t > STOP + 200 and k % 10}
    return without(flight, lambda m: m in gone, node, about=f"node {node}")


@OF_FLIGHTS.kind("throttle at both ends of its range", "", "BUS-028:note")
def extremes(flight: Flight, rng: Random) -> Case:
    """4.4.1: 0 and 8191 are right; for a moment the motor cannot follow."""
    t, value = moment(rng), rng.choice([0, 8191])
    chosen = [m for m in flight.messages if m.name == "RawCommand" and t < m.t < t + 60]
    return altered(flight, chosen, lambda m: m.but(cmd=[value] * flight.escs), AUTOPILOT, about=f"{value} at {t} ms")


@OF_FLIGHTS.kind("largest values that are right", "", "BUS-032:note PUSH-409")
def largest(flight: Flight, rng: Random) -> Case:
    """4.4.3: encoder 16383, throttle 100 %, all in one report."""
    node = esc(flight, rng)
    mine = [m for m in flight.messages if (m.name, m.src) == ("ESCStatus", node)]
    at = rng.randrange(40, len(mine) - 60)
    new = {"error_count": 16383 << 16 | 4 << 12, "power_rating_pct": 100}
    return altered(flight, mine[at : at + 1], lambda m: m.but(**new), node, about=f"node {node}")


@OF_FLIGHTS.kind("ESC that wakes late", "", "TYP-103:note BUS-027:note BUS-014")
def wakes_late(flight: Flight, rng: Random) -> Case:
    """The last ESC begins to report while all rest, with its transfer IDs at 0 (4.1.3)."""
    node, t = flight.nodes[-1], rng.randrange(100, 600)
    names = {"ESCStatus", ALIVE}
    return without(
        flight, lambda m: m.src == node and m.name in names and m.t < t, node, about=f"node {node} at {t} ms"
    )


@OF_FLIGHTS.kind("motor that coasts down", "", "")
def coasts(flight: Flight, rng: Random) -> Case:
    """It turns for 400 ms after its throttle is 0 (4.4.3 mode 5)."""
    node = esc(flight, rng)

    def slow(one: Message) -> Message:
        rpm = int(300 * (1 - (one.t - STOP) / 400)) * (-1 if (node - FIRST) % 2 else 1)
        if one.packet:
            return one.but(speed=rpm)
        return one.but(rpm=rpm, error_count=5 << 12 | one.fields["error_count"] >> 16 << 16)

    mine = [m for m in flight.messages if m.src == node and m.name in REPORTS and STOP + 60 < m.t < STOP + 400]
    return altered(flight, mine, slow, node, about=f"node {node}")
