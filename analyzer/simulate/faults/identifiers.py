"""Faults of the 29-bit identifier: services that address nobody, anonymous nodes, reserved and unknown numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.simulate import wire
from analyzer.simulate.faults.helpers import (
    device,
    dispatch,
    nanoseconds,
    number,
    repeat,
    sender,
    transmit,
    unknown,
)
from dissectors.times import MILLISECOND, SECOND
from dissectors.traffic import LOWEST, Fault, Sending

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.traffic import BusNode, Case

_READ = "uavcan.protocol.file.Read.Request"
_ALLOCATION = "uavcan.protocol.dynamic_node_id.Allocation"
_NODE = 0x7F
# 14 bits of the identifier of an anonymous frame.
_DISCRIMINATOR = 0x3FFF
_SERVO = "com.himark.servo.ServoInfo"
# No known type has this number of the range for vendors.
_UNKNOWN = unknown(20813, 0x5A17C0DE0B5E55ED)


def _read(case: Case, node: BusNode, dst: int, shape: Callable[[Sending], None] | None = None) -> None:
    """Send a request in several frames, so that its CRC proves whose traffic it is."""
    transmit(case, node, _READ, {"offset": 0, "path": {"path": b"/log/17.bin"}}, shape, dst=dst)


def _to_nobody(case: Case) -> None:
    node = sender(case, case.vehicle.ground)
    case.say(f"node {node.number} sends a request to node 0")
    _read(case, node, 0)


def _from_nobody(case: Case) -> None:
    server: BusNode = case.vehicle.autopilot
    node = sender(case, case.vehicle.ground)

    def shape(sending: Sending) -> None:
        for frame in sending.frames:
            frame.id &= ~_NODE

    case.answer.node = 0
    case.say(f"a request to node {server.number} has the source node 0 (node {node.number} lost its own)")
    _read(case, node, server.number, shape)


def _to_itself(case: Case) -> None:
    node = sender(case, case.vehicle.ground)
    case.say(f"node {node.number} sends a request to node {node.number}")
    _read(case, node, node.number)


def _anonymous(case: Case, own: bytes, turn: int, shape: Callable[[Sending], None] | None = None) -> None:
    message = case.world.message(_ALLOCATION)
    values = {"node_id": 0, "first_part_of_unique_id": len(own) < 16, "unique_id": own}
    sending = Sending(0, message, values, None, LOWEST, turn % 32, message.signature, anonymous=True)
    dispatch(case, sending, shape)


def _asks(case: Case) -> None:
    times, own = number(case, "times"), case.random.randbytes(6)
    case.say(f"a node without a number asks for one {times} times, and nobody answers")
    repeat(case, case.random.randrange(600, 1000) * MILLISECOND, times, lambda turn: _anonymous(case, own, turn))


def _asks_at_length(case: Case) -> None:
    """Ask with the whole unique ID at once; the legal requests that follow say that DroneCAN is spoken here."""
    own = case.random.randbytes(16)
    case.say("an anonymous node sends its whole 16-byte unique ID at once, in 3 frames; then 4 times 6 bytes of it")
    repeat(case, 60 * MILLISECOND, 5, lambda turn: _anonymous(case, own[:6] if turn else own, turn))


def _throws_dice(case: Case) -> None:
    own = case.random.randbytes(6)

    def shape(sending: Sending) -> None:
        check = wire.crc16(sending.payload)
        windows = {check >> low & _DISCRIMINATOR for low in range(3)}
        thrown = case.random.choice([code for code in range(_DISCRIMINATOR) if code not in windows])
        sending.frames[0].id = sending.frames[0].id & ~(_DISCRIMINATOR << 10) | thrown << 10
        case.say(f"the discriminator of an anonymous frame is {thrown:04X}, the CRC-16 of its payload {check:04X}")

    _anonymous(case, own, 0, shape)


def _reserved(case: Case) -> None:
    tool = device(case, number(case, "id"), "org.example.tool")
    client: BusNode = case.vehicle.autopilot
    case.answer.node, case.answer.type = tool.number, "uavcan.protocol.GetNodeInfo.Response"
    case.say(f"node {tool.number}, a number kept for tools, answers a GetNodeInfo request of node {client.number}")
    dst = client.number
    asked = client.send("uavcan.protocol.GetNodeInfo.Request", {}, dst=tool.number)
    case.watch(lambda sending: (sending.node, sending.dst) == (tool.number, dst), asked.t + SECOND)


# So many transfers with rising IDs make a type believable.
_BELIEVED = 3


def _strange(case: Case) -> None:
    node, times, period = sender(case), number(case, "times"), nanoseconds(case, "period")
    if times < _BELIEVED:
        return

    def report(turn: int) -> None:
        data = (turn, 0, *case.random.randbytes(2), 0x1B, case.random.randrange(0x40, 0x48))
        transmit(case, node, _UNKNOWN, {"data": bytes(data)})

    case.say(f"node {node.number} sends {times} transfers of the unknown message type {_UNKNOWN.type_id}")
    repeat(case, period, times, report)


def _servo(case: Case) -> None:
    servo = sender(case, case.vehicle.ground) if "node" in case.options else device(case, 40, "com.himark.servo")
    times, case.answer.type = number(case, "times"), _SERVO

    def report(turn: int) -> None:
        values = {"servo_id": 0, "pwm_input": 1500 + turn, "pos_cmd": 90 * turn, "pos_sensor": 90 * turn - 7}
        values |= {"voltage": 740, "current": 35, "pcb_temp": 390, "motor_temp": 400, "error_status": 0}
        transmit(case, servo, _SERVO, values)

    case.say(f"node {servo.number} sends {times} transfers of {_SERVO}, a vendor's type with an ID below 20000")
    repeat(case, 50 * MILLISECOND, times, report)


FAULTS: tuple[Fault, ...] = (
    Fault("CAN-006", "a request to node 0", start=_to_nobody, also=("TRF-022",)),
    Fault("CAN-007", "a request from node 0", start=_from_nobody, also=("TRF-022",)),
    Fault(
        "CAN-008",
        "an anonymous node asks for a node ID",
        start=_asks,
        options={"times": 3},
        also=("BUS-030",),
    ),
    Fault(
        "CAN-009",
        "an anonymous node sends a transfer of several frames",
        start=_asks_at_length,
        also=("CAN-008", "CAN-010", "BUS-030"),
        lasts=300 * MILLISECOND,
    ),
    Fault(
        "CAN-010",
        "the discriminator of an anonymous frame does not come from its payload",
        start=_throws_dice,
        also=("CAN-008", "BUS-030"),
    ),
    Fault(
        "CAN-011",
        "a node with an ID kept for tools answers as a server",
        start=_reserved,
        options={"id": 127},
        limits={"id": (126, 127)},
    ),
    Fault("CAN-012", "a request that is addressed to its sender", start=_to_itself, also=("TRF-022",)),
    Fault(
        "CAN-015",
        "a data type that nobody knows",
        start=_strange,
        options={"times": 12, "period": 0.05},
        lasts=600 * MILLISECOND,
    ),
    Fault(
        "CAN-017",
        "a vendor's type whose ID lies in the standard range",
        start=_servo,
        options={"times": 10},
        lasts=500 * MILLISECOND,
    ),
)
