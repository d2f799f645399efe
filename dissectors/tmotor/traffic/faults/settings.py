"""Faults of ParamCfg (4.4.2), where they can be in ParamGet (4.4.6) too: TYP-202 to TYP-210."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import SECOND
from dissectors.tmotor.traffic.faults.occasions import chosen, once, provoke, put, replaced
from dissectors.traffic import Fault, Sending, Step, change, of

if TYPE_CHECKING:
    from dissectors.tmotor.traffic.faults.occasions import Wrong
    from dissectors.traffic import Case

# Every byte of a query; as a 16-bit field it could mean "no change" or 255 (4.4.2 explanation 1).
_ALL = 0xFF
# Fields that ParamGet has by another name.
_REPORTED = {"esc_id_set": "esc_id_req"}
_WIDE = (
    *("esc_ov_threshold", "esc_oc_threshold", "esc_ot_threshold", "esc_acc_threshold", "esc_dacc_threshold"),
    *("esc_id_set", "esc_rotate_dir", "esc_led_mode", "esc_fdb_rate"),
)


def _fault(rule: str, title: str, field: str, value: int, wrong: Wrong, *reported: str) -> Fault:
    """Return a fault: a value that a field must not have. An ESC refuses it; `type=ParamGet` has one report it.

    `reported` are other rules that such a report breaks.
    """

    def start(case: Case) -> None:
        name, wanted = str(case.options.get("type", "ParamCfg")), int(case.options["value"])
        if name == "ParamGet":
            case.answer.also = reported

        def replace(case: Case, sending: Sending) -> Step:
            name = field if field in sending.values else _REPORTED.get(field, field)
            return replaced(case, sending, name, wanted, wrong)

        provoke(case, name, "values", replace, chosen(case))

    return Fault(rule, title, start=start, options={"value": value}, also=("BUS-013",))


def _id(value: float) -> bool:
    return 19 < value < 0xFFFF and value != _ALL


def _query(case: Case) -> None:
    def say(case: Case, sending: Sending) -> Step:
        case.say(f"{len(sending.values)} fields of 0xFF: all ESCs are asked for their parameters")
        return Step.DONE

    change(case, "values", of("ParamCfg"), say)
    case.vehicle.query()


def _ambiguous(case: Case) -> None:
    field = str(case.options["field"])
    provoke(case, "ParamCfg", "values", lambda case, sending: replaced(case, sending, field, _ALL), chosen(case))


def _permanent(case: Case) -> None:
    """Wait until the motor turns."""
    esc = chosen(case)

    def save(case: Case, sending: Sending) -> Step:
        put(sending, "esc_led_mode", int(case.options["led"]))
        put(sending, "esc_save_option", 1)
        case.say(
            f"esc_led_mode {case.options['led']} written permanently (esc_save_option 1) to the ESC with index "
            f"{esc.index}, whose motor turns at {esc.motor.rpm:.0f} rpm"
        )
        return Step.DONE

    def write() -> None:
        provoke(case, "ParamCfg", "values", save, esc)

    once(case, lambda: case.vehicle.command(esc.index) > 0 and abs(esc.motor.rpm) > _TURNING, write, SECOND // 10)


_TURNING = 300  # rpm, well above what counts as standing
_LED = {"led": (0, 0xFFFF)}

FAULTS: tuple[Fault, ...] = (
    _fault("TYP-202", "an ESC ID to set that is out of range", "esc_id_set", 200, _id),
    _fault(
        "TYP-203",
        "a timing that is not 1 to 29 degrees",
        "esc_timing",
        35,
        lambda value: value == 0 or 29 < value < _ALL,
    ),
    _fault(
        "TYP-204",
        "a throttle priority that is neither PWM nor CAN",
        "esc_signal_priority",
        3,
        lambda value: 1 < value < _ALL,
    ),
    _fault(
        "TYP-205",
        "a bus rate code that stands for no rate",
        "esc_can_rate",
        9,
        lambda value: 5 < value < _ALL,
        "BUS-019",
        "BUS-029",
    ),
    _fault(
        "TYP-206", "a report rate above 400 Hz", "esc_fdb_rate", 1000, lambda value: 400 < value < 0xFFFF, "BUS-018"
    ),
    _fault(
        "TYP-207",
        "a save option that is neither temporary nor permanent",
        "esc_save_option",
        2,
        lambda value: 1 < value < _ALL,
    ),
    Fault("TYP-208", "all parameters are asked for", start=_query),
    Fault(
        "TYP-209",
        "a 16-bit setting is 0x00FF",
        start=_ambiguous,
        options={"field": "esc_acc_threshold"},
        choices={"field": _WIDE},
    ),
    Fault("TYP-210", "settings are stored while the motors turn", start=_permanent, options={"led": 0x57}, limits=_LED),
)
