"""Parameters of an ESC, set by ParamCfg (4.4.2) or a FocParameters packet (4.4.4 table 2), and their reports."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping
    from random import Random

NO_CHANGE_8, NO_CHANGE_16, ANY_UUID = 0xFF, 0xFFFF, 0xFFFF_FFFF
TEMPORARY, PERMANENT = 0, 1
# A ParamCfg that changes nothing and is for every ESC: 27 bytes 0xFF (4.4.2 explanation 2).
QUERY: Mapping[str, int] = {
    "esc_index": 0xFF,
    "esc_uuid": ANY_UUID,
    "esc_id_set": NO_CHANGE_16,
    "esc_ov_threshold": NO_CHANGE_16,
    "esc_oc_threshold": NO_CHANGE_16,
    "esc_ot_threshold": NO_CHANGE_16,
    "esc_acc_threshold": NO_CHANGE_16,
    "esc_dacc_threshold": NO_CHANGE_16,
    "esc_rotate_dir": -1,
    "esc_timing": NO_CHANGE_8,
    "esc_signal_priority": NO_CHANGE_8,
    "esc_led_mode": NO_CHANGE_16,
    "esc_can_rate": NO_CHANGE_8,
    "esc_fdb_rate": NO_CHANGE_16,
    "esc_save_option": NO_CHANGE_8,
}
# What FocParameters has that the ESC also has by another name.
_SHARED = {
    "esc_id": "esc_id_set",
    "over_voltage_threshold": "esc_ov_threshold",
    "over_current_threshold": "esc_oc_threshold",
    "over_temperature_threshold": "esc_ot_threshold",
    "acceleration_limit": "esc_acc_threshold",
    "deceleration_limit": "esc_dacc_threshold",
    "rotation_direction": "esc_rotate_dir",
    "led": "esc_led_mode",
    "bus_rate": "esc_can_rate",
    "report_rate": "esc_fdb_rate",
    "save_option": "esc_save_option",
}
# A FocParameters packet that changes nothing, for now.
KEEP: Mapping[str, int] = {
    **dict.fromkeys(_SHARED, NO_CHANGE_16),
    "beep_volume": NO_CHANGE_16,
    "throttle_priority": NO_CHANGE_16,
    "bus_rate": NO_CHANGE_8,
    "save_option": TEMPORARY,
}
# Raw values that an ESC takes; another one leaves the parameter as it is.
_RANGES = {
    "esc_id_set": (0, 19),
    "esc_timing": (1, 29),
    "esc_signal_priority": (0, 1),
    "esc_can_rate": (0, 5),
    "esc_fdb_rate": (0, 400),
    "esc_save_option": (0, 1),
    "esc_rotate_dir": (0, 1),
}


def led(*, enable: int = 0b111, flash: bool = False, hertz: float = 0.0) -> int:
    """Return the LED word (4.4.2 no 22-23)."""
    return enable | flash << 3 | round(hertz * 10) << 4


def factory(random: Random, *, index: int, uuid: int, rate: int, bus: int) -> dict[str, Any]:
    """Return the parameters of an ESC as it comes out of its box, by the names of ParamGet (4.4.6).

    Rates and identity are those of its place; thresholds are in V, A and degC, which the document leaves open.
    """
    return {
        "esc_index": index,
        "esc_uuid": uuid,
        "esc_id_req": index,
        "esc_ov_threshold": 60,
        "esc_oc_threshold": 120,
        "esc_ot_threshold": 110,
        "esc_acc_threshold": 400,
        "esc_dacc_threshold": 300,
        "esc_rotate_dir": 0,
        "esc_timing": 15,
        "esc_startup_times": random.randrange(20, 400),
        "esc_startup_duration": random.randrange(4_000, 60_000),
        "esc_product_date": 2025_00_00 + random.randrange(1, 13) * 100 + random.randrange(1, 29),
        "esc_error_count": random.randrange(4),
        "esc_signal_priority": 1,
        "esc_led_mode": led(flash=True, hertz=2.0),
        "esc_can_rate": bus,
        "esc_fdb_rate": rate,
        "esc_save_option": 1,
        "rsvd": bytes(32),
    }


def configure(parameters: dict[str, Any], values: Mapping[str, Any]) -> None:
    """Take over what a ParamCfg sets. Values out of the document's ranges are refused."""
    for name, value in values.items():
        low, high = _RANGES.get(name, (0, 0xFFFE))
        if value == QUERY[name] or name in {"esc_index", "esc_uuid"} or not low <= value <= high:
            continue
        parameters["esc_id_req" if name == "esc_id_set" else name] = value


def configure_foc(parameters: dict[str, Any], position_loop: int, values: Mapping[str, Any]) -> int:
    """Take over what a FocParameters packet sets; return the position loop, which only such packets know (byte 24)."""
    priority = values["throttle_priority"]
    known = {_SHARED[name]: value for name, value in values.items() if name in _SHARED}
    if known["esc_rotate_dir"] == NO_CHANGE_16:
        known["esc_rotate_dir"] = -1
    if priority != NO_CHANGE_16:
        known["esc_signal_priority"] = priority & 0xFF
        position_loop = priority >> 8 if priority >> 8 in {0, 1} else position_loop
    configure(parameters, known)
    return position_loop


def feedback(parameters: Mapping[str, Any], position_loop: int) -> dict[str, Any]:
    """Return the fields of a FocFeedback packet that parameters fill (4.4.5 table 2)."""
    return {
        "acceleration_limit": parameters["esc_acc_threshold"],
        "deceleration_limit": parameters["esc_dacc_threshold"],
        "rotation_direction": parameters["esc_rotate_dir"] & 0xFFFF,
        "position_loop": position_loop,
        "throttle_priority": parameters["esc_signal_priority"],
        "led": parameters["esc_led_mode"],
        "bus_rate": parameters["esc_can_rate"],
        "report_rate": parameters["esc_fdb_rate"],
        "save_option": parameters["esc_save_option"],
    }
