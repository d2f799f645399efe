"""Where faults wait for their time and their transfer, and where their answers are kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dissectors.traffic import SECOND, Answer, Case, Fault, Frame, Sending, Step

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from random import Random

    from analyzer.simulate.world import World
    from dissectors import traffic
    from dissectors.traffic import Fits, Setting

STAGES = ("values", "transfer", "frames")
# When a fault without a time happens, as shares of the whole.
_EARLY, _LATE = 0.35, 0.8
# What should remain behind a fault that lasts.
_SPARE = 0.03


@dataclass(frozen=True, slots=True)
class Order:
    """A fault as it was asked for: `t` in ns (None: any time that suits), or with probability `rate` whenever it can.

    `settings` holds the values of the fault's own options and the common ones: `node`, `type`, `count`.
    """

    fault: Fault
    t: int | None
    settings: Mapping[str, Setting]
    rate: float | None = None
    text: str = ""


class Work:
    """One fault at work: the `Case` that its functions see. A scenario's has no `order`."""

    def __init__(self, desk: Desk, fault: Fault, random: Random, order: Order | None = None) -> None:
        self.world: traffic.World = desk.world
        self.vehicle = desk.vehicle
        self.fault, self.order, self.random = fault, order, random
        self.options: Mapping[str, Setting] = {} if order is None else order.settings
        self.state: dict[str, Any] = {}
        self.marks = 0
        self.answer = Answer(fault.rule, desk.world.now, fault.title, also=fault.also)
        self._desk = desk

    @property
    def shown(self) -> bool:
        """Whether something of it has been recorded."""
        return bool(self.answer.frames or self.answer.lines)

    def say(self, done: str) -> None:
        """What was done, for the answer key."""
        self.answer.done = done

    def mark(self, what: Sending | Frame) -> None:
        """The answer lists this frame, or the frames of this transfer."""
        self.marks += 1
        if self.answer not in what.answers:
            what.answers = (*what.answers, self.answer)
        if isinstance(what, Sending):
            self._of(what)
        elif what.sending is not None:
            self._of(what.sending)
        if self.marks == 1:
            self._desk.keep(self)

    def watch(self, wanted: Fits, until: int | None = None) -> None:
        """The answer lists the frames of every transfer from now on whose values are `wanted`."""

        def look(_: Case, sending: Sending) -> Step:
            if until is not None and sending.t >= until:
                return Step.DONE
            if wanted(sending):
                self.mark(sending)
            return Step.MORE

        self.touch("frames", look)

    def touch(self, stage: str, do: Callable[[Case, Sending], Step]) -> None:
        """Tries `do` on the coming transfers at this stage until it is done."""
        self._desk.wait(stage, lambda sending: do(self, sending))

    def _of(self, sending: Sending) -> None:
        """The first transfer says which node and type the answer is about, unless the fault has."""
        if self.answer.node is None:
            self.answer.node = sending.node
        self.answer.type = self.answer.type or sending.message.table


class Desk:
    """Every fault that waits, and every answer in the order of its beginning.

    `busy` says whether any transfer has to pass by, `open` holds the orders that found no occasion so far.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.vehicle: Any = None
        self.busy = False
        self.open: list[Order] = []
        self._works: list[Work] = []
        self._waiting: dict[str, list[Callable[[Sending], Step]]] = {stage: [] for stage in STAGES}

    @property
    def answers(self) -> list[Answer]:
        """Those of which something has been recorded."""
        return [work.answer for work in self._works if work.shown]

    @property
    def unseen(self) -> list[Order]:
        """Orders that found no occasion, or of which nothing has been recorded."""
        lost = [work.order for work in self._works if work.order is not None and not work.shown]
        return [*self.open, *(order for order in lost if order.rate is None)]

    def take(self, order: Order, random: Random) -> None:
        """Lets the fault happen at its time, if the flight goes on long enough behind it."""
        world, fault = self.world, order.fault
        if order.rate is not None:
            self._often(order, random)
            return
        times = int(order.settings.get("count", 1))
        t = order.t
        if t is None:
            t = _usual(fault, world.span, random)
        self.open += [order] * times
        if t + fault.lasts > world.span:
            return
        if fault.start is None:
            self._begin(t, lambda: self._arm(order, random, times))
            return
        for turn in range(times):
            self._begin(t + turn * SECOND, lambda: self._start(order, random))

    def _begin(self, t: int, call: Callable[[], None]) -> None:
        """At time `t`; what begins with the capture begins before anything is sent."""
        if t <= self.world.now:
            call()
        else:
            self.world.at(t, call)

    def wait(self, stage: str, do: Callable[[Sending], Step]) -> None:
        """Shows every coming transfer at `stage` to `do` until that is done."""
        self._waiting[stage].append(do)
        self.busy = True

    def pass_by(self, stage: str, sending: Sending) -> None:
        """A transfer has reached `stage`."""
        waiting = self._waiting[stage]
        done = []
        for do in tuple(waiting):
            if stage == "frames" and not sending.frames:  # held back, or never to be sent
                break
            if do(sending) is Step.DONE:
                done.append(do)
        for do in done:
            if do in waiting:  # what it sent in turn may have been its end
                waiting.remove(do)
        if done:
            self.busy = any(self._waiting.values())

    def keep(self, work: Work) -> None:
        """It has something to show: its answer belongs to the key, and what starts by itself has found its occasion."""
        self._works.append(work)
        if work.fault.start is not None and work.order is not None:
            self._close(work.order)

    def _close(self, order: Order) -> None:
        if order in self.open:
            self.open.remove(order)

    def _start(self, order: Order, random: Random) -> None:
        start = order.fault.start
        if start is not None:
            start(Work(self, order.fault, random, order))

    def _arm(self, order: Order, random: Random, times: int) -> None:
        """Waits for the transfers that the fault changes, one after the other."""
        work = Work(self, order.fault, random, order)
        stage, touch = _touch(order.fault)
        fits = _fits(order)

        def do(sending: Sending) -> Step:
            nonlocal work, times
            if sending.changed or not fits(sending):
                return Step.SKIP
            step = self._apply(work, stage, touch, sending)
            if step is not Step.DONE:
                return step
            self._close(order)
            times -= 1
            if not times:
                return Step.DONE
            work = Work(self, order.fault, random, order)
            return Step.MORE

        self.wait(stage, do)

    def _often(self, order: Order, random: Random) -> None:
        """With a probability, for every transfer that fits; or, without one to change, for every second."""
        rate = order.rate or 0.0
        if order.fault.start is not None:
            self.world.every(SECOND, lambda: self._start(order, random) if random.random() < rate else None, SECOND)
            return
        stage, touch = _touch(order.fault)
        fits = _fits(order)
        work, armed = Work(self, order.fault, random, order), False

        def do(sending: Sending) -> Step:
            nonlocal work, armed
            if sending.changed or not fits(sending):
                return Step.MORE
            armed = armed or random.random() < rate
            if armed and self._apply(work, stage, touch, sending) is Step.DONE:
                work, armed = Work(self, order.fault, random, order), False
            return Step.MORE

        self.wait(stage, do)

    def _apply(self, work: Work, stage: str, touch: Callable[[Case, Sending], Step], sending: Sending) -> Step:
        """What one fault has changed is left alone by all others: each of them must be there to be seen."""
        before = work.marks
        step = touch(work, sending)
        if step is not Step.SKIP:
            if not work.fault.exact:
                work.mark(sending)
            if work.marks > before:
                sending.changed = True
                sending.damaged = sending.damaged or not (stage == "values" or work.fault.harmless)
        return step


def _usual(fault: Fault, span: int, random: Random) -> int:
    """When a fault happens that was given no time: in the middle of the flight, early enough to be over in time."""
    if fault.early or fault.late:
        return 0 if fault.early else max(0, span - fault.lasts)
    return round(span * random.uniform(_EARLY, max(_EARLY, min(_LATE, 1 - fault.lasts / span - _SPARE))))


def _touch(fault: Fault) -> tuple[str, Callable[[Case, Sending], Step]]:
    for stage in STAGES:
        touch = getattr(fault, stage)
        if touch is not None:
            return stage, touch
    raise ValueError(f"{fault.rule}: nothing to do")


def _fits(order: Order) -> Fits:
    """Which transfers the fault may change: those that it names, or those that the settings name."""
    node, name, usual = order.settings.get("node"), order.settings.get("type"), order.fault.fits

    def fits(sending: Sending) -> bool:
        if node is not None and sending.node != node:
            return False
        if name is not None:
            return sending.message.table == name
        return usual is None or usual(sending)

    return fits
