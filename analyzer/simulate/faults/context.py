"""Where faults wait for their time and their transfer, and where their answers are kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dissectors.times import SECOND
from dissectors.traffic import Answer, Case, Fault, Sending, SimulatedFrame, Step

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from random import Random

    from dissectors.traffic import Fits, Setting, World

STAGES = ("values", "transfer", "frames")
# When a fault without a time happens, as shares of the whole.
_EARLY, _LATE = 0.35, 0.8
# What should remain behind a fault that lasts.
_SPARE = 0.03


@dataclass(frozen=True, slots=True)
class FaultOrder:
    """A fault as it was asked for: `t` in ns (None: any time that suits), or with probability `rate` whenever it can.

    `settings` holds the values of the fault's own options and the common ones: `node`, `type`, `count`.
    """

    fault: Fault
    t: int | None
    settings: Mapping[str, Setting]
    rate: float | None = None
    text: str = ""


class ActiveFault:
    """One fault at work: the `Case` that its functions see. A scenario's has no `order`."""

    def __init__(self, context: FaultContext, fault: Fault, random: Random, order: FaultOrder | None = None) -> None:
        self.world = context.world
        self.vehicle = context.vehicle
        self.fault, self.order, self.random = fault, order, random
        self.options: Mapping[str, Setting] = {} if order is None else order.settings
        self.state: dict[str, Any] = {}
        self.marks = 0
        self.answer = Answer(fault.rule, context.world.now, fault.title, also=fault.also)
        self._context = context

    @property
    def shown(self) -> bool:
        """Something of it has been recorded."""
        return bool(self.answer.frames or self.answer.lines)

    def say(self, done: str) -> None:
        """Tell the answer key what was done."""
        self.answer.done = done

    def mark(self, what: Sending | SimulatedFrame) -> None:
        """List this frame, or the frames of this transfer, in the answer."""
        self.marks += 1
        if self.answer not in what.answers:
            what.answers = (*what.answers, self.answer)
        if isinstance(what, Sending):
            self._of(what)
        elif what.sending is not None:
            self._of(what.sending)
        if self.marks == 1:
            self._context.keep(self)

    def watch(self, wanted: Fits, until: int | None = None) -> None:
        """List the frames of every transfer from now on whose values are `wanted`."""

        def look(_: Case, sending: Sending) -> Step:
            if until is not None and sending.t >= until:
                return Step.DONE
            if wanted(sending):
                self.mark(sending)
            return Step.MORE

        self.touch("frames", look)

    def touch(self, stage: str, do: Callable[[Case, Sending], Step]) -> None:
        """Try `do` on the coming transfers at this stage until it is done."""
        self._context.wait(stage, lambda sending: do(self, sending))

    def _of(self, sending: Sending) -> None:
        """Take node and type of the answer from the first transfer, unless the fault has said them."""
        if self.answer.node is None:
            self.answer.node = sending.node
        self.answer.type = self.answer.type or sending.message.table


class FaultContext:
    """Every fault that waits, and every answer in the order of its beginning.

    `busy` says whether any transfer has to pass by, `open` holds the orders that found no occasion so far. Faults
    without a time of their own happen within the first `span` ns.
    """

    def __init__(self, world: World, span: int) -> None:
        self.world, self.span = world, span
        self.vehicle: Any = None
        self.busy = False
        self.open: list[FaultOrder] = []
        self._active: list[ActiveFault] = []
        self._waiting: dict[str, list[Callable[[Sending], Step]]] = {stage: [] for stage in STAGES}

    @property
    def answers(self) -> list[Answer]:
        """Those of which something has been recorded."""
        return [active.answer for active in self._active if active.shown]

    @property
    def unseen(self) -> list[FaultOrder]:
        """Orders that found no occasion, or of which nothing has been recorded."""
        lost = [active.order for active in self._active if active.order is not None and not active.shown]
        return [*self.open, *(order for order in lost if order.rate is None)]

    def take(self, order: FaultOrder, random: Random) -> None:
        """Let the fault happen at its time, if the flight goes on long enough behind it."""
        fault = order.fault
        if order.rate is not None:
            self._often(order, random)
            return
        times = int(order.settings.get("count", 1))
        t = order.t
        if t is None:
            t = _usual(fault, self.span, random)
        self.open += [order] * times
        if t + fault.lasts > self.span:
            return
        if fault.start is None:
            self._begin(t, lambda: self._arm(order, random, times))
            return
        for turn in range(times):
            self._begin(t + turn * SECOND, lambda: self._start(order, random))

    def _begin(self, t: int, call: Callable[[], None]) -> None:
        """Call at time `t`; what begins with the capture begins before anything is sent."""
        if t <= self.world.now:
            call()
        else:
            self.world.at(t, call)

    def wait(self, stage: str, do: Callable[[Sending], Step]) -> None:
        """Show every coming transfer at `stage` to `do` until that is done."""
        self._waiting[stage].append(do)
        self.busy = True

    def pass_by(self, stage: str, sending: Sending) -> None:
        """Show a transfer that has reached `stage` to every fault that waits there."""
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

    def keep(self, active: ActiveFault) -> None:
        """Keep what has something to show: its answer is for the key; what starts by itself has found its occasion."""
        self._active.append(active)
        if active.fault.start is not None and active.order is not None:
            self._close(active.order)

    def _close(self, order: FaultOrder) -> None:
        if order in self.open:
            self.open.remove(order)

    def _start(self, order: FaultOrder, random: Random) -> None:
        start = order.fault.start
        if start is not None:
            start(ActiveFault(self, order.fault, random, order))

    def _arm(self, order: FaultOrder, random: Random, times: int) -> None:
        """Wait for the transfers that the fault changes, one after the other."""
        active = ActiveFault(self, order.fault, random, order)
        stage, touch = _touch(order.fault)
        fits = _fits(order)

        def do(sending: Sending) -> Step:
            nonlocal active, times
            if sending.changed or not fits(sending):
                return Step.SKIP
            step = self._apply(active, stage, touch, sending)
            if step is not Step.DONE:
                return step
            self._close(order)
            times -= 1
            if not times:
                return Step.DONE
            active = ActiveFault(self, order.fault, random, order)
            return Step.MORE

        self.wait(stage, do)

    def _often(self, order: FaultOrder, random: Random) -> None:
        """Let it happen with a probability for every transfer that fits; without one to change, for every second."""
        rate = order.rate or 0.0
        if order.fault.start is not None:
            self.world.every(SECOND, lambda: self._start(order, random) if random.random() < rate else None, SECOND)
            return
        stage, touch = _touch(order.fault)
        fits = _fits(order)
        active, armed = ActiveFault(self, order.fault, random, order), False

        def do(sending: Sending) -> Step:
            nonlocal active, armed
            if sending.changed or not fits(sending):
                return Step.MORE
            armed = armed or random.random() < rate
            if armed and self._apply(active, stage, touch, sending) is Step.DONE:
                active, armed = ActiveFault(self, order.fault, random, order), False
            return Step.MORE

        self.wait(stage, do)

    def _apply(self, active: ActiveFault, stage: str, touch: Callable[[Case, Sending], Step], sending: Sending) -> Step:
        """Let a fault change a transfer, which all others then leave alone: each of them must be there to be seen."""
        before = active.marks
        step = touch(active, sending)
        if step is not Step.SKIP:
            if not active.fault.exact:
                active.mark(sending)
            if active.marks > before:
                sending.changed = True
                sending.damaged = sending.damaged or not (stage == "values" or active.fault.harmless)
        return step


def _usual(fault: Fault, span: int, random: Random) -> int:
    """Return a time for a fault that was given none: in the middle of the flight, early enough to be over in time."""
    if fault.early or fault.late:
        return 0 if fault.early else max(0, span - fault.lasts)
    return round(span * random.uniform(_EARLY, max(_EARLY, min(_LATE, 1 - fault.lasts / span - _SPARE))))


def _touch(fault: Fault) -> tuple[str, Callable[[Case, Sending], Step]]:
    for stage in STAGES:
        touch = getattr(fault, stage)
        if touch is not None:
            return stage, touch
    raise ValueError(f"{fault.rule}: nothing to do")


def _fits(order: FaultOrder) -> Fits:
    """Return a test for what the fault may change: transfers that it names, or those that the settings name."""
    node, name, usual = order.settings.get("node"), order.settings.get("type"), order.fault.fits

    def fits(sending: Sending) -> bool:
        if node is not None and sending.node != node:
            return False
        if name is not None:
            return sending.message.table == name
        return usual is None or usual(sending)

    return fits
