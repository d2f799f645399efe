"""A flight of T-Motor ESCs as the document has it, message by message, to be changed and then put on a bus.

Nothing here is the product's: layouts and framing are those of `kit.encode`. Times are in ms from the start. The
autopilot is node 1, a ground station node 120 asks for parameters before take-off, ESCs are nodes 11 and up. All motors
rest at first, rise, hold, come down and rest, so that nothing is left turning at the end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any

from kit import encode
from kit.flight import FOC, QUERY, SETTINGS, half, node_status

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

START = 1_773_475_330 * 10**9
AUTOPILOT, GROUND, FIRST = 1, 120, 11
REST, RISE, DOWN, STOP = 1200, 2200, 6000, 7000  # ms: motors rest until, rise until, come down from and until
END = 8200
ALIVE = "uavcan.protocol.NodeStatus"


@dataclass(frozen=True, slots=True, eq=False)
class Message:
    """One transfer to be. `payload` stands for encoded fields, `number` for the transfer ID that the sender counts.

    `packet` is the name of a packet in the data; what it holds is in `values`, its unit in `unit`.
    """

    t: float
    name: str
    src: int
    fields: dict[str, Any] = field(default_factory=dict)
    packet: str = ""
    unit: int = 0
    values: dict[str, Any] = field(default_factory=dict)
    dst: int | None = None
    priority: int = 31
    number: int | None = None
    payload: bytes | None = None
    raw: bytes | None = None  # the packet, whole
    sequence: int | None = None
    count: int | None = None

    def but(self, **fields: Any) -> Message:
        """The same with other fields of the message or of its packet."""
        if self.packet:
            return replace(self, values={**self.values, **fields})
        return replace(self, fields={**self.fields, **fields})


@cache
def encoded(message: Message) -> bytes:
    return encode.to_bytes(encode.encode(encode.TYPES[message.name].layout, message.fields, tail=True))


@cache
def framed(message: Message, number: int, payload: bytes) -> list[encode.Frame]:
    of = encode.TYPES[message.name]
    more = {"dst": message.dst, "priority": message.priority}
    return encode.Transfer(of.kind, of.type_id, message.src, payload, of.signature, number, **more).frames()


def frames_of(messages: list[Message]) -> Iterator[tuple[float, list[encode.Frame]]]:
    """Each sender counts transfers of a type, packets of a unit and PUSH messages by one (4.1.3, 4.4.4, 4.4.5)."""
    counts: dict[Any, int] = {}

    def count(*key: Any) -> int:
        counts[key] = counts.get(key, -1) + 1
        return counts[key]

    for one in sorted(messages, key=lambda message: message.t):
        payload = one.payload
        if one.packet:
            carrier = one.packet.partition(".")[0]
            number = count("packet", one.src, one.unit) if one.count is None else one.count
            data = encode.packet(one.packet, number, one.unit, **one.values) if one.raw is None else one.raw
            sequence = count("sequence", one.src, carrier) if one.sequence is None else one.sequence
            payload = sequence.to_bytes(4, "little") + data
        elif payload is None:
            payload = encoded(one)
        number = count("transfer", one.name, one.src, one.dst) if one.number is None else one.number
        yield one.t, framed(one, number % 32, payload)


def text_of(messages: list[Message], extra: list[tuple[float, list[encode.Frame]]] = ()) -> str:
    bus = encode.Bus(START)
    for t, frames in (*frames_of(messages), *extra):
        bus.send(START + round(t * 10**6), frames)
    return "".join(encode.log_line(frame) + "\n" for frame, _ in bus.run())


def shape(ms: float) -> float:
    """Throttle as a part of full: 0 to 0.45 and back."""
    up = min(max((ms - REST) / (RISE - REST), 0.0), 1.0)
    down = min(max((STOP - ms) / (STOP - DOWN), 0.0), 1.0)
    return min(up, down) * 0.45


def throttle(index: int, ms: float) -> float:
    part = shape(ms)
    return part * (1 + 0.03 * math.sin(ms / 90 + index * 1.7))


def operating(ms: float) -> int:
    """4.4.3: idle, soft start, operating, coast down, idle."""
    return 2 if ms < REST or ms > STOP + 300 else 3 if ms < REST + 300 else 5 if ms > STOP - 100 else 4


def turning(index: int, ms: float) -> float:
    """What the motor does follows 60 ms behind."""
    return throttle(index, ms - 60)


class Flight:
    """What `escs` ESCs, an autopilot and a ground station send. `rate` is in Hz, of each ESC's ESCStatus."""

    def __init__(self, escs: int, rate: int = 20) -> None:
        self.escs, self.rate = escs, rate
        self.messages = [*self._commands(), *self._ground()]
        for index in range(escs):
            self.messages += [*self._reports(index), *self._answers(index)]
        for at, node in enumerate((AUTOPILOT, GROUND, *self.nodes)):
            self.messages += [alive(1000 * k + 40 + 7 * at, node) for k in range(END // 1000 + 1)]
        self.text = text_of(self.messages)

    @property
    def nodes(self) -> range:
        return range(FIRST, FIRST + self.escs)

    def _commands(self) -> Iterator[Message]:
        for k in range(END * 2 // 5):
            t = k * 2.5 + 0.1
            yield Message(t, "RawCommand", AUTOPILOT, {"cmd": [int(8191 * throttle(c, t)) for c in range(self.escs)]})

    def _ground(self) -> Iterator[Message]:
        yield Message(300, "ParamCfg", GROUND, QUERY)
        yield push(60, "PUSHSCI.FocQuery", GROUND, 0xFF)
        for index in range(self.escs):
            limits = {"over_voltage_threshold": 630, "over_current_threshold": 120, "over_temperature_threshold": 110}
            values = {"esc_id": index, "beep_volume": 50, **limits, **FOC, "report_rate": self.rate}
            yield push(1080 + 9 * index, "PUSHSCI.FocParameters", GROUND, 0xA1 + index, **values)
        yield push(900, "PUSHSCI.OutputControl", GROUND, 0xA1, control_mode=0)
        yield Message(1000, "ParamCfg", GROUND, settings(0, self.rate))

    def _reports(self, index: int) -> Iterator[Message]:
        node = FIRST + index
        for k in range(END * self.rate // 1000):
            t = k * 1000 / self.rate + 1.3 + 2.9 * index
            yield Message(t, "ESCStatus", node, status(index, t))
        for k in range(END // 100):
            t = k * 100 + 17 + 6.1 * index
            yield push(t, "PUSHCAN.MotorStatus", node, 0xA1 + index, **motor(index, t))

    def _answers(self, index: int) -> Iterator[Message]:
        node = FIRST + index
        yield Message(304 + 3.1 * index, "ParamGet", node, parameters(index, self.rate))
        texts = {"hardware_version": b"HW-V1.0", "software_version": b"SW-V2.2.3"}
        for t in (64 + 4.1 * index, 1085 + 9 * index):
            yield push(t, "PUSHCAN.FocFeedback", node, 0xA1 + index, **texts, **FOC | {"report_rate": self.rate})
        if not index:
            yield Message(1004, "ParamGet", node, parameters(index, self.rate))

    def made(self, change: Callable[[Message], Message | list[Message] | None]) -> list[Message]:
        """All messages, changed one by one: to another, to several, to none."""
        found: list[Message] = []
        for one in self.messages:
            new = change(one)
            found += new if isinstance(new, list) else [new] if new is not None else []
        return found


def push(t: float, packet: str, src: int, unit: int, **values: Any) -> Message:
    return Message(t, packet.partition(".")[0], src, packet=packet, unit=unit, values=values)


def alive(t: float, node: int, **more: int) -> Message:
    return Message(t, ALIVE, node, node_status(t) | more)


def status(index: int, ms: float) -> dict[str, Any]:
    part = turning(index, ms)
    return {
        "error_count": operating(ms) << 12 | int(ms * 977 * part + index * 4096) % 16384 << 16,
        "voltage": half(50.2 - 3 * part), "current": half(0.3 + 36 * part), "temperature": half(31 + index + ms / 900),
        "rpm": int(5200 * part * (-1 if index % 2 else 1)), "power_rating_pct": int(100 * part), "esc_index": index,
    }  # fmt: skip


def motor(index: int, ms: float) -> dict[str, int]:
    part = turning(index, ms)
    angle = int(ms * 977 * part + index * 4096) % 16384  # as in the status word
    return {
        "system_status": 0, "position": angle * 36000 // 16384, "pwm": 10400 + int(9000 * part),
        "throttle": int(250 * part), "speed": int(5200 * part * (-1 if index % 2 else 1)),
        "voltage": 5020 - int(300 * part),
        "current": 30 + int(3600 * part), "temperature": 3100 + 100 * index + int(ms / 9), "power_on_count": 41 + index,
        "runtime": 12 + int(ms / 1000),
    }  # fmt: skip


def settings(index: int, rate: int) -> dict[str, Any]:
    """What sets an ESC to what it is set to."""
    return SETTINGS | {"esc_index": index, "esc_uuid": 0x5EED0000 + index, "esc_id_set": index, "esc_fdb_rate": rate}


def parameters(index: int, rate: int) -> dict[str, Any]:
    """4.4.6, of an ESC that has never failed."""
    kept = {key: value for key, value in settings(index, rate).items() if key != "esc_id_set"}
    return kept | {
        "esc_id_req": index, "esc_startup_times": 41 + index, "esc_startup_duration": 86_400 + 600 * index,
        "esc_product_date": 20240703, "esc_error_count": 0, "rsvd": [0x54, 0x4D, index, *range(29)],
    }  # fmt: skip
