"""Helpers of several faults: choosing transfers and senders, sending transfers of their own."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from dissectors.layout import ArrayType, CompoundType, Member, PrimitiveType
from dissectors.schema import Message
from dissectors.times import SECOND
from dissectors.traffic import LOWEST, BusNode, Case, Sending, SimulatedFrame, Step, next_id

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.traffic import Values

LOG = "uavcan.protocol.debug.LogMessage"
BYTES = CompoundType("bytes", (Member("data", ArrayType(PrimitiveType("uint", 8), 4095, dynamic=True)),))


def telemetry(sending: Sending) -> bool:
    """Return if it is a report in several frames: a broadcast, always of the same size, that drives nothing."""
    several = len(sending.frames) > 1 if sending.frames else len(sending.payload) > 7
    return several and _report(sending)


def beacon(sending: Sending) -> bool:
    """Return if it is such a report in a single frame."""
    return len(sending.frames) == 1 and _report(sending)


def _report(sending: Sending) -> bool:
    message = sending.message
    plain = message.kind == "message" and not message.actuates and not sending.anonymous
    return plain and message.min_bytes == message.max_bytes > 0


def unshown(sending: Sending) -> bool:
    """Return if its loss would look like a restart: the next transfer ID is 0."""
    return sending.transfer_id == 31


def same(sending: Sending) -> tuple[int, str, int | None]:
    """Return what the transfers of one session have in common: node, table and destination."""
    return sending.node, sending.message.table, sending.dst


def copied(frames: list[SimulatedFrame], sending: Sending) -> list[SimulatedFrame]:
    """Return the same frames once more, which are part of the same answer."""
    return [replace(frame, sending=sending) for frame in frames]


def number(case: Case, name: str) -> int:
    """Return a setting that counts or numbers something."""
    return int(case.options[name])


def nanoseconds(case: Case, name: str) -> int:
    """Return a setting in seconds as ns."""
    return round(float(case.options[name]) * SECOND)


def device(case: Case, number: int, name: str) -> BusNode:
    """Return the device with a number; one that joins the bus is part of the answer, and what others say to it."""
    there = case.world.node(number)
    if there is None:
        there = case.world.device(number, name)
        case.watch(lambda sending: number in {sending.node, sending.dst})
    return there


def sender(case: Case, usual: BusNode | None = None) -> BusNode:
    """Return the device that the settings name, else the usual one, else any motor controller that is running."""
    wanted = case.options.get("node")
    if wanted is not None:
        return device(case, int(wanted), "org.example.device")
    if usual is not None:
        return usual
    escs: list[BusNode] = [esc.node for esc in case.vehicle.escs]
    running = [node for node in escs if node.number and not node.silent]
    return case.random.choice(running or escs)


def transmit(
    case: Case,
    node: BusNode,
    name: str | Message,
    values: Values,
    shape: Callable[[Sending], None] | None = None,
    *,
    dst: int | None = None,
    priority: int = LOWEST,
    transfer_id: int | None = None,
) -> Sending:
    """Send a transfer that is there for the fault's sake: the answer lists it, nobody else listens to it.

    `shape` may change its frames before they are sent.
    """
    message = case.world.message(name) if isinstance(name, str) else name
    if transfer_id is None:
        transfer_id = next_id(node, message.table, dst)
    sending = Sending(node.number, message, values, dst, priority, transfer_id, message.signature)
    return dispatch(case, sending, shape)


def dispatch(case: Case, sending: Sending, shape: Callable[[Sending], None] | None = None) -> Sending:
    """Send a transfer that is there for the fault's sake."""
    sending.damaged = sending.changed = True
    case.mark(sending)

    def once(_: Case, passing: Sending) -> Step:
        if passing is not sending:
            return Step.SKIP
        if shape is not None:
            shape(sending)
        return Step.DONE

    if shape is not None:
        case.touch("frames", once)
    case.world.send(sending)
    return sending


def text(line: str) -> Values:
    """Return the values of a `LOG`: a transfer of several frames in a session that has no other."""
    return {"level": {"value": 1}, "source": b"esc", "text": line.encode()}


def unknown(type_id: int, signature: int) -> Message:
    """Return a message type of which no receiver knows more than its number; any bytes are its payload."""
    return Message(str(type_id), str(type_id), "message", type_id, signature, BYTES)


def repeat(case: Case, period: int, times: int, do: Callable[[int], object]) -> None:
    """Call with 0, 1, ... now and every `period` ns."""

    def step(turn: int) -> None:
        do(turn)
        if turn + 1 < times:
            case.world.at(case.world.now + period, partial(step, turn + 1))

    step(0)


def inject(case: Case, frames: list[SimulatedFrame]) -> None:
    """Send frames of nobody on this bus."""
    for frame in frames:
        case.mark(frame)
    case.world.put(frames)
