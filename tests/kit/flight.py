"""A short, believable flight made by hand, and a bus with ESCs and an autopilot, message by message."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, field
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from kit import encode
from kit.judged import whole

if TYPE_CHECKING:
    from collections.abc import Callable

    from kit.judged import Said

MS = 1_000_000
SECOND = 1000 * MS
START = 1_773_475_330 * SECOND  # 2026-03-14 08:02:10 UTC
AUTOPILOT, GROUND, ESCS = 1, 126, (11, 12, 13, 14)


@dataclass(eq=False)
class Sent:
    """One transfer that a node sent and how a capture must show it: the ground truth of the sample captures."""

    transfer: encode.Transfer
    name: str | None  # None: of a type that nobody knows
    fields: dict[str, Any] | None
    packet: tuple[str, dict[str, Any]] | None = None  # name, raw values (frame_count and unit_id included)
    status: str = "ok"
    why: str = ""  # what was done to it
    frames: list[int] = field(default_factory=list)  # 1-based frame numbers of what the capture holds of it


@dataclass(eq=False)
class Row:
    """One line to be: a frame, with the transfer that it belongs to or a verdict, or a text that is no frame."""

    frame: encode.Frame | None
    owner: Sent | None = None
    verdict: str = ""  # expected where the frame is in no transfer; "" states nothing
    text: str = ""
    event: str = ""  # kind of the event that the line is


class Sender:
    """All nodes of one bus: transfer ids, data sequences and frame counts go up by one."""

    def __init__(self, *, fd: bool = False) -> None:
        self.bus, self.sent, self.fd = encode.Bus(START), [], fd
        self._next: dict[object, int] = {}

    def count(self, key: object) -> int:
        self._next[key] = self._next.get(key, -1) + 1
        return self._next[key]

    def send(self, ms: float, name: str, src: int, fields: dict[str, Any], **more: Any) -> Sent:
        """Send `ms` milliseconds after the start; `transfer_id` in `more` answers a request."""
        number = more.pop("transfer_id", None)
        if number is None:
            number = self.count((name, src, more.get("dst")))
        return self.put(ms, Sent(encode.transfer(name, fields, src, number, fd=self.fd, **more), name, fields))

    def put(self, ms: float, sent: Sent) -> Sent:
        self.sent.append(sent)
        self.bus.send(START + round(ms * MS), sent.transfer.frames(), sent)
        return sent

    def push(self, ms: float, packet: str, src: int, unit: int, **values: Any) -> Sent:
        """One packet in a PUSHSCI or PUSHCAN transfer of its own."""
        carrier, _ = packet.split(".")
        count = self.count((carrier, src, unit)) % 256
        data = encode.packet(packet, count, unit, **values)
        sequence = self.count((carrier, src))
        sent = self.send(ms, carrier, src, {"data_sequence": sequence, "data": list(data)})
        names = [word.split(":")[0] for word in encode.PACKETS[packet][1].split()]
        sent.packet = packet, {"frame_count": count, "unit_id": unit} | {n: values.get(n, 0) for n in names}
        return sent

    def rows(self) -> list[Row]:
        return [Row(frame, owner) for frame, owner in self.bus.run()]


def half(value: float) -> float:
    """The nearest value that a float16 holds."""
    return struct.unpack("<e", struct.pack("<e", value))[0]


def throttle(index: int, ms: float) -> float:
    """0..1: still for 0.2 s, up to hover at 1 s, then small corrections."""
    rise = min(max((ms - 200) / 800, 0.0), 1.0)
    return rise * (0.45 + 0.02 * math.sin(ms / 90 + index * 1.7))


def mode(ms: float) -> int:
    """Idle, soft start, operating (4.4.3)."""
    return 2 if ms < 200 else 3 if ms < 500 else 4


def status(index: int, ms: float) -> dict[str, Any]:
    part = throttle(index, ms)
    return {
        "error_count": mode(ms) << 12 | int(ms * 977 * part + index * 4096) % 16384 << 16,
        "voltage": half(50.2 - 3 * part),
        "current": half(0.3 + 36 * part),
        "temperature": half(31 + index + ms / 400),
        "rpm": int(5200 * part * (-1 if index % 2 else 1)),
        "power_rating_pct": int(100 * part),
        "esc_index": index,
    }


def motor(index: int, ms: float) -> dict[str, int]:
    part = throttle(index, ms)
    return {
        "system_status": 0,
        "position": int(ms * 2147 * part + index * 9000) % 36000,
        "pwm": 10400 + int(9000 * part),
        "throttle": int(250 * part),
        "speed": int(5200 * part * (-1 if index % 2 else 1)),
        "voltage": 5020 - int(300 * part),
        "current": 30 + int(3600 * part),
        "temperature": 3100 + 100 * index + int(ms / 4),
        "power_on_count": 41 + index,
        "runtime": 12 + int(ms / 1000),
    }


SETTINGS = {
    "esc_ov_threshold": 630,
    "esc_oc_threshold": 120,
    "esc_ot_threshold": 110,
    "esc_acc_threshold": 4000,
    "esc_dacc_threshold": 4000,
    "esc_rotate_dir": 0,
    "esc_timing": 15,
    "esc_signal_priority": 1,
    "esc_led_mode": 0x197,  # red, green and blue on, not flashing, 2.5 Hz
    "esc_can_rate": 0,
    "esc_fdb_rate": 30,
    "esc_save_option": 1,
}
QUERY = {  # 4.4.2: all ones ask every ESC for its parameters
    **dict.fromkeys(SETTINGS, 0xFFFF),
    **dict.fromkeys(("esc_timing", "esc_signal_priority", "esc_can_rate", "esc_save_option"), 0xFF),
    "esc_index": 0xFF,
    "esc_uuid": 0xFFFFFFFF,
    "esc_id_set": 0xFFFF,
    "esc_rotate_dir": -1,
}
FOC = {
    "acceleration_limit": 4000,
    "deceleration_limit": 4000,
    "throttle_priority": 1,
    "led": 0x197,
    "report_rate": 30,
    "save_option": 1,
}


def parameters(index: int) -> dict[str, Any]:
    return SETTINGS | {
        "esc_index": index,
        "esc_uuid": 0x5EED0000 + index,
        "esc_id_req": index,
        "esc_rotate_dir": index % 2,
        "esc_startup_times": 41 + index,
        "esc_startup_duration": 86_400 + 600 * index,
        "esc_product_date": 20240703,
        "esc_error_count": 0,
        "rsvd": [0x54, 0x4D, index, *range(29)],
    }


def node_status(ms: float, up: int = 12) -> dict[str, int]:
    zeros = dict.fromkeys(("health", "mode", "sub_mode", "vendor_specific_status_code"), 0)
    return {"uptime_sec": up + int(ms / 1000), **zeros}


def node_info(index: int, ms: float) -> dict[str, Any]:
    return {
        "status": node_status(ms),
        "software_version": {"major": 2, "minor": 2, "optional_field_flags": 0, "vcs_commit": 0, "image_crc": 0},
        "hardware_version": {
            "major": 1,
            "minor": 0,
            "unique_id": [index, *range(0xA1, 0xB0)],
            "certificate_of_authenticity": [],
        },
        "name": list(b"com.tmotor.esc"),
    }


def hover(ms: int = 2000, *, fd: bool = False) -> Sender:
    """Four ESCs from power-up to hover, `ms` long: below 2400 frames/s, every transfer good."""
    net, plans = Sender(fd=fd), []

    def plan(t: float, do: Callable[..., Sent], *given: Any, **more: Any) -> None:
        plans.append((t, do, given, more))

    for k in range(ms * 2 // 5):
        plan(k * 2.5, net.send, "RawCommand", AUTOPILOT, {"cmd": [int(8191 * throttle(c, k * 2.5)) for c in range(4)]})
    for k in range(-(-ms // 1000)):
        for at, node in enumerate((AUTOPILOT, *ESCS)):
            t = k * 1000 + 40 + 7 * at
            plan(t, net.send, "uavcan.protocol.NodeStatus", node, node_status(t, 30 if node == AUTOPILOT else 12))
    for index, node in enumerate(ESCS):
        for k in range(ms * 30 // 1000):
            t = k * 1000 / 30 + 1.3 + 2.6 * index
            plan(t, net.send, "ESCStatus", node, status(index, t))
        for k in range(ms // 200):
            t = k * 200 + 12 + 31.1 * index
            plan(t, net.push, "PUSHCAN.MotorStatus", node, 0xA1 + index, **motor(index, t))
        t = 60 + 12.2 * index
        plan(t, net.send, "uavcan.protocol.GetNodeInfo.Request", AUTOPILOT, {}, dst=node)
        again = {"transfer_id": 0, "dst": AUTOPILOT}
        plan(t + 4, net.send, "uavcan.protocol.GetNodeInfo.Response", node, node_info(index, t), **again)
        plan(133 + 3.1 * index, net.send, "ParamGet", node, parameters(index))
        versions = {"hardware_version": b"HW-V1.0", "software_version": b"SW-V2.2.3"}
        plan(152 + 3.1 * index, net.push, "PUSHCAN.FocFeedback", node, 0xA1 + index, **versions, **FOC)
    plan(130, net.send, "ParamCfg", GROUND, QUERY)
    plan(148, net.push, "PUSHSCI.FocQuery", GROUND, 0xFF)
    plan(166, net.push, "PUSHSCI.SetZero", GROUND, 0xA1)
    limits = {"over_voltage_threshold": 630, "over_current_threshold": 120, "over_temperature_threshold": 110}
    plan(172, net.push, "PUSHSCI.FocParameters", GROUND, 0xA2, esc_id=1, beep_volume=50, **limits, **FOC)
    plan(178, net.push, "PUSHSCI.OutputControl", GROUND, 0xA3, control_mode=0x33, set_point=4500)
    for t, do, given, more in sorted(plans, key=itemgetter(0)):
        do(t, *given, **more)
    return net


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
