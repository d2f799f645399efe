"""What the ground station does, step by step: before a flight, during it, and on the bench.

Each plan yields the seconds to wait before its next step.
"""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING

from dissectors.tmotor.traffic import control
from dissectors.tmotor.traffic.bench import TRIALS
from dissectors.tmotor.traffic.flights import ground_time
from dissectors.tmotor.traffic.parameters import PERMANENT, TEMPORARY, led
from dissectors.tmotor.traffic.rates import MANY

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.tmotor.traffic.vehicle import Vehicle

# Seconds between two questions that every ESC answers.
APART = 1.05


def preparation(vehicle: Vehicle, pace: float) -> Iterator[float]:
    """Before the motors turn: all parameters, a lasting setting, position zero, FOC parameters; `pace` 1 is 1.1 s.

    What every ESC answers is a second apart, however little time there is: the limit of 2400 frames a second holds.
    """
    ground, units = vehicle.station, vehicle.units
    yield 0.15 * pace
    asked = vehicle.seconds
    ground.query()
    yield 0.3 * pace
    save = PERMANENT if vehicle.resting else TEMPORARY
    ground.configure(0, esc_id_set=0, esc_led_mode=led(hertz=1.0), esc_save_option=save)
    yield 0.15 * pace
    for unit in units:
        ground.push("SetZero", unit)
        yield 0.25 * pace / len(units)
    ground.push("FocParameters", units[-1], led=led(enable=0b010), throttle_priority=1, report_rate=vehicle.rate)
    yield 0.1 * pace
    ground.push("OutputControl", units[0], control_mode=control.QUERY)
    yield max(0.1 * pace, asked + APART * vehicle.slow - vehicle.seconds)
    ground.ask_all()


def watch(vehicle: Vehicle, wait: float) -> Iterator[float]:
    """For as long as it lasts: a question or a temporary setting every `wait` seconds, to one after the other."""
    ground, units, escs = vehicle.station, vehicle.units, vehicle.escs
    for turn in count():
        unit, index = units[turn % len(units)], turn % len(escs)
        yield wait
        ground.push("OutputControl", unit, control_mode=control.QUERY)
        yield wait
        ground.push("FocQuery", unit)
        yield wait
        ground.configure(index, esc_led_mode=led(hertz=turn % 20 / 2))
        yield wait
        ground.push("FocParameters", unit, acceleration_limit=300 + turn % 5 * 20)
        yield wait
        ground.configure(index)
        yield wait
        ground.query()


def trials(vehicle: Vehicle, seconds: float) -> Iterator[float]:
    """Every control mode on the bench within so many seconds, one unit after the other, released in between."""
    ground, units = vehicle.station, vehicle.units
    wait = seconds / len(TRIALS)
    for number, (mode, set_point) in enumerate(TRIALS):
        unit = units[number % len(units)]
        ground.push("OutputControl", unit, control_mode=mode, set_point=set_point)
        yield 0.75 * wait
        ground.push("OutputControl", unit, control_mode=control.QUERY)
        yield 0.25 * wait


def commissioning(vehicle: Vehicle) -> Iterator[float]:
    """After start-up: every ESC is given its index and rate for good, and read back."""
    ground = vehicle.station
    yield 0.1
    ground.query()
    for index, esc in enumerate(vehicle.escs):
        yield 0.15
        rate, timing = esc.parameters["esc_fdb_rate"], 12 + index % 8
        ground.configure(index, esc_id_set=index, esc_fdb_rate=rate, esc_timing=timing, esc_save_option=PERMANENT)
    yield 0.2
    yield from preparation(vehicle, 1.0)


def plan(vehicle: Vehicle, profile: str, duration: float) -> Iterator[float]:
    """All of it, for a flight of `duration` seconds."""
    wait = min(max(duration / 30, 0.25), 2.0) * vehicle.slow * max(1.0, len(vehicle.escs) / MANY)
    if profile == "startup":
        yield from commissioning(vehicle)
    else:
        yield from preparation(vehicle, ground_time(duration) / 2)
    if vehicle.bench is not None:
        watching = watch(vehicle, wait)
        while vehicle.seconds + wait < vehicle.bench.stop:
            yield next(watching)
        yield max(0.0, vehicle.bench.control - vehicle.seconds)
        yield from trials(vehicle, 0.95 * vehicle.bench.duration - vehicle.bench.control)
    yield from watch(vehicle, wait)


def stock_plan(vehicle: Vehicle, duration: float) -> Iterator[float]:
    """The same for stock ESCs: one of their parameters now and then."""
    nodes = [esc.node.number for esc in vehicle.escs]
    wait = min(max(duration / 10, 0.5), 10.0) * vehicle.slow
    yield 0.2
    vehicle.settings.ask(vehicle.ground, nodes[0])
    yield 0.2
    vehicle.settings.set(vehicle.ground, nodes[0])
    for turn in count(1):
        yield wait
        vehicle.settings.ask(vehicle.ground, nodes[turn % len(nodes)])
