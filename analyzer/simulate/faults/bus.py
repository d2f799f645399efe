"""Faults of a bus as a whole: too much traffic, bus errors, devices with one number, devices that fail or restart."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.simulate.faults.helpers import LOG, inject, nanoseconds, number, repeat, same, sender, text, transmit
from dissectors.times import MILLISECOND, SECOND
from dissectors.traffic import Fault, SimulatedFrame, Step, next_id

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending

_STATUS = "uavcan.protocol.NodeStatus"
_TIME = "uavcan.protocol.GlobalTimeSync"
_COMPASS = "uavcan.equipment.ahrs.MagneticFieldStrength"
_ALLOCATION = "uavcan.protocol.dynamic_node_id.Allocation"
_FLOOD_PERIOD = 10 * MILLISECOND
# Nominal bits of a full frame of 8 bytes with an extended identifier.
_FULL = 131
_ERROR_PERIOD = 20 * MILLISECOND
# After this without NodeStatus a node counts as offline.
_OFFLINE = 3 * SECOND
_COVARIANCE = "magnetic_field_covariance"
_COMPASS_PERIOD, _COMPASS_TIMES, _COMPASS_AGAIN = 100 * MILLISECOND, 25, 4
_CONFLICT_EVERY = 50 * MILLISECOND


def _flood(case: Case) -> None:
    """Send a bootloader's dump of its memory, as debugging text, on top of everything else."""
    node = sender(case)
    share, times = float(case.options["share"]), nanoseconds(case, "seconds") // _FLOOD_PERIOD
    lines = max(1, round(share * case.world.bit_rate * _FLOOD_PERIOD / SECOND / _FULL / 13))

    def dump(turn: int) -> None:
        for line in range(lines):
            transmit(case, node, LOG, text(f"{turn:06}.{line:03} " + "5A" * 37))

    case.say(f"node {node.number} sends {lines} lines of debugging text every 10 ms, {times} times")
    repeat(case, _FLOOD_PERIOD, times, dump)


def _errors(case: Case) -> None:
    """Play a bad connection: error frames in a row while the error counter goes up."""
    times = number(case, "count_of")

    def report(turn: int) -> None:
        inject(case, [SimulatedFrame(0x88, bytes((0, 0, 0x04, 0x0A, 0, 0, 0, min(8 * (turn + 1), 127))), error=True)])

    case.say(f"{times} error frames, one every 20 ms")
    repeat(case, _ERROR_PERIOD, times, report)


def _twin(case: Case) -> None:
    """Let a second device under the number of the first one send the same, with counters of its own."""
    node = sender(case)
    twin = case.world.device(0, "org.example.twin", silent=False)
    twin.number = node.number
    counts: dict[tuple[str, int | None], int] = {}
    offset, until = case.random.randrange(9, 23), case.world.now + nanoseconds(case, "seconds")

    def double(case: Case, sending: Sending) -> Step:
        if sending.t > until:
            return Step.DONE
        if sending.node != node.number or sending.changed or sending.message.kind != "message":
            return Step.MORE
        table, dst = same(sending)[1:]
        mine = counts.setdefault((table, dst), (sending.transfer_id + offset) % 32)
        counts[table, dst] = (mine + 1) % 32
        transmit(case, twin, sending.message, sending.values, dst=dst, priority=sending.priority, transfer_id=mine)
        return Step.MORE

    case.say(f"a second device sends as node {node.number}, its transfer IDs {offset} ahead")
    case.touch("values", double)


def _mute(case: Case) -> None:
    """Leave out NodeStatus of one node between two of them, though the node goes on with its other work."""
    node, span, last = sender(case), nanoseconds(case, "seconds"), [-1]

    def hold(_: Case, sending: Sending) -> Step:
        if sending.name != _STATUS or sending.node != node.number or sending.changed:
            return Step.MORE
        if last[0] < 0:
            case.mark(sending)
            last[0] = sending.t
            return Step.MORE
        if sending.t >= last[0] + span:
            case.mark(sending)
            return Step.DONE
        # It was never sent, so it takes no transfer ID.
        node.transfer_ids[_STATUS, None] = sending.transfer_id
        sending.frames = []
        return Step.MORE

    case.say(f"node {node.number} sends no NodeStatus for {float(case.options['seconds']):g} s")
    case.touch("frames", hold)


def _stop(case: Case) -> None:
    """Let a node send what its compass measures, and stop for some time."""
    node, span = sender(case), nanoseconds(case, "seconds")

    def measure(_: int) -> None:
        values = {"magnetic_field_ga": [case.random.uniform(-0.5, 0.5) for _ in range(3)], _COVARIANCE: []}
        transmit(case, node, _COMPASS, values, transfer_id=next_id(node, _COMPASS))

    repeat(case, _COMPASS_PERIOD, _COMPASS_TIMES, measure)
    again = case.world.now + (_COMPASS_TIMES - 1) * _COMPASS_PERIOD + span
    case.world.at(again, lambda: repeat(case, _COMPASS_PERIOD, _COMPASS_AGAIN, measure))
    case.say(f"node {node.number} sends no {_COMPASS} for {float(case.options['seconds']):g} s")


def _restart(case: Case) -> None:
    node = sender(case)
    case.world.at(case.world.now + 10 * MILLISECOND, node.restart)
    case.watch(
        lambda sending: sending.name == _STATUS and sending.node == node.number,
        case.world.now + nanoseconds(case, "shown"),
    )
    case.say(f"node {node.number} restarts: uptime and transfer IDs begin at zero")


def _ill(case: Case) -> None:
    node = sender(case)
    health, mode = number(case, "health"), number(case, "mode")
    if not health and not mode:
        return
    usual = node.health, node.mode
    node.health, node.mode = health, mode
    case.watch(
        lambda sending: (
            sending.name == _STATUS
            and sending.node == node.number
            and (sending.values["health"], sending.values["mode"]) == (health, mode)
        ),
        case.world.now + nanoseconds(case, "seconds") + SECOND,
    )

    def well() -> None:
        node.health, node.mode = usual

    case.world.at(case.world.now + nanoseconds(case, "seconds"), well)
    case.say(f"node {node.number} reports health {health}, mode {mode} for {float(case.options['seconds']):g} s")


def _conflict(case: Case) -> None:
    """Play an allocator that forgot what it granted: one unique ID is given two node IDs."""
    server = sender(case)
    unique = bytes(case.random.randrange(256) for _ in range(16))
    for turn, given in enumerate((100, 101)):
        values = {"node_id": given, "first_part_of_unique_id": 0, "unique_id": unique}
        case.world.at(
            case.world.now + turn * _CONFLICT_EVERY,
            lambda values=values: transmit(case, server, _ALLOCATION, values),  # type: ignore[misc]
        )
    case.say(f"node {server.number} grants one unique ID the node IDs 100 and 101")


def _masters(case: Case) -> None:
    """Let two nodes say what time it is."""
    first, second = case.random.sample([esc.node for esc in case.vehicle.escs], 2)
    times = max(2, nanoseconds(case, "seconds") // (500 * MILLISECOND))
    before = {first.number: 0, second.number: 0}

    def tell(turn: int) -> None:
        for node, late in ((first, 0), (second, 100_000)):
            values = {"previous_transmission_timestamp_usec": before[node.number]}
            transmit(case, node, _TIME, values, transfer_id=next_id(node, _TIME))
            before[node.number] = case.world.now // 1000 + late + turn

    case.say(f"nodes {first.number} and {second.number} both send GlobalTimeSync")
    repeat(case, 500 * MILLISECOND, times, tell)


FAULTS: tuple[Fault, ...] = (
    Fault(
        "BUS-004",
        "one node floods the bus with debugging text",
        start=_flood,
        options={"share": 0.45, "seconds": 2.0},
        limits={"share": (0.05, 0.8)},
        lasts=2 * SECOND,
        also=("BUS-001", "BUS-002", "BUS-003", "BUS-006", "BUS-018", "TRF-027"),
    ),
    Fault(
        "BUS-005",
        "error frames in a row: a bad connection",
        start=_errors,
        options={"count_of": 20},
        limits={"count_of": (11, 1000)},
        lasts=SECOND,
        also=("CAN-004",),
    ),
    Fault(
        "BUS-010",
        "a second device uses the number of the first one",
        start=_twin,
        options={"seconds": 3.0},
        lasts=2 * SECOND,
        also=(
            *("TRF-016", "TRF-017", "TRF-018", "TRF-019", "TRF-026", "TRF-003", "TRF-005", "TRF-006", "TRF-009"),
            *("TYP-501", "TYP-502", "TYP-503", "PUSH-009", "BUS-001", "BUS-003", "BUS-018", "BUS-021"),
        ),
    ),
    Fault(
        "BUS-020",
        "a node sends no NodeStatus for more than 3 s, but everything else",
        start=_mute,
        options={"seconds": 3.6},
        limits={"seconds": (3.1, 3600)},
        lasts=_OFFLINE + 2050 * MILLISECOND,
        exact=True,
    ),
    Fault(
        "BUS-035",
        "a node stops sending what it measures",
        start=_stop,
        options={"seconds": 1.2},
        limits={"seconds": (0.6, 3600)},
        lasts=_COMPASS_TIMES * _COMPASS_PERIOD + 1700 * MILLISECOND,
    ),
    Fault(
        "BUS-021",
        "a node restarts",
        start=_restart,
        options={"shown": 1.2},
        lasts=1500 * MILLISECOND,
        also=("TRF-019",),
    ),
    Fault(
        "BUS-022",
        "a node reports that it is not well",
        start=_ill,
        options={"health": 2, "mode": 0, "seconds": 2.0},
        limits={"health": (0, 3), "mode": (0, 7)},
        lasts=SECOND,
    ),
    Fault(
        "BUS-030",
        "one unique ID is granted two node IDs",
        start=_conflict,
        lasts=200 * MILLISECOND,
    ),
    Fault(
        "BUS-031",
        "two nodes send the time",
        start=_masters,
        options={"seconds": 1.5},
        lasts=700 * MILLISECOND,
    ),
)
