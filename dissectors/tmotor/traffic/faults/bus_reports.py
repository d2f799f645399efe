"""ESCs that contradict each other, their settings or the bus: BUS-009, -011 to -015, -018, -019, -025, -029, -037."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.faults.occasions import chosen, misreport, put, span, unsent
from dissectors.tmotor.traffic.faults.status import STATUS, status_of
from dissectors.traffic import Fault, Step

if TYPE_CHECKING:
    from dissectors.traffic import BusNode, Case, Fits, Sending

_ANSWER = "ParamGet"
_AGAIN = 200 * MILLISECOND


def _answers(esc: Any) -> Fits:
    return lambda sending: sending.name == _ANSWER and sending.node == esc.node.number


def _lose(case: Case, node: BusNode, name: str, until: int) -> None:
    """Never send the next transfers of a type from a node, so that they take no transfer IDs."""

    def hold(_: Case, sending: Sending) -> Step:
        if sending.t > until:
            return Step.DONE
        if sending.name == name and sending.node == node.number and not sending.changed:
            unsent(node, sending)
            sending.damaged = True
        return Step.MORE

    case.touch("frames", hold)


def _same_index(case: Case) -> None:
    """Configure an ESC with the index of its neighbour."""
    escs = case.vehicle.escs
    if len(escs) < 2:
        return
    one, other = escs[-2:]
    case.say(f"nodes {one.node.number} and {other.node.number} both report index {one.index}")
    until = case.world.now + span(case)
    misreport(
        case, lambda sending: STATUS(sending) and sending.node == other.node.number, "esc_index", one.index, until
    )


def _no_answer(case: Case) -> None:
    esc = chosen(case)
    _lose(case, esc.node, _ANSWER, case.world.now + 1500 * MILLISECOND)
    sending = case.vehicle.configure(esc.index, esc_led_mode=7)
    case.mark(sending)
    case.say(f"the ESC with index {esc.index} does not answer a ParamCfg")


def _one_missing(case: Case) -> None:
    esc = chosen(case)
    _lose(case, esc.node, _ANSWER, case.world.now + 1500 * MILLISECOND)
    case.mark(case.vehicle.query())
    case.say(f"all ESCs but the one with index {esc.index} answer a query")


def _refused(case: Case) -> None:
    """Let the ESC answer with its old value."""
    esc, value = chosen(case), int(case.options["value"])
    before = esc.parameters["esc_ot_threshold"]
    if before == value:
        return

    def old(case: Case, sending: Sending) -> Step:
        if sending.name != _ANSWER or sending.node != esc.node.number:
            return Step.SKIP
        put(sending, "esc_ot_threshold", before)
        esc.parameters["esc_ot_threshold"] = before
        case.mark(sending)
        return Step.DONE

    case.touch("values", old)
    case.vehicle.configure(esc.index, esc_ot_threshold=value)
    case.say(f"esc_ot_threshold set to {value}, reported as {before}")


def _unasked(case: Case) -> None:
    """Let an ESC answer after the ground station has asked nothing for a while."""
    esc, world, ground = chosen(case), case.world, case.vehicle.ground

    def answer() -> None:
        on = esc.parameters["esc_startup_duration"] + world.now // SECOND
        case.mark(esc.node.send(_ANSWER, {**esc.parameters, "esc_startup_duration": on}))
        case.say(f"the ESC with index {esc.index} sends ParamGet without being asked")

    at = world.now + 1300 * MILLISECOND
    _lose(case, ground, "ParamCfg", at + _AGAIN)
    world.at(at, answer)


def _stranger(case: Case) -> None:
    """Send a ParamCfg for a device that is not there, once all that are have told who they are."""
    vehicle, world = case.vehicle, case.world
    vehicle.query()

    def ask() -> None:
        sending = vehicle.configure(0, esc_uuid=0x0BAD_CAFE, esc_index=0xFF, esc_led_mode=7)
        case.mark(sending)
        case.say("a ParamCfg for the UUID 0BADCAFE, which no ESC has")

    world.at(world.now + 2 * _AGAIN, ask)


def _other_rate(case: Case) -> None:
    """Let the ESC say another rate than it sends with, whenever it is asked."""
    esc = chosen(case)
    wrong = 2 * esc.parameters["esc_fdb_rate"] if esc.parameters["esc_fdb_rate"] <= 200 else 10
    misreport(case, _answers(esc), "esc_fdb_rate", wrong)
    case.say(f"the ESC with index {esc.index} says {wrong} Hz and sends at {case.vehicle.rate} Hz")
    case.world.at(case.world.now, lambda: case.vehicle.configure(esc.index, esc_save_option=0))


def _bus_rate(case: Case) -> None:
    esc, code = chosen(case), int(case.options["code"])
    if esc.parameters["esc_can_rate"] == code:
        return
    misreport(case, _answers(esc), "esc_can_rate", code)
    case.say(f"the ESC with index {esc.index} says bus rate code {code}")
    case.vehicle.query()


def _dropout(case: Case) -> None:
    esc, until = chosen(case), case.world.now + span(case)
    if not esc.telemetry:
        return
    esc.telemetry = False
    shown = status_of(esc.node.number)

    def back() -> None:
        esc.telemetry = True

    def first(case: Case, sending: Sending) -> Step:
        if not shown(sending) or sending.t < until:
            return Step.MORE
        case.mark(sending)
        return Step.DONE

    case.world.at(until, back)
    case.touch("frames", first)
    case.say(f"no ESCStatus of node {esc.node.number} for {float(case.options['seconds']):g} s")


def _powered(case: Case) -> None:
    """Let an ESC count a start that nobody else knows of."""
    esc = chosen(case, packets=True)
    if esc.unit is None:
        return
    esc.power_on_count += 1

    def first(case: Case, sending: Sending) -> Step:
        if sending.node != esc.node.number or sending.name != "PUSHCAN":
            return Step.MORE
        case.mark(sending)
        return Step.DONE

    case.touch("frames", first)
    case.say(f"node {esc.node.number} has been switched on for the {esc.power_on_count}th time")


def _coded(rule: str, title: str, code: int, other: str) -> Fault:
    """Return a fault: a bus rate code that an ESC reports; `other` is the rule that it may break, too."""
    return Fault(
        rule, title, start=_bus_rate, options={"code": code}, limits={"code": (0, 5)}, lasts=500 * MILLISECOND,
        also=(other, "BUS-013", "TYP-208", "TYP-209"),
    )  # fmt: skip


FAULTS: tuple[Fault, ...] = (
    Fault(
        "BUS-009",
        "two ESCs report one index",
        start=_same_index,
        options={"seconds": 1.0},
        lasts=SECOND,
        also=("BUS-018", "BUS-025", "BUS-028", "TYP-103", "PUSH-011", "BUS-027"),
    ),
    Fault("BUS-011", "an ESC does not answer a ParamCfg", start=_no_answer, lasts=1600 * MILLISECOND),
    Fault(
        "BUS-012",
        "one ESC does not answer a query to all",
        start=_one_missing,
        lasts=1600 * MILLISECOND,
        also=("TYP-208", "TYP-209"),
    ),
    Fault(
        "BUS-013",
        "a setting is not taken over",
        start=_refused,
        options={"value": 95},
        limits={"value": (1, 200)},
        lasts=300 * MILLISECOND,
    ),
    Fault("BUS-014", "a ParamGet that nobody asked for", start=_unasked, lasts=2 * SECOND),
    Fault(
        "BUS-015",
        "a ParamCfg for a device that is not there",
        start=_stranger,
        lasts=2 * SECOND,
        also=("BUS-011", "TYP-208", "TYP-209"),
    ),
    Fault(
        "BUS-018",
        "an ESC reports at another rate than it says",
        start=_other_rate,
        lasts=2500 * MILLISECOND,
        also=("BUS-013",),
    ),
    _coded("BUS-019", "an ESC says another bus rate than the bus has", 3, "BUS-029"),
    Fault(
        "BUS-025",
        "the telemetry of an ESC drops out",
        start=_dropout,
        options={"seconds": 0.8},
        limits={"seconds": (0.3, 60)},
        lasts=1200 * MILLISECOND,
        also=("BUS-018",),
    ),
    Fault("BUS-037", "an ESC counts another start", start=_powered, lasts=SECOND),
    _coded("BUS-029", "ESCs say different bus rates", 1, "BUS-019"),
)
