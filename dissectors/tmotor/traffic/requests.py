"""The requests of the ground station, step by step: before a flight, during it, and on the bench.

Each plan yields the seconds to wait before its next step.
"""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING

from dissectors.times import SECOND
from dissectors.tmotor.traffic import control
from dissectors.tmotor.traffic.bench import TRIALS
from dissectors.tmotor.traffic.flights import ground_time
from dissectors.tmotor.traffic.parameters import PERMANENT, TEMPORARY, led
from dissectors.tmotor.traffic.rates import MANY

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.tmotor.traffic.vehicle import SimulatedVehicle

# Seconds between two questions that every ESC answers.
APART = 1.05


def preparation(vehicle: SimulatedVehicle, pace: float) -> Iterator[float]:
    """Ask before motors turn: all parameters, a lasting setting, position zero, FOC parameters; `pace` 1 is 1.1 s.

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
        _push_at_rest(vehicle, "SetZero", unit)
        yield 0.25 * pace / len(units)
    settings = {"led": led(enable=0b010), "throttle_priority": 1, "report_rate": vehicle.rate}
    _push_at_rest(vehicle, "FocParameters", units[-1], **settings)
    yield 0.1 * pace
    ground.push("OutputControl", units[0], control_mode=control.QUERY)
    yield max(0.1 * pace, asked + APART * vehicle.slow - vehicle.seconds)
    ground.ask_all()


def _push_at_rest(vehicle: SimulatedVehicle, name: str, unit: int, **values: int) -> None:
    """Send what is only for motors at rest; while one turns, a packet that leaves all FOC parameters as they are."""
    if vehicle.resting:
        vehicle.push(name, unit, **values)
    else:
        vehicle.push("FocParameters", unit)


def watch(vehicle: SimulatedVehicle, wait: float) -> Iterator[float]:
    """Send a question or a temporary setting every `wait` seconds, to one after the other, for as long as it lasts."""
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
        _push_at_rest(vehicle, "FocParameters", unit, acceleration_limit=300 + turn % 5 * 20)
        yield wait
        ground.configure(index)
        yield wait
        ground.query()


def trials(vehicle: SimulatedVehicle, seconds: float) -> Iterator[float]:
    """Try every control mode on the bench within so many seconds, one unit after the other, released in between."""
    ground, units = vehicle.station, vehicle.units
    wait = seconds / len(TRIALS)
    for number, (mode, set_point) in enumerate(TRIALS):
        unit = units[number % len(units)]
        ground.push("OutputControl", unit, control_mode=mode, set_point=set_point)
        yield 0.75 * wait
        ground.push("OutputControl", unit, control_mode=control.QUERY)
        yield 0.25 * wait


def commissioning(vehicle: SimulatedVehicle) -> Iterator[float]:
    """Give every ESC its index and rate for good after start-up, and read them back."""
    ground = vehicle.station
    yield 0.1
    ground.query()
    for index, esc in enumerate(vehicle.escs):
        yield 0.15
        rate, timing = esc.parameters["esc_fdb_rate"], 12 + index % 8
        ground.configure(index, esc_id_set=index, esc_fdb_rate=rate, esc_timing=timing, esc_save_option=PERMANENT)
    yield 0.2
    yield from preparation(vehicle, 1.0)


def plan_requests(vehicle: SimulatedVehicle) -> Iterator[float]:
    """Return the requests of a vehicle's flight, for as long as its world lasts."""
    duration = vehicle.world.end / SECOND
    if vehicle.request.stock:
        return stock_plan(vehicle, duration)
    return plan(vehicle, vehicle.request.flight, duration)


def plan(vehicle: SimulatedVehicle, flight: str, duration: float) -> Iterator[float]:
    """Request all of it, for a flight of `duration` seconds."""
    wait = min(max(duration / 30, 0.25), 2.0) * vehicle.slow * max(1.0, len(vehicle.escs) / MANY)
    if flight == "startup":
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


def stock_plan(vehicle: SimulatedVehicle, duration: float) -> Iterator[float]:
    """Request one of the parameters of stock ESCs now and then."""
    nodes = [esc.node.number for esc in vehicle.escs]
    wait = min(max(duration / 10, 0.5), 10.0) * vehicle.slow
    yield 0.2
    vehicle.settings.ask(vehicle.ground, nodes[0])
    yield 0.2
    vehicle.settings.set(vehicle.ground, nodes[0])
    for turn in count(1):
        yield wait
        vehicle.settings.ask(vehicle.ground, nodes[turn % len(nodes)])
