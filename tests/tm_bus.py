"""A bus with ESCs and an autopilot, message by message, for tests of rules that join T-Motor's types."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import encode
from flight import Sender
from judged import whole

if TYPE_CHECKING:
    from flight import Sent
    from judged import Said

OPEN = {
    "esc_index": 0xFF, "esc_uuid": 0xFFFFFFFF, "esc_id_set": 0xFFFF, "esc_ov_threshold": 0xFFFF,
    "esc_oc_threshold": 0xFFFF, "esc_ot_threshold": 0xFFFF, "esc_acc_threshold": 0xFFFF,
    "esc_dacc_threshold": 0xFFFF, "esc_rotate_dir": -1, "esc_timing": 0xFF, "esc_signal_priority": 0xFF,
    "esc_led_mode": 0xFFFF, "esc_can_rate": 0xFF, "esc_fdb_rate": 0xFFFF, "esc_save_option": 0xFF,
}  # fmt: skip
SET = {
    "esc_index": 0, "esc_uuid": 0xA0, "esc_id_req": 0, "esc_ov_threshold": 60, "esc_oc_threshold": 120,
    "esc_ot_threshold": 110, "esc_acc_threshold": 400, "esc_dacc_threshold": 300, "esc_rotate_dir": 0,
    "esc_timing": 15, "esc_startup_times": 3, "esc_startup_duration": 60, "esc_product_date": 20250101,
    "esc_error_count": 0, "esc_signal_priority": 1, "esc_led_mode": 2, "esc_can_rate": 0, "esc_fdb_rate": 30,
    "esc_save_option": 1, "rsvd": [0] * 32,
}  # fmt: skip
OPERATING = 4


class Vehicle(Sender):
    """Times are in ms since the start. Nodes 11 and up are ESCs with indexes from 0."""

    def command(self, ms: float, *cmd: int, src: int = 1) -> Sent:
        return self.send(ms, "RawCommand", src, {"cmd": list(cmd)})

    def commands(self, start: float, stop: float, *cmd: int, period: float = 10, src: int = 1) -> list[Sent]:
        times = range(round((stop - start) / period))
        return [self.command(start + k * period, *cmd, src=src) for k in times]

    def status(self, ms: float, node: int = 11, rpm: int = 0, mode: int = OPERATING, **more: Any) -> Sent:
        bits = more.pop("bits", 0) | mode << 12 | more.pop("encoder", 0) << 16
        fields = {
            "error_count": bits, "voltage": 50.0, "current": 1.0, "temperature": 40.0, "rpm": rpm,
            "power_rating_pct": 0, "esc_index": node - 11, **more,
        }  # fmt: skip
        return self.send(ms, "ESCStatus", node, fields)

    def statuses(self, start: float, stop: float, node: int = 11, period: float = 20, **more: Any) -> list[Sent]:
        times = range(round((stop - start) / period))
        return [self.status(start + k * period, node, **more) for k in times]

    def configure(self, ms: float, **fields: int) -> Sent:
        return self.send(ms, "ParamCfg", 126, OPEN | fields)

    def parameters(self, ms: float, node: int = 11, **fields: int) -> Sent:
        return self.send(ms, "ParamGet", node, SET | {"esc_index": node - 11, "esc_uuid": 0xA0 + node - 11} | fields)

    def finish(self) -> str:
        """The capture; every transfer knows its frames, numbered from 1, from then on."""
        lines = []
        for number, (frame, owner) in enumerate(self.bus.run(), 1):
            if owner is not None:
                owner.frames.append(number)
            lines.append(encode.log_line(frame) + "\n")
        return "".join(lines)


def found(vehicle: Vehicle, rule: str, **settings: Any) -> list[Said]:
    """What one rule finds, the same in one batch and in batches of 7 lines."""
    return whole(vehicle.finish(), (rule,), (7,), **settings)
