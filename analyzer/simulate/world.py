"""The clock that drives everything: what devices do at their times, and the bus in between."""

from __future__ import annotations

from heapq import heappop, heappush
from itertools import count
from random import Random
from typing import TYPE_CHECKING

from analyzer.simulate import wire
from analyzer.simulate.allocation import Allocatee, Allocator
from analyzer.simulate.bus import SimulatedBus
from analyzer.simulate.device import Device
from analyzer.simulate.encode import compiled
from analyzer.simulate.faults.context import FaultContext
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dissectors.registry import Registry
    from dissectors.schema import Message
    from dissectors.traffic import Sending, SimulatedFrame


class SimulatedWorld:
    """A bus, the devices on it and those who listen; see `dissectors.traffic.World`.

    `seed` decides every throw of the dice; each part that throws them has dice of its own (`dice`), so that adding a
    fault changes nothing else. Faults without a time of their own happen within the first `span` ns, 0 for all of them.
    """

    def __init__(self, registry: Registry, *, bit_rate: int, end: int, seed: int, span: int = 0) -> None:
        self.now = 0
        self.end, self.bit_rate, self.seed = end, bit_rate, seed
        self.span = span or end
        self.bus = SimulatedBus(SECOND // bit_rate)
        self.random = self.dice("vehicle", seed)
        self.context = FaultContext(self, self.span)
        self.devices: dict[int, list[Device]] = {}
        self._registry = registry
        self._order = count()
        self._todo: list[tuple[int, int, Callable[[], object]]] = []
        self._heard: dict[str, list[Callable[[Sending], object]]] = {}
        self._messages: dict[str, Message] = {}
        self._encoders: dict[str, Callable[[dict[str, object]], bytes]] = {}
        self._allocators: dict[int, Allocator] = {}
        self._aside: list[SimulatedFrame] = []
        self._copy: Callable[[SimulatedFrame], SimulatedFrame | None] | None = None
        self._latest = 0
        self._final: SimulatedFrame | None = None
        self._deaf = 0
        self._clock = 0

    @staticmethod
    def dice(of: str, seed: int) -> Random:
        """Return dice for one part of the simulation."""
        return Random(f"{of} {seed}")

    def at(self, t: int, call: Callable[[], object]) -> None:
        """Call at time `t`, or now if that is over."""
        heappush(self._todo, (max(t, self.now), next(self._order), call))

    def every(self, period: int, call: Callable[[], object], first: int = 0) -> None:
        """Call at `first` and every `period` ns from then on."""

        def again() -> None:
            nonlocal first
            call()
            first += period
            self.at(first, again)

        self.at(first, again)

    def device(self, number: int, name: str, *, silent: bool = False) -> Device:
        """Put a device on the bus; see `Device`."""
        here = self.devices.setdefault(number, [])
        # Dice of its own: a device that joins changes nothing of what others do.
        device = Device(self, number, name, self.dice(f"device {number} {len(here)}", self.seed), silent=silent)
        here.append(device)
        return device

    def allocate(self, server: int, number: int, call: Callable[[], object]) -> None:
        """Have a silent device ask the device `server` for its node ID, and call once it speaks by it."""
        asking, serving = self.node(number), self.node(server)
        if asking is None or serving is None:
            raise ValueError(f"no device {number} or {server}")
        if server not in self._allocators:
            self._allocators[server] = Allocator(self, serving, self.used_ids)
        Allocatee(self, asking, call)

    def used_ids(self) -> set[int]:
        """Return the node IDs that some device uses."""
        return {number for number, some in self.devices.items() if not all(one.silent for one in some)}

    def node(self, number: int) -> Device | None:
        """Return the device with a number, the first one of several."""
        every = (device for devices in self.devices.values() for device in devices)
        return next((device for device in every if device.number == number), None)

    def hear(self, name: str, call: Callable[[Sending], object]) -> None:
        """Call with every undamaged transfer of a type, at the end of its last frame."""
        self._heard.setdefault(self.message(name).table, []).append(call)

    def message(self, name: str) -> Message:
        """Return the data type of a name."""
        found = self._messages.get(name)
        if found is None:
            found = self._messages[name] = self._registry.resolve(name)
        return found

    def send(self, sending: Sending) -> None:
        """Encode a transfer and put its frames on the bus; faults that wait for it have their turn."""
        sending.t, context = self.now, self.context
        if context.busy:
            context.pass_by("values", sending)
        sending.payload = self._encoder(sending.message)(sending.values)
        if context.busy:
            context.pass_by("transfer", sending)
        sending.frames = wire.frames(sending)
        if context.busy:
            context.pass_by("frames", sending)
        self.put(sending.frames, sending)

    def copy(self, call: Callable[[SimulatedFrame], SimulatedFrame | None] | None) -> None:
        """Record what `call` makes of every frame on the bus right behind it: a second interface."""
        self._copy = call

    def put(self, frames: list[SimulatedFrame], sending: Sending | None = None) -> None:
        """Let frames compete for the bus from now on; they belong to `sending`, if that is given."""
        for frame in frames:
            frame.sending = frame.sending or sending
            if frame.delay:
                self.at(self.now + frame.delay, lambda frame=frame: self._queue(frame))  # type: ignore[misc]
            else:
                self._queue(frame)

    def cut(self, frame: SimulatedFrame) -> None:
        """End the recording behind this frame."""
        self._final = frame

    def deafen(self, until: int) -> None:
        """Record nothing that ends before `until`; the bus goes on."""
        self._deaf = until

    def step_clock(self, by: int) -> None:
        """Set the recorder's clock by so many ns, ahead or back, for all that comes."""
        self._clock -= by

    def stamp(self) -> int:
        """Return what the recorder's clock says now."""
        return self.now - self._clock

    def stop(self) -> None:
        """End the recording now."""
        self.end = min(self.end, self.now)

    def block(self, until: int, *, keep: bool = False) -> None:
        """Let nothing be sent before `until`; what waits now is given up, or waits on to `keep` it."""
        if not keep:
            self.bus.drop()
        self.bus.block(until)

    def _queue(self, frame: SimulatedFrame) -> None:
        if frame.error or frame.bus:  # no arbitration: what a controller reports, and the other interface
            frame.t = max(self.now, self._latest)
            self._aside.append(frame)
        else:
            self.bus.put(frame)

    def run(self) -> Iterator[SimulatedFrame]:
        """Yield every frame that is on the bus before `end`, in the order of their ends; `t` is set."""
        while True:
            due = self._todo[0][0] if self._todo else self.end
            frame = self.bus.next(self.now, min(due, self.end))
            if frame is not None:
                if frame.t >= self.end:
                    return
                self._latest = frame.t
                self._deliver(frame)
                frame.lost = frame.lost or frame.t < self._deaf
                frame.shift += self._clock
                yield frame
                copied = self._copy(frame) if self._copy is not None else None
                if copied is not None:
                    self._latest = copied.t
                    yield copied
                if frame is self._final:
                    return
                continue
            if due >= self.end:
                return
            self.now, _, call = heappop(self._todo)
            call()
            if self._aside:
                for frame in self._aside:
                    frame.shift += self._clock
                yield from self._aside
                self._aside = []

    def _deliver(self, frame: SimulatedFrame) -> None:
        sending = frame.sending
        if sending is None or sending.damaged or frame is not sending.frames[-1]:
            return
        for call in self._heard.get(sending.message.table, ()):
            self.at(frame.t, lambda call=call: call(sending))  # type: ignore[misc]

    def _encoder(self, message: Message) -> Callable[[dict[str, object]], bytes]:
        encoder = self._encoders.get(message.table)
        if encoder is None:
            encoder = self._encoders[message.table] = compiled(message.layout)
        return encoder
