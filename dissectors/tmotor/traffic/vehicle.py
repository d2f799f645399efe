"""The whole vehicle on its bus: an autopilot, a ground station and ESCs on one pack."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from dissectors.records import dataclass
from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.answers import Answers
from dissectors.tmotor.traffic.autopilot import Autopilot
from dissectors.tmotor.traffic.bench import Bench
from dissectors.tmotor.traffic.esc import Esc, unique_ids
from dissectors.tmotor.traffic.flights import Leg, hover, mission
from dissectors.tmotor.traffic.ground import Ground
from dissectors.tmotor.traffic.physics.airframe import arms
from dissectors.tmotor.traffic.physics.pack import Pack
from dissectors.tmotor.traffic.pilot import Pilot
from dissectors.tmotor.traffic.rates import rates
from dissectors.tmotor.traffic.stock import StockParameters

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dissectors.traffic import Sending, World

FLIGHT_PLANS = ("hover", "mission", "bench", "startup")
AUTOPILOT, GROUND, FIRST_ESC = 10, 125, 11
# Physics and control loop run at 100 Hz; what is measured in between is advanced exactly.
_STEP = 10 * MILLISECOND
# No series of trials on the bench takes longer, in s.
_BENCH = 120.0
# The autopilot commands once every ESC reports; one that never does is not waited for, except while IDs are allocated.
_LONGEST_WAIT = 3 * SECOND


@dataclass(frozen=True, slots=True)
class VehicleRequest:
    """The vehicle that is wanted: `flight` one of `FLIGHT_PLANS`, `stock` without T-Motor types.

    `rate` of ESCStatus in Hz; None is 30, less on a slow bus (see `rates`).
    """

    flight: str = "hover"
    escs: int = 4
    rate: int | None = None
    stock: bool = False


class _Plan(Protocol):
    def throttles(self, seconds: float, step: float, thrust: float, /) -> list[float]: ...


class SimulatedVehicle:
    """`escs` by their esc_index; `autopilot` and `ground` are the nodes of those two.

    `pack`, each ESC's `motor` and other attributes can be changed at any time, which is how it fails. What it does
    is laid out at the start, for as long as `world.end`.
    """

    def __init__(
        self,
        world: World,
        request: VehicleRequest,
        plan: Callable[[SimulatedVehicle], Iterator[float]],
    ) -> None:
        """Put the vehicle on a bus; the ground station's `plan` yields the seconds to wait before its next step."""
        self.world, self.request, self._requests = world, request, plan
        duration = world.end / SECOND
        pace = rates(world.bit_rate, request.escs, request.rate)
        self.rate, self.slow = pace.status, pace.slow
        starting = request.flight == "startup"
        self.autopilot = world.device(AUTOPILOT, "org.example.autopilot")
        self.ground = world.device(GROUND, "org.example.ground_station")
        self.escs = [
            Esc(
                world,
                world.device(FIRST_ESC + index, _name(request), silent=starting),
                index,
                uuid,
                pace,
                stock=request.stock,
            )
            for index, uuid in enumerate(unique_ids(world.random, request.escs))
        ]
        self.units = [esc.unit for esc in self.escs if esc.unit is not None]
        # About twice the charge that the time takes, and never less than 16 Ah.
        self.pack = Pack(max(16 * 3600.0, 28.0 * request.escs * duration))
        self.pilot = Autopilot(world, self.autopilot, request.escs, pace, stock=request.stock)
        self.station = Ground(world, self.ground, self.escs)
        self.settings = StockParameters(world, self.escs)
        self.bench = Bench(request.escs, min(duration, _BENCH)) if request.flight == "bench" else None
        self.plan = self._flight(duration)
        for esc in self.escs:
            esc.motor.voltage = self.pack.voltage
            if not request.stock:
                Answers(esc, pace)
            esc.reports.start(2 * MILLISECOND + esc.status_period * esc.index // request.escs)
            if starting:
                world.allocate(AUTOPILOT, esc.node.number, esc.wake)
        world.hear("RawCommand", self._commanded)
        world.every(_STEP, self._step, _STEP)
        self._wait()

    @property
    def seconds(self) -> float:
        """Time since the start of the simulation."""
        return self.world.now / SECOND

    @property
    def resting(self) -> bool:
        """No motor turns, or is about to."""
        return not any(self.pilot.last) and not any(esc.motor.speed for esc in self.escs)

    @property
    def commanding(self) -> bool:
        """The autopilot sends RawCommand."""
        return self.pilot.commanding

    @commanding.setter
    def commanding(self, on: bool) -> None:
        self.pilot.commanding = on

    @property
    def throttle_hook(self) -> Callable[[list[int]], list[int]] | None:
        """Changes the values of every RawCommand before it is sent."""
        return self.pilot.hook

    @throttle_hook.setter
    def throttle_hook(self, hook: Callable[[list[int]], list[int]] | None) -> None:
        self.pilot.hook = hook

    def command(self, index: int) -> int:
        """Return the last throttle that was sent to an ESC, 0 to 8191; 0 if the command was too short for it."""
        return self.pilot.last[index] if index < len(self.pilot.last) else 0

    def query(self) -> Sending:
        """Let the ground station ask every ESC for its parameters (4.4.2 explanation 2)."""
        return self.station.query()

    def configure(self, index: int, **changes: Any) -> Sending:
        """Let the ground station send one ESC a ParamCfg with these fields."""
        return self.station.configure(index, **changes)

    def push(self, name: str, unit: int, **values: Any) -> Sending:
        """Let the ground station send a packet to a unit (0xA1 to 0xA9); see `Ground.push`."""
        return self.station.push(name, unit, **values)

    def describe(self) -> dict[str, Any]:
        """Return who is on the bus, for the answer key."""
        return {
            "autopilot": AUTOPILOT,
            "ground": GROUND,
            "escs": [
                {
                    "node": esc.node.number,
                    "esc_index": esc.index,
                    "unit": None if esc.unit is None else esc.unit - 0xA0,
                    "uuid": f"{esc.uuid:08X}",
                    "name": _name(self.request),
                }
                for esc in self.escs
            ],
        }

    def _flight(self, duration: float) -> _Plan:
        geometry, random, flight = arms(self.request.escs), self.world.random, self.request.flight
        if self.bench is not None:
            return self.bench
        if flight == "mission":
            return Pilot(random, geometry, mission(duration, random), 0.035)
        return Pilot(random, geometry, hover(duration) if flight == "hover" else [Leg(0.0)], 0.015)

    def _wait(self) -> None:
        """Wait until every ESC has reported; then the autopilot commands and the ground station begins."""
        late = self.world.now >= _LONGEST_WAIT and self.request.flight != "startup"
        if not late and not all(esc.reports.begun for esc in self.escs):
            self.world.at(self.world.now + _STEP, self._wait)
            return
        self.pilot.start()
        self._go_on(self._requests(self))

    def _go_on(self, plan: Iterator[float]) -> None:
        wait = next(plan, None)
        if wait is not None:
            self.world.at(self.world.now + round(wait * SECOND), lambda: self._go_on(plan))

    def _commanded(self, sending: Sending) -> None:
        command = sending.values["cmd"]
        for esc in self.escs:
            esc.hear(command)

    def _step(self) -> None:
        step = _STEP / SECOND
        self.pack.advance(step, sum(esc.motor.current for esc in self.escs))
        voltage = self.pack.voltage
        for esc in self.escs:
            esc.step(step, voltage)
        self.pilot.wanted = self.plan.throttles(self.seconds, step, sum(esc.motor.thrust for esc in self.escs))


def _name(request: VehicleRequest) -> str:
    return "org.example.esc" if request.stock else "com.tmotor.esc"
