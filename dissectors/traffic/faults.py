"""Faults: what can be done to traffic on its way, and what their answers list."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import Enum
from typing import TYPE_CHECKING, Any, Protocol

from dissectors.records import dataclass, field
from dissectors.traffic.bus import Sending

if TYPE_CHECKING:
    from random import Random

    from dissectors.traffic.bus import Answer, SimulatedFrame, World

Setting = int | float | str


class Step(Enum):
    """The fate of a fault when a transfer came along: not this one, part of it done, all done."""

    SKIP = 0
    MORE = 1
    DONE = 2


class Case(Protocol):
    """One fault that was asked for, at work."""

    options: Mapping[str, Setting]
    random: Random
    world: World
    vehicle: Any
    answer: Answer
    state: dict[str, Any]

    def say(self, done: str) -> None:
        """Tell the answer key what was done."""

    def mark(self, what: Sending | SimulatedFrame) -> None:
        """List this frame, or the frames of this transfer, in the answer."""

    def watch(self, wanted: Callable[[Sending], bool], until: int | None = None) -> None:
        """List the frames of every transfer from now on whose values are `wanted`."""

    def touch(self, stage: str, do: Callable[[Case, Sending], Step]) -> None:
        """Try `do` on the coming transfers at this stage (`values`, `transfer`, `frames`) until it is done."""


Touch = Callable[[Case, Sending], Step]
Start = Callable[[Case], None]
Fits = Callable[[Sending], bool]


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault named by the `rule` that it must trigger; `title` says what it does.

    Exactly one of four says how: `values`, `transfer` or `frames` change the first transfer that `fits` (before it is
    encoded, before it is cut into frames, before it is sent), `start` does something at its time. `options` are the
    settings that it takes, with their defaults; `choices` lists what a text may be, `limits` the least and the
    most of a number. Rules in `also` may fire for the
    same reason. Who listens does not get a transfer that `transfer` or `frames` changed, unless the fault is
    `harmless`. The answer lists all frames of what was changed, or if the fault is `exact` only those that it marks. It
    `lasts` so many ns, which the flight has to go on for, so that a receiver can know. What only a whole capture can
    show is `early`: it begins before anything is sent. What ends the capture is `late`: without a time, at its end.
    """

    rule: str
    title: str
    values: Touch | None = None
    transfer: Touch | None = None
    frames: Touch | None = None
    start: Start | None = None
    fits: Fits | None = None
    options: Mapping[str, Setting] = field(default_factory=dict)
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    choices: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    also: tuple[str, ...] = ()
    harmless: bool = False
    exact: bool = False
    lasts: int = 0
    early: bool = False
    late: bool = False


def of(*names: str) -> Fits:
    """Return a test for transfers of these types, by table name."""
    return lambda sending: sending.message.table in names


def change(case: Case, stage: str, fits: Fits, do: Touch) -> None:
    """Let `do` change the next transfers that fit, until it is done; the answer lists what it did not skip."""

    def touch(case: Case, sending: Sending) -> Step:
        step = Step.SKIP if sending.changed or not fits(sending) else do(case, sending)
        if step is not Step.SKIP:
            case.mark(sending)
            sending.changed = True
        return step

    case.touch(stage, touch)
