"""Traffic made by hand, message by message and packet by packet: short sequences, and what is shown of them."""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from kit import encode
from kit.encode import Transfer, log_line, transfer

if TYPE_CHECKING:
    from collections.abc import Iterable

    from kit.encode import Frame

SECOND, MS = 10**9, 10**6
START = 1_700_000_000 * SECOND
STATUS = {"error_count": 7, "voltage": 48.5, "current": 1.0, "temperature": 40.0, "rpm": -5, "power_rating_pct": 3}


def status(transfer_id: int, rpm: int = -5, **more: Any) -> Transfer:
    """Three frames."""
    return encode.transfer("ESCStatus", STATUS | {"rpm": rpm, "esc_index": 2}, 10, transfer_id, **more)


def push(transfer_id: int, size: int = 25) -> Transfer:
    """Five frames."""
    fields = {"data_sequence": transfer_id, "data": [(transfer_id + k) % 256 for k in range(size)]}
    return encode.transfer("PUSHCAN", fields, 10, transfer_id)


def throttle(transfer_id: int, value: int = 100, **more: Any) -> Transfer:
    """One frame."""
    return encode.transfer("RawCommand", {"cmd": [value] * 4}, 1, transfer_id, **more)


def retail(frame: Frame, flip: int) -> Frame:
    return replace(frame, data=frame.data[:-1] + bytes([frame.data[-1] ^ flip]))


def lines(*parts: Frame | list[Frame], timed: bool = True) -> bytes:
    """A candump log, a frame every millisecond from START on; a frame with a time of its own sets the clock."""
    frames = [f for part in parts for f in (part if isinstance(part, list) else [part])]
    out, now = [], START
    for frame in frames:
        now = frame.t if frame.t >= START else now + MS
        out.append(encode.log_line(replace(frame, t=now), 9) if timed else encode.console_line(frame))
    return "".join(line + "\n" for line in out).encode()


def at(t: int, frame: Frame) -> Frame:
    return replace(frame, t=START + t)


def tail(frame: Frame, byte: int) -> Frame:
    return replace(frame, data=frame.data[:-1] + bytes([byte]))


ALIVE = "uavcan.protocol.NodeStatus"
Timed = tuple[float, Transfer]  # ms from the start


def log(*sent: Timed) -> str:
    """The frames of transfers, in the order of their first ones."""
    order = sorted(sent, key=itemgetter(0))
    return "".join(log_line(frame) + "\n" for t, one in order for frame in one.frames(START + round(t * MS)))


def alive(uptime: int, src: int = 11, transfer_id: int = 0, **more: Any) -> Transfer:
    """A NodeStatus: all is well unless `more` says otherwise; uptime in s."""
    well = dict.fromkeys(("health", "mode", "sub_mode", "vendor_specific_status_code"), 0)
    return transfer(ALIVE, well | {"uptime_sec": uptime} | more, src, transfer_id)


UNIT = 0xA1
MOTOR = {"voltage": 4850, "speed": 3011, "current": 120, "temperature": 4100, "position": 1234, "pwm": 15_000}
# What the ESC of this motor says of itself.
TURNING = {
    "voltage": 48.5, "current": 1.2, "temperature": 41.0, "rpm": 3011, "esc_index": 0, "error_count": 4 << 12,
    "power_rating_pct": 40,
}  # fmt: skip


Planned = tuple[float, int, str, Any]  # time in ms, node, message, its fields or the packets of PUSHSCI and PUSHCAN


def capture(planned: Iterable[Planned]) -> str:
    """A capture with running transfer IDs and sequence numbers."""
    ids: dict[tuple[int, str], int] = {}
    transfers = []
    for at, node, name, what in planned:
        number = ids[node, name] = ids.get((node, name), -1) + 1
        fields = {"data_sequence": number, "data": list(what)} if isinstance(what, bytes) else what
        transfers.append((at, transfer(name, fields, node, number)))
    return log(*transfers)


WELL = dict.fromkeys(("health", "mode", "sub_mode", "vendor_specific_status_code"), 0)


def turning(t: float, **more: Any) -> Planned:
    """What an ESC whose motor turns reports, at a time in ms."""
    return t, 11, "ESCStatus", TURNING | more


def commanded(t: float, *cmd: int) -> Planned:
    """A RawCommand at a time in ms."""
    return t, 1, "RawCommand", {"cmd": list(cmd)}


def in_order(planned: Iterable[Planned]) -> bytes:
    """The same as `capture`, by time."""
    return capture(sorted(planned, key=itemgetter(0))).encode()


def of_kinds(events: list[dict[str, Any]], *wanted: str) -> list[dict[str, Any]]:
    """Events of flights of these kinds."""
    return [one for one in events if one["kind"] in wanted]


def milliseconds(t: int | None) -> int | None:
    """Return how long after the start a time is."""
    return None if t is None else (t - START) // MS


def motor(count: int, unit: int = 0xA1, **values: int) -> bytes:
    """A status packet."""
    return encode.packet("PUSHCAN.MotorStatus", count, unit, **(MOTOR | values))


def motors(*changed: dict[str, int], node: int = 10) -> str:
    """Status packets, one each 20 ms, with changed values."""
    return capture((20.0 * k, node, "PUSHCAN", motor(k, **values)) for k, values in enumerate(changed))


def summed(data: bytes) -> bytes:
    """The bytes with their sum behind them."""
    return data + bytes([sum(data) & 0xFF])


def turned(name: str, whole: bytes) -> bytes:
    """The packet as a big-endian sender writes it; the sum of its bytes stays the same."""
    out, at = bytearray(whole), 6
    for code in (field.partition(":")[2] for field in encode.PACKETS[name][1].split()):
        size = struct.calcsize("<" + code)
        if code in "Hh":
            out[at : at + size] = out[at : at + size][::-1]
        at += size
    return bytes(out)


class Traffic:
    """Transfers of some nodes in the order sent, with running transfer IDs and frame counts."""

    def __init__(self) -> None:
        self.frames: list[encode.Frame] = []
        self._ids: dict[Any, int] = {}

    def _next(self, *key: Any) -> int:
        self._ids[key] = self._ids.get(key, -1) + 1
        return self._ids[key]

    def send(self, name: str, fields: dict[str, Any], node: int, bus: str = "can0", *, broken: bool = False) -> None:
        frames = encode.transfer(name, fields, node, self._next(name, node, bus)).frames(bus=bus)
        if broken:
            data = frames[-1].data
            frames[-1] = encode.Frame(frames[-1].id, bytes([data[0] ^ 0x10]) + data[1:], bus=bus)
        self.frames += frames

    def status(self, node: int, bus: str = "can0", *, broken: bool = False, **values: float) -> None:
        fields = STATUS | {"voltage": 48.5, "rpm": 3011, "esc_index": 0} | values
        self.send("ESCStatus", fields, node, bus, broken=broken)

    def push(self, node: int, *packets: bytes, name: str = "PUSHCAN", **more: Any) -> None:
        fields = {"data_sequence": self._next("sequence", node), "data": list(b"".join(packets))}
        self.send(name, fields, node, **more)

    def motor(self, node: int, *, big: bool = False, unit: int = UNIT, bus: str = "can0", **values: int) -> None:
        whole = encode.packet("PUSHCAN.MotorStatus", self._next("count", node, unit), unit, **(MOTOR | values))
        self.push(node, turned("PUSHCAN.MotorStatus", whole) if big else whole, bus=bus)

    @property
    def log(self) -> bytes:
        return lines(self.frames)


def mixed() -> Traffic:
    """Five rounds of a little-endian node 10 and a big-endian node 11; both wrap their runtime in the third."""
    traffic = Traffic()
    for step in range(5):
        for node in (10, 11):
            traffic.status(node, voltage=48.5 - step / 8)
            runtime = (65530 + 3 * step) % 65536
            traffic.motor(node, big=node == 11, voltage=4850 - step * 12, runtime=runtime)
    return traffic


def same(sent: Any, got: Any) -> bool:
    """Equal to the last bit of the number, NaN equals NaN; members of a union that are null were not sent."""
    if isinstance(sent, dict):
        if not isinstance(got, dict) or not sent.keys() <= got.keys():
            return False
        return all(got[name] is None for name in got.keys() - sent.keys()) and all(
            same(value, got[name]) for name, value in sent.items()
        )
    if isinstance(sent, (list, tuple)):
        return isinstance(got, list) and len(sent) == len(got) and all(map(same, sent, got))
    if isinstance(sent, encode.Code):
        sent = struct.unpack("<e", struct.pack("<H", sent))[0]
    if isinstance(sent, float) and math.isnan(sent):
        return isinstance(got, float) and math.isnan(got)
    if isinstance(sent, float):
        return isinstance(got, float) and sent == got and math.copysign(1, sent) == math.copysign(1, got)
    return got is not None and sent == got


def differing(sent: dict[str, Any], row: dict[str, Any]) -> dict[str, tuple[Any, Any]]:
    """The fields of a message whose column shows something else: name -> (sent, shown)."""
    return {name: (value, row.get(name)) for name, value in sent.items() if not same(value, row.get(name))}
