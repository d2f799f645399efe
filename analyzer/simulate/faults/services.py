"""Faults of services: requests without answers, answers that come late, twice, unasked or in a hurry."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.simulate.faults.helpers import nanoseconds, number, sender, transmit
from dissectors.times import MICROSECOND, MILLISECOND, SECOND
from dissectors.traffic import LOWEST, Fault

if TYPE_CHECKING:
    from dissectors.traffic import BusNode, Case, Sending, Values

_REQUEST = "uavcan.protocol.GetNodeInfo.Request"
_RESPONSE = "uavcan.protocol.GetNodeInfo.Response"
# How long a server usually thinks.
_THINKING = 300 * MICROSECOND
# What takes longer is slow; what takes as long as the second is not answered.
_SLOW, _UNANSWERED = 500 * MILLISECOND, SECOND


def _client(case: Case, server: BusNode) -> BusNode:
    """Return the ground station; if that is the server, the autopilot."""
    ground: BusNode = case.vehicle.ground
    autopilot: BusNode = case.vehicle.autopilot
    return ground if ground.number != server.number else autopilot


def _ask(case: Case, server: BusNode) -> Sending:
    """Send a request, which the fault alone answers."""
    return transmit(case, _client(case, server), _REQUEST, {}, dst=server.number)


def _answer(
    case: Case,
    server: BusNode,
    request: Sending,
    after: int = _THINKING,
    priority: int = LOWEST,
    values: Values | None = None,
) -> None:
    case.answer.node, case.answer.type = server.number, _RESPONSE

    def answer() -> None:
        mine = values or server.introduction
        of, to = request.transfer_id, request.node
        transmit(case, server, _RESPONSE, mine, dst=to, priority=priority, transfer_id=of)

    case.world.at(case.world.now + after, answer)


def _unasked(case: Case) -> None:
    server = sender(case)
    client = _client(case, server)
    transfer_id = case.random.randrange(32)
    case.say(f"node {server.number} answers node {client.number}, which did not ask: transfer ID {transfer_id}")
    transmit(case, server, _RESPONSE, server.introduction, dst=client.number, transfer_id=transfer_id)


def _unanswered(case: Case) -> None:
    server = sender(case)
    request = _ask(case, server)
    case.say(f"node {server.number} does not answer the GetNodeInfo request of node {request.node}")


def _slow(case: Case) -> None:
    server, after = sender(case), nanoseconds(case, "after")
    if after <= _SLOW:
        return
    case.answer.also = ("TRF-022",) if after > _UNANSWERED else ()
    request = _ask(case, server)
    case.say(f"node {server.number} answers node {request.node} only {after / MILLISECOND:g} ms after it was asked")
    _answer(case, server, request, after)


def _twice(case: Case) -> None:
    server, again = sender(case), 20 * MILLISECOND
    request, values = _ask(case, server), server.introduction
    case.say(f"node {server.number} sends its answer to node {request.node} a second time after 20 ms")
    _answer(case, server, request, values=values)
    _answer(case, server, request, _THINKING + again, values=values)


def _urgent(case: Case) -> None:
    server, priority = sender(case), number(case, "priority") & 31
    if priority == LOWEST:
        return
    request = _ask(case, server)
    case.say(f"node {server.number} answers a request of priority {request.priority} with priority {priority}")
    _answer(case, server, request, priority=priority)


FAULTS: tuple[Fault, ...] = (
    Fault("TRF-021", "a response that nobody asked for", start=_unasked),
    Fault("TRF-022", "a request that is not answered", start=_unanswered, lasts=1200 * MILLISECOND),
    Fault(
        "TRF-023",
        "a response that comes late",
        start=_slow,
        options={"after": 0.7},
        lasts=900 * MILLISECOND,
    ),
    Fault(
        "TRF-024",
        "a request is answered twice",
        start=_twice,
        also=("TRF-017", "TRF-021"),
        lasts=50 * MILLISECOND,
    ),
    Fault(
        "TRF-025",
        "a response has another priority than its request",
        start=_urgent,
        options={"priority": 16},
    ),
)
