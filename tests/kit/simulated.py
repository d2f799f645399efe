"""Simulated flights: every recorded frame and transfer, text and answer key, and what a fault in one must show.

A flight is `Flown` where the simulation behind it is asked, and a `Flight` where only what is recorded counts.
"""

from __future__ import annotations

import contextlib
import io
import shlex
import struct
from collections import Counter
from dataclasses import dataclass, field
from functools import cache, cached_property, lru_cache
from typing import TYPE_CHECKING, Any

from witness import finder
from witness.reader import Log

from analyzer.cli import main
from analyzer.simulate import Simulation, SimulationSettings
from analyzer.simulate.faults import catalogue
from analyzer.simulate.text import line
from dissectors.times import SECOND
from dissectors.tmotor.traffic.packets import split
from kit import encode
from kit.judged import registry

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from dissectors.tmotor.traffic import SimulatedVehicle
    from dissectors.traffic import Sending, SimulatedFrame

    Change = Callable[[Sending, int], dict[str, Any] | None]

FLIGHT_PLANS = ("hover", "mission", "bench", "startup")


def simulation(
    seconds: float = 6, *, orders: Sequence[str] = (), rates: Sequence[str] = (), **settings: Any
) -> Simulation:
    """A simulation with faults and fault rates, as on the command line; `settings` as `SimulationSettings` has them."""
    wanted = (*map(catalogue.order, orders), *map(catalogue.rate, rates))
    return Simulation(SimulationSettings(duration=round(seconds * SECOND), orders=wanted, **settings), registry())


def text_of(simulation: Simulation, frames: Iterable[SimulatedFrame]) -> str:
    return "".join(line(frame, simulation.settings.start, ("can0", "can1")) for frame in frames)


@dataclass(eq=False)
class Flown:
    """What became of a simulation; times in ns."""

    simulation: Simulation
    frames: list[SimulatedFrame] = field(init=False)

    def __post_init__(self) -> None:
        self.frames = list(self.simulation.frames())

    @property
    def vehicle(self) -> SimulatedVehicle:
        return self.simulation.vehicle

    @property
    def escs(self) -> range:
        """Their node IDs."""
        return range(11, 11 + self.simulation.settings.escs)

    @cached_property
    def text(self) -> str:
        return text_of(self.simulation, self.frames)

    @cached_property
    def sent(self) -> list[Sending]:
        """In the order of their last frames."""
        return [frame.sending for frame in self.frames if frame.sending and frame is frame.sending.frames[-1]]

    @cached_property
    def key(self) -> Mapping[str, Any]:
        """The answers to the faults."""
        return self.simulation.key()

    def answer(self, rule: str) -> dict[str, Any]:
        (found,) = (fault for fault in self.key["faults"] if fault["rule"] == rule)
        return dict(found)

    def shown(self, rule: str) -> list[Sending]:
        """The transfers whose frames the answer lists; it lists all frames of each."""
        numbers = set(self.answer(rule)["frames"])
        found = [one for one in self.sent if {frame.number for frame in one.frames} & numbers]
        assert {frame.number for one in found for frame in one.frames if frame.number} == numbers
        return found

    def of(self, name: str, node: int | None = None) -> list[Sending]:
        """The transfers of a type, of one node or of all."""
        return [one for one in self.sent if one.name == name and node in {None, one.node}]

    def packets(self, name: str, node: int | None = None) -> Iterator[tuple[Sending, dict[str, Any]]]:
        """Every packet of a name with the transfer that carries it."""
        for carrier in ("PUSHSCI", "PUSHCAN"):
            for one in self.of(carrier, node):
                found, values = split(one.values["data"])
                if found == name:
                    yield one, values


@lru_cache(maxsize=8)
def flown(seconds: float = 6, **settings: Any) -> Flown:
    """A flight that tests share."""
    return Flown(simulation(seconds, **settings))


@lru_cache(maxsize=8)
def faulted(*orders: str, seconds: float = 4, **settings: Any) -> Flown:
    """A flight with faults given as on the command line; some of them may find no occasion."""
    return Flown(simulation(seconds, orders=orders, **settings))


def end(sending: Sending) -> int:
    """When its last frame was on the bus."""
    return sending.frames[-1].t


def peak(times: list[int], window: int = SECOND) -> int:
    """The most events in any window."""
    first = most = 0
    for last, t in enumerate(times):
        while times[first] <= t - window:
            first += 1
        most = max(most, last - first + 1)
    return most


def word(sending: Sending) -> int:
    """The first four bytes as they were sent: error_count of an ESCStatus."""
    return int.from_bytes(sending.payload[:4], "little")


def codes(sending: Sending) -> tuple[int, ...]:
    """The float16 values of an ESCStatus as they were sent."""
    return struct.unpack_from("<3H", sending.payload, 4)


def status_bits(sending: Sending) -> tuple[int, int, int]:
    """Fault bits, operating mode and encoder of an ESCStatus (4.4.3)."""
    word = sending.values["error_count"]
    return word & 0xFFF, word >> 12 & 15, word >> 16


SEED = 5


@lru_cache(maxsize=8)
def flight(*orders: str, seconds: float = 4, seed: int = SEED, **settings: Any) -> str:
    """What `tailbyte simulate` writes with faults given as on its command line; each of them finds its occasion."""
    one = Flown(simulation(seconds, orders=orders, seed=seed, **settings))
    assert one.simulation.unused == ()
    return one.text


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """A capture, its answer key, and the faults that found no occasion."""

    log: Log
    key: Mapping[str, Any]
    unused: tuple[str, ...]

    def answers(self, rule: str) -> list[dict[str, Any]]:
        """The entries of a rule in the key."""
        return [entry for entry in self.key["faults"] if entry["rule"] == rule]

    def unlisted(self, same: Flight) -> Counter[tuple[int, bytes]]:
        """Return the frames that neither the key lists nor the same flight without the fault has."""
        listed = {number for answer in self.key["faults"] for number in answer["frames"]}
        frames = Counter((frame.id, frame.data) for frame in self.log.frames if frame.number not in listed)
        return frames - Counter((frame.id, frame.data) for frame in same.log.frames)


def fly(*orders: str, rates: Sequence[str] = (), seconds: float = 10, **settings: Any) -> Flight:
    """A flight with faults and fault rates as `simulation` takes them; some of them may find no occasion."""
    run = simulation(seconds, orders=orders, rates=rates, **settings)
    log = Log(text_of(run, run.frames()))
    return Flight(log, run.key(), run.unused)


@lru_cache(maxsize=4)
def clean(seconds: float = 10, **settings: Any) -> Flight:
    """The same without faults."""
    return fly(seconds=seconds, **settings)


def named(rule: str, answer: dict[str, Any]) -> set[int]:
    """What the answer names of what the finder of its rule finds."""
    return set(answer["lines" if rule == "CAN-004" else "frames"])


def prove(rule: str, flight: Flight, usual: int = 0) -> None:
    """Each answer is found, at most `usual` findings are about anything else, and the key says when it was."""
    answers = flight.answers(rule)
    assert answers
    assert flight.unused == ()
    found = finder(rule)(flight.log)
    wanted = [named(rule, answer) for answer in answers]
    for answer, frames in zip(answers, wanted, strict=True):
        assert any(frames & finding for finding in found), answer
        timely(flight.log, answer)
    beside = [finding for finding in found if not any(finding & frames for frames in wanted)]
    assert beside[usual:] == []


def timely(log: Log, answer: dict[str, Any]) -> None:
    """The times of an answer are those of its first and its last line."""
    rows = sorted({*answer["lines"], *(log[number].line for number in answer["frames"])})
    assert (log.lines[rows[0] - 1].t, log.lines[rows[-1] - 1].t) == (answer["t_ns"], answer["t_end_ns"])


# Ten faults in one mission: two of single frames, four of transfers, one value, two of packets, one hot ESC.
TEN = (
    "CAN-002@2.1 CAN-005@2.3:node=13 TRF-003@2.5:node=12 TRF-004@2.7:node=16 TRF-010@2.9:node=14 TRF-016@3.2:node=15 "
    "TYP-302@3.3:node=17 PUSH-005@3.5:node=11 PUSH-009@3.7:node=18 TYP-305@1.5:node=13:seconds=2"
)
FLIGHTS = {
    "hover-4.log": "--esc 4 --duration 5 --seed 4",
    "mission-8-faults.log": "--flight mission --esc 8 --duration 4.5 --seed 8 "
    + " ".join(f"--fault {fault}" for fault in TEN.split()),
    "startup.log": "--flight startup --duration 5",
    "esc-failure.mcap": "--scenario esc-failure --duration 8.5",
    "command-loss.log": "--scenario command-loss --duration 5 --esc 3",
    "bus-break.log": "--scenario bus-break --duration 6",
    "reordering.log": "--scenario reordering --duration 4",
    "duplicate-node.log": "--scenario duplicate-node --duration 3",
    "pack-sag.log": "--scenario pack-sag --duration 7 --esc 3",
    "recording-ends.log": "--scenario recording-ends --duration 5",
    "propeller-lost.log": "--scenario propeller-lost:tail=no:distract=no --duration 6 --seed 2",
    "heavy-lift.log": "--scenario heavy-lift:distract=no --duration 5 --seed 1",
    "control-lost.log": "--scenario control-lost:tail=yes:distract=no --duration 7 --rate 20 --seed 4",
    "zero-in-air.log": "--scenario zero-in-air:tail=no:distract=no --duration 6 --seed 1",
    "deaf-esc.log": "--scenario deaf-esc:tail=no:distract=no --duration 6 --seed 3",
    "swapped-esc.log": "--scenario swapped-esc:tail=no:distract=no --duration 6 --seed 1",
    "gps-restart.log": "--scenario gps-restart --duration 30 --seed 1",
    "recorder-overload.log": "--scenario recorder-overload:distract=no --duration 6 --seed 1",
    "bench.log": "--flight bench --duration 8 --rate 10",
    "power-cut.log": "--scenario power-cut:distract=no --duration 6 --seed 1",
}


def key_of(capture: Path) -> Path:
    """Where the answer key of a capture lies."""
    return capture.with_suffix(".key.json")


def make_sample(name: str, folder: Path) -> None:
    """Makes one capture and its key in `folder`. Raises `RuntimeError` with what the command says if it cannot."""
    path, said = folder / name, io.StringIO()
    with contextlib.redirect_stderr(said):
        status = main(["simulate", *shlex.split(FLIGHTS[name]), "-o", str(path), "--key", str(key_of(path))])
    if status:
        raise RuntimeError(f"{name}: {said.getvalue()}")


def unchanged(_: Sending, __: int) -> dict[str, Any]:
    return {}


@cache
def changed(change: Change = unchanged, seed: int = 1, *orders: str, bus: str = "can0") -> str:
    """A hover of 12 s as candump text.

    `change` tells of a transfer and its place among its like which fields have other values, `transfer_id` and `src`
    among them; None leaves it out.
    """
    made = flown(12, flight="hover", seed=seed, **({"orders": orders} if orders else {}))
    fresh: dict[int, tuple[int, bytes] | None] = {}
    places: dict[tuple[str, int], int] = {}
    for sending in made.sent:
        key = sending.name, sending.node
        places[key] = place = places.get(key, -1) + 1
        wanted = change(sending, place)
        if wanted is None:
            fresh |= dict.fromkeys(map(id, sending.frames))
        elif wanted:
            number = wanted.pop("transfer_id", sending.transfer_id)
            src = wanted.pop("src", sending.node)
            whole = encode.transfer(sending.name, sending.values | wanted, src, number, dst=sending.dst)
            frames = whole.frames()
            assert len(frames) == len(sending.frames)
            fresh |= {id(old): (new.id, new.data) for old, new in zip(sending.frames, frames, strict=True)}
    lines = []
    for frame in made.frames:
        new = fresh.get(id(frame), (frame.id, frame.data))
        if new is not None:
            was = frame.id, frame.data
            frame.id, frame.data = new
            lines.append(text_of(made.simulation, [frame]).replace(" can0 ", f" {bus} "))
            frame.id, frame.data = was
    return "".join(lines)
