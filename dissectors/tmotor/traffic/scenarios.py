"""How a vehicle fails, and what its bus shows of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.faults.status import STATUS
from dissectors.tmotor.traffic.operation import ERROR
from dissectors.tmotor.traffic.physics.motor import HEAT_CAPACITY
from dissectors.tmotor.traffic.throttle import FULL
from dissectors.traffic import Scenario, Step, change

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending, Story

_UNDER_VOLTAGE, _THROTTLE_LOSS, _OVER_TEMPERATURE = 1, 3, 5
_LOOK = 20 * MILLISECOND
_TOLD = ("PUSH-410",)  # MotorStatus tells the same flags
# uavcan.protocol.NodeStatus: health of a device that cannot do its work.
_HEALTH_ERROR = 2
# The failing ESC gives up this many K above its limit.
_BEYOND = 10.0
# Volts a cell: an ESC warns below the first.
_LOW_CELL = 3.45
# A throttle that should turn a motor, as a share of all.
_COMMANDED = 0.1
# Of the transfers of a driver that mixes up its mailboxes, so many come out wrong.
_MIXED = 0.15


def _shows(case: Case, node: int, bit: int) -> None:
    """List every ESCStatus of a node in which a status bit is set."""
    case.watch(
        lambda sending: STATUS(sending) and sending.node == node and bool(sending.values["error_count"] >> bit & 1)
    )


def _later(story: Story, share: float) -> int:
    """Return the time at which this share of the flight is over."""
    return round(story.world.end * share)


def _esc_failure(story: Story) -> None:
    story.world.at(_later(story, 0.35), lambda: _overheat(story, story.random.choice(story.vehicle.escs)))


def _overheat(story: Story, esc: Any) -> None:
    world, motor, node = story.world, esc.motor, esc.node.number
    limit, seconds = esc.parameters["esc_ot_threshold"], 0.2 * world.end / SECOND
    watts = round((limit + _BEYOND - motor.temperature) * (HEAT_CAPACITY / seconds + 0.4))
    story.tell(f"the ESC with index {esc.index} (node {node}) loses its cooling: {watts} W too much heat it up")
    story.settle("esc", nodes=(node,), channels=(esc.index + 1,), within=round(seconds * SECOND))
    esc.heat += watts
    if not esc.stock:
        _shows(
            story.case("TYP-305", f"over-temperature of node {node}, limit {limit} degC", _TOLD),
            node,
            _OVER_TEMPERATURE,
        )
    warned = False

    def look() -> None:
        nonlocal warned
        if motor.temperature > limit and not warned:
            warned = True
            story.tell(f"node {node} is hotter than its limit of {limit} degC and says so")
        if motor.temperature < limit + _BEYOND:
            world.at(world.now + _LOOK, look)
        else:
            _give_up(story, esc)

    look()


def _give_up(story: Story, esc: Any) -> None:
    """Enter error mode: the motor runs out, while the autopilot goes on commanding it."""
    node = esc.node.number
    story.tell(f"node {node} goes into error mode at {esc.motor.temperature:.0f} degC and stops its motor in flight")
    esc.heat, esc.mode, esc.node.health = 0.0, ERROR, _HEALTH_ERROR

    def health(sending: Sending) -> bool:
        return sending.name == "uavcan.protocol.NodeStatus" and sending.node == node

    story.case("BUS-022", f"node {node} reports health ERROR").watch(health)
    stands = story.case("BUS-028", f"node {node} stands still while it is commanded to turn")
    commanded = round(_COMMANDED * FULL)
    stands.watch(
        lambda sending: (
            STATUS(sending)
            and sending.node == node
            and sending.values["rpm"] == 0
            and story.vehicle.command(esc.index) > commanded
        )
    )
    if not esc.stock:
        error = story.case("TYP-306", f"error mode of node {node}", ("PUSH-401", "PUSH-410"))
        error.watch(
            lambda sending: (
                STATUS(sending) and sending.node == node and sending.values["error_count"] >> 12 & 15 == ERROR
            )
        )


def _command_loss(story: Story) -> None:
    story.world.at(_later(story, 0.5), lambda: _stop_commanding(story))


def _stop_commanding(story: Story) -> None:
    vehicle = story.vehicle
    if not any(esc.throttle.started for esc in vehicle.escs):  # it never began
        return
    story.tell("the autopilot's control loop hangs: no more RawCommand, while its NodeStatus goes on")
    story.settle("commands-lost", within=50 * MILLISECOND)
    vehicle.commanding = False
    for esc in vehicle.escs:
        node = esc.node.number
        if not esc.stock:
            _shows(story.case("TYP-305", f"throttle loss of node {node}", _TOLD), node, _THROTTLE_LOSS)
    lost = story.case(
        "BUS-007", "no RawCommand until the end of the recording; the ESCs stop after their timeout", ("BUS-017",)
    )
    begin = story.world.now + 100 * MILLISECOND
    lost.watch(lambda sending: STATUS(sending) and sending.t > begin)


def _reordering(story: Story) -> None:
    story.world.at(_later(story, 0.2), lambda: _mix_up(story, story.random.choice(story.vehicle.escs).node.number))


def _mix_up(story: Story, node: int) -> None:
    story.tell(f"from now on the driver of node {node} sends by mailbox number when all mailboxes were free")
    story.settle("none", ("none", "wiring", "esc", "unknown"))
    case = story.case(
        "TRF-003",
        f"about one in seven transfers of several frames from node {node}: the third frame before the second",
        ("TRF-005", "TRF-006"),
    )

    def swap(_: Case, sending: Sending) -> Step:
        frames = sending.frames
        frames[1], frames[2] = frames[2], frames[1]
        sending.damaged = True
        return Step.MORE

    def mixed(sending: Sending) -> bool:
        return sending.node == node and len(sending.frames) >= 3 and story.random.random() < _MIXED

    change(case, "frames", mixed, swap)


def _duplicate_node(story: Story) -> None:
    """Play two ESCs of which the second was never given a node ID of its own."""
    first, second = story.vehicle.escs[-2:]
    node, own = first.node.number, second.node.number
    story.tell(f"the ESC with index {second.index} was replaced and has node ID {node} instead of {own}")
    story.settle("address", nodes=(node,), channels=(first.index + 1, second.index + 1), within=SECOND)
    second.node.number = node
    case = story.case(
        "BUS-010",
        f"the ESCs with index {first.index} and {second.index} both use node ID {node}",
        (
            *("TRF-016", "TRF-017", "TRF-018", "TRF-019", "TRF-021", "TRF-024", "TRF-026", "TRF-003", "TRF-005"),
            *("TRF-006", "TYP-403", "TYP-501", "TYP-502", "TYP-503", "PUSH-009", "PUSH-407", "PUSH-409", "BUS-021"),
        ),
    )
    case.watch(lambda sending: STATUS(sending) and sending.node == node)


def _pack_sag(story: Story) -> None:
    story.world.at(_later(story, 0.4), lambda: _weaken(story))


def _weaken(story: Story) -> None:
    """Weaken the pack: its resistance rises step by step until the voltage breaks down."""
    world, vehicle = story.world, story.vehicle
    pack, low = vehicle.pack, _LOW_CELL * vehicle.pack.cells
    story.tell(f"a cell of the pack fails: {pack.voltage:.1f} V now, and falling under load")
    story.settle("battery", within=_later(story, 0.3))
    for esc in vehicle.escs:
        node = esc.node.number
        if not esc.stock:
            _shows(
                story.case("TYP-305", f"under-voltage of node {node}, below {low:.1f} V", _TOLD), node, _UNDER_VOLTAGE
            )
    said = False

    def look() -> None:
        nonlocal said
        if pack.voltage > low - 2.0:
            pack.resistance *= 1.02
        below = pack.voltage < low
        if below and not said:
            said = True
            story.tell(f"every ESC reports under-voltage: the pack is below {low:.1f} V")
        for esc in vehicle.escs:
            esc.fault_bits = esc.fault_bits & ~(1 << _UNDER_VOLTAGE) | below << _UNDER_VOLTAGE
        world.at(world.now + _LOOK, look)

    look()


SCENARIOS = (
    Scenario(
        "esc-failure",
        "an ESC fails in flight: it overheats, goes into error mode and stops while it is commanded",
        "One ESC loses its cooling in hover. Its temperature rises over seconds, it reports over-temperature, then"
        " goes into error mode and lets its motor run out, although the autopilot commands it on and on. The "
        "others take over its share of the thrust.",
        _esc_failure,
        rules=("BUS-022", "BUS-028"),
        seconds=14.0,
    ),
    Scenario(
        "command-loss",
        "the autopilot stops commanding",
        "Half way through the flight the autopilot's control loop hangs. Its NodeStatus goes on, its RawCommand "
        "does not: every ESC holds its last throttle until the timeout, reports throttle loss and lets its motor "
        "run down.",
        _command_loss,
        rules=("BUS-007",),
        seconds=10.0,
    ),
    Scenario(
        "reordering",
        "one node loses frames by transmit reordering",
        "The CAN driver of one ESC fills three mailboxes at once, and its controller sends them in the order of "
        "the mailboxes instead of the order of time. Every now and then the last frame of a transfer overtakes the"
        " middle one; every receiver throws the transfer away, although no frame was lost on the bus.",
        _reordering,
        rules=("TRF-003",),
        seconds=10.0,
    ),
    Scenario(
        "duplicate-node",
        "two devices share a node ID",
        "A replaced ESC was put on the bus with the node ID of its neighbour. Both report under one ID: transfer "
        "IDs, data sequences and counters of two devices are interleaved, one GetNodeInfo request has two answers,"
        " and one ID has two unique IDs and two indexes.",
        _duplicate_node,
        rules=("BUS-010",),
        seconds=10.0,
        least=2,
    ),
    Scenario(
        "pack-sag",
        "the pack sags",
        "A cell of the battery goes bad in hover. Its resistance rises, the voltage of all ESCs sags together with"
        " the current; the autopilot raises the throttle to keep its thrust, which makes it worse, until every ESC"
        " reports under-voltage.",
        _pack_sag,
        rules=("TYP-305",),
        seconds=12.0,
    ),
)
