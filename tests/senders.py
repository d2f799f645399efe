"""Nodes that send packets inside messages, little- or big-endian: traffic for the tests of packets."""

from __future__ import annotations

import struct
from typing import Any

import encode
from sequences import STATUS, lines

UNIT = 0xA1
MOTOR = {"voltage": 4850, "speed": 3011, "current": -120, "temperature": 4100, "position": 1234, "pwm": 15000}


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

    def status(self, node: int, voltage: float = 48.5, rpm: int = 3011, **more: Any) -> None:
        self.send("ESCStatus", STATUS | {"voltage": voltage, "rpm": rpm, "esc_index": 0}, node, **more)

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
