"""Traffic of others on the same wires: a battery with 11-bit identifiers, a generator that speaks J1939, bus errors."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from analyzer.simulate.faults.helpers import inject, nanoseconds, number, repeat
from dissectors.times import MILLISECOND
from dissectors.traffic import Fault, SimulatedFrame

if TYPE_CHECKING:
    from dissectors.traffic import Case

# Identifier and period of what a battery reports: limits, charge, measurements.
_BATTERY = (0x351, 0x355, 0x356)
_BATTERY_PERIOD = 100 * MILLISECOND
# SAE J1939 from the second engine of a vehicle: its speed, its temperatures, its voltages.
_ENGINE, _TEMPERATURES, _VOLTAGES = 0x0CF00401, 0x18FEEE01, 0x18FEF701
_ENGINE_PERIOD, _EVERY = 20 * MILLISECOND, 25


def _battery(case: Case) -> None:
    times = max(1, nanoseconds(case, "seconds") // _BATTERY_PERIOD)
    charge = case.random.randrange(6000, 9000)

    def report(turn: int) -> None:
        volts = 4600 + case.random.randrange(40)
        data = (
            struct.pack("<HhhH", 504, 600, 1500, 390),
            struct.pack("<HHH", (charge - turn) // 100, 99, charge - turn),
            struct.pack("<hhh", volts, -case.random.randrange(380, 420), 287),
        )
        inject(case, [SimulatedFrame(*both, extended=False) for both in zip(_BATTERY, data, strict=True)])

    identifiers = ", ".join(f"{number:03X}" for number in _BATTERY)
    case.say(f"a battery sends the 11-bit identifiers {identifiers}, each {times} times, every 100 ms")
    repeat(case, _BATTERY_PERIOD, times, report)


def _engine(case: Case) -> None:
    times = max(1, nanoseconds(case, "seconds") // _ENGINE_PERIOD)
    start = case.random.randrange(2400, 2600)

    def report(turn: int) -> None:
        speed = 8 * (start + case.random.randrange(-12, 12))
        frames = [SimulatedFrame(_ENGINE, struct.pack("<BBBHBBB", 0xF1, 125 + 40, 125 + 38, speed, 0, 0xF3, 125))]
        if turn % _EVERY == 0:
            frames.append(
                SimulatedFrame(_TEMPERATURES, struct.pack("<BBHHBB", 40 + 82, 40 + 31, 0x2D40, 0xFFFF, 0xFF, 0))
            )
            frames.append(SimulatedFrame(_VOLTAGES, struct.pack("<BBHHH", 0xFF, 0x14, 0xFFFF, 20 * 28, 20 * 28)))
        inject(case, frames)

    case.say(
        f"an engine speaks J1939: {times} times {_ENGINE:08X} every 20 ms, "
        f"{_TEMPERATURES:08X} and {_VOLTAGES:08X} every 500 ms"
    )
    repeat(case, _ENGINE_PERIOD, times, report)


def _error(case: Case) -> None:
    """Send SocketCAN's error frame: class bits as identifier; violation, place and counters as data."""
    kind, sent, received = number(case, "class"), number(case, "tx"), number(case, "rx")
    frame = SimulatedFrame(kind, bytes((0, 0, 0x04, 0x0A, 0, 0, sent & 0xFF, received & 0xFF)), error=True)
    case.say(f"an error frame of class {kind:03X}, error counters {sent} (sending) and {received} (receiving)")
    inject(case, [frame])


FAULTS: tuple[Fault, ...] = (
    Fault(
        "CAN-001",
        "another device on the wires sends frames with 11-bit identifiers",
        start=_battery,
        options={"seconds": 1.0},
        lasts=200 * MILLISECOND,
    ),
    Fault(
        "CAN-004",
        "the controller reports an error: a bit-stuffing violation seen on the bus",
        start=_error,
        options={"class": 0x88, "tx": 0, "rx": 8},
        limits={"class": (1, 0x1FFF_FFFF), "tx": (0, 255), "rx": (0, 255)},
        also=("BUS-005",),
    ),
    Fault(
        "CAN-018",
        "another protocol with 29-bit identifiers shares the wires",
        start=_engine,
        options={"seconds": 2.0},
        lasts=1500 * MILLISECOND,
    ),
)
