"""One flight as a case: its events, its commands, and whether these were calm."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.pulse import STEP
from analyzer.flight.thresholds import lasting, threshold
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.flight.flights import Flight
    from analyzer.flight.log import FlightEvent
    from analyzer.flight.silences import SenderPace
    from analyzer.flight.supply.extents import EscExtent
    from analyzer.flight.witness import Witness

_START, _STOP = itemgetter(0), itemgetter(1)
_NEARLY_ALL = 98  # percent
_MOSTLY = 0.9
_PAUSES = 5  # of reports in the mean, after which somebody is gone
_SILENT = frozenset({"silence", "commands stop"})
_COMPARED = frozenset({"rpm", "voltage", "current"})
_ANEW = frozenset({"restart", "power-up"})
Node = tuple[int, int]  # bus, node
ROLES = (
    ("ArmingStatus", "autopilot"),
    ("Fix", "GPS"), ("MagneticFieldStrength", "compass"), ("BatteryInfo", "power module"),
    ("CircuitStatus", "power module"), ("StaticPressure", "barometer"), ("TrueAirspeed", "airspeed"),
    ("IndicatedAirspeed", "airspeed"), ("Measurement", "range finder"), ("IceReciprocatingStatus", "engine"),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Excursion:
    """Commands that went apart: calm until `start`, not any more at `stop`; `most` is how far they went, in %.

    `again` is when they were calm again for long enough, None if they never were.
    """

    start: int
    stop: int
    most: float
    again: int | None
    event: FlightEvent


class FlightCase:
    """The knowledge of one flight. All times are recorded ones, in nanoseconds.

    Args:
        witness: after the last batch.
        events: of the whole capture.
        flight: the flight, and
        border: where the next one begins, or the recording ends.
    """

    def __init__(self, witness: Witness, events: Iterable[FlightEvent], flight: Flight, border: int) -> None:
        self.flight, self.pulse, self.losses, self.clock = flight, witness.pulse, witness.losses, witness.clock
        self._learned = witness.learned
        self.supply, self.setups = witness.supply, witness.setups
        self.start, self.stop, self.border = flight.first.ran, flight.last.ran, border
        self.events = [one for one in events if self.start <= one.first.ran <= border]
        self.before = [one for one in events if one.first.ran < self.start]
        alive = self.start - lasting("lost")  # who falls silent just then flew, too
        telling = [one for one in witness.escs if one.last >= alive and one.first <= border]
        self.escs: list[EscExtent] = telling
        self.earlier_escs: list[EscExtent] = [one for one in witness.escs if one.last < alive]
        self.paces: list[SenderPace] = [one for one in witness.paces if one.last >= self.start and one.first <= border]
        self._senders = {(one.bus, one.node) for one in self.paces}
        self.commanders = {(one.bus, one.node) for one in self.paces if one.type in witness.command_types}
        self._usual: dict[tuple[int | None, int | None, str], int] = {}
        for one in self.paces:
            of = one.bus, one.node, one.type
            self._usual[of] = max(one.usual, self._usual.get(of, 0))
        self.esc_nodes: set[Node] = {(one.bus, one.node) for one in telling}
        self.escs_by_channel = {one.ch for one in telling if one.ch is not None}
        self.calm_limit = self._usual_spread()
        self.one_by_one = self._one_by_one()
        self.swings = [] if self.one_by_one else self._swings()
        self.excursion = self.swings[-1] if self.swings and self.swings[-1].again is None else None
        self.joint = self._joint_losses()

    @property
    def tips(self) -> bool:
        """True if control was lost as soon as the motors turned: no motor has shown what it does at a command."""
        lost = self.excursion
        return lost is not None and lost.start - self.start <= lasting("tip") and self.takes_off

    @property
    def takes_off(self) -> bool:
        """True if the recording shows motors that do not turn yet, of half of the ESCs at least."""
        still = {(one.bus, one.node) for one in self.escs if one.first < self.start}
        return 2 * len(still) >= len(self.esc_nodes)

    def unlearned(self, at: int) -> list[Node]:
        """Return the ESCs that could be held against their past, and had none by some time, or one that was wrong.

        A past is wrong that says of a motor that flies that it is off.
        """
        told = {(one.bus, one.node) for one in self.escs if set(one.ranges) >= _COMPARED}
        off = {
            (one.bus, one.node) for one in self.events
            if one.kind == "motor" and one.first.ran < at and (one.after is None or one.after.ran > at)
        }  # fmt: skip
        return sorted(node for node in told if node in off or (since := self._learned(*node)) is None or since > at)

    @property
    def standing(self) -> list[FlightEvent]:
        """The events from before the flight that went on in it."""
        return [one for one in self.before if one.after is None or one.after.ran > self.start]

    @property
    def measured(self) -> bool:
        """True if every ESC tells what its motor is held against its past by."""
        return all(set(one.ranges) >= _COMPARED for one in self.escs)

    @property
    def unheard(self) -> list[int]:
        """The channels that are commanded, and that nobody reports as; who has no number may be any of them."""
        silent = sorted(self.pulse.driven(self.start) - self.escs_by_channel)
        nameless = {(one.bus, one.node) for one in self.escs if one.ch is None}
        return silent if len(silent) > len(nameless) else []

    def gone(self, at: int) -> list[Node]:
        """Return the ESCs that report nothing any more behind a time, though others do, however unevenly they did."""
        last: dict[Node, int] = {}
        pause: dict[Node, int] = {}
        for one in self.escs:
            node = one.bus, one.node
            last[node] = max(one.last, last.get(node, one.last))
            mean = (one.last - one.first) // max(one.count - 1, 1)
            pause[node] = min(mean, pause.get(node, mean))
        end = max(last.values(), default=0)
        return sorted(
            node for node, ran in last.items()
            if ran <= at + pause[node] and end - ran > max(_PAUSES * pause[node], lasting("lost"))
        )  # fmt: skip

    def obeyed(self) -> list[str]:
        """Return that every ESC did as it was commanded, if all that are commanded report, and none says otherwise."""
        return [] if self.unheard or not self.esc_nodes else ["every ESC obeyed"]

    def volts(self) -> tuple[float, float]:
        """Return the lowest and the highest voltage that ESCs report, NaN if none does."""
        ranges = [one.ranges["voltage"] for one in self.escs if "voltage" in one.ranges]
        return (min(low for low, _ in ranges), max(high for _, high in ranges)) if ranges else (np.nan, np.nan)

    def esc_of(self, ch: int) -> EscExtent | None:
        """Return who reports as a channel, None if nobody does, or several."""
        found = [one for one in self.escs if one.ch == ch]
        return found[0] if len({(one.bus, one.node) for one in found}) == 1 else None

    def name(self, node: Node) -> str:
        """Return what people call an ESC: its channel, if it has one alone."""
        chs = {one.ch for one in self.escs if (one.bus, one.node) == node and one.ch is not None}
        return f"ch{chs.pop()}" if len(chs) == 1 else f"node {node[1]}"

    @property
    def commanded(self) -> bool:
        """True if commands are recorded in the flight."""
        return self.pulse.count(self.start, self.stop) > 0

    def bitless(self) -> list[int | None]:
        """Return the channels of ESCs that tell no mode and no fault bit, None for one that has no channel."""
        telling = {(one.bus, one.node) for one in self.escs if one.modes}
        return sorted({one.ch for one in self.escs if (one.bus, one.node) not in telling}, key=lambda ch: ch or 0)

    def changed(self) -> list[str]:
        """Return which motors turn the other way than in the flight before."""
        if self.flight.number < 2:
            return []
        found = {}
        for one in self.escs:
            before, now = one.forwards(self.start - 1), one.forwards(self.stop)
            if one.ch is not None and None not in {before, now} and before != now:
                found[one.ch] = now
        since = f"changed since flight {self.flight.number - 1}"
        return [
            f"{since}: ch{ch} turns {'forwards' if way else 'backwards'}, the other way than then"
            for ch, way in sorted(found.items())
        ]

    def turning(self) -> list[str]:
        """Return that the motors do not turn half one way and half the other, if that is so."""
        told = {one.ch: one.forwards(self.stop) for one in self.escs if one.ch is not None}
        ways = {ch: way for ch, way in told.items() if way is not None}
        count, forwards = len(ways), sum(ways.values())
        if count % 2 or forwards in {0, count // 2, count}:
            return []
        return [f"{forwards} of {count} motors turn forwards: not half of them"]

    def role(self, bus: int | None, node: int | None) -> str:
        """Return what a node is by what it sends, in brackets; empty if that says nothing."""
        sends = {one.type.rpartition(".")[2] for one in self.paces if (one.bus, one.node) == (bus, node)}
        roles = [role for word, role in ROLES if any(name.startswith(word) for name in sends)]
        if (bus, node) in self.commanders:
            roles.insert(0, "autopilot")
        return f" ({', '.join(dict.fromkeys(roles))})" if roles else ""

    def period(self, bus: int | None, node: int | None) -> int:
        """Return the shortest period in which a node reports, 0 if it does not."""
        return min((one.usual for one in self.paces if (one.bus, one.node) == (bus, node) and one.usual), default=0)

    def unrest(self, at: int) -> tuple[int, float] | None:
        """Return since when commands were apart at a time, and how far (%); None if they were calm."""
        since = self._onset(at)
        spread = self.pulse.spread(since, at)
        if at - since < lasting("unrest") or not len(spread):
            return None
        return since, float(spread.max())

    def others_lost(self, node: Node, event: FlightEvent) -> bool:
        """Return whether IDs of other nodes are missing where one is silent."""
        low, high = self.span(event)[0], (event.after or event.first).ran
        return self.losses.missing(low, high, self._senders - {node}) > 0

    def in_joint_loss(self, event: FlightEvent) -> bool:
        """Return whether an event lies in a time in which the recorder lost frames of everybody.

        Who is silent for longer than everybody is so outside of it, too; and what goes on behind it is no less true for
        having begun in it. So is it that a device started anew, whoever missed the moment.
        """
        low, high = self.span(event)
        until = self.border if event.after is None else event.after.ran
        if event.kind in _ANEW:
            return False
        if event.kind not in _SILENT:
            inside = self._joint_near(low, high)
            return bool(inside) and until <= inside[-1][1] + lasting("motor_window")
        joint = sum(max(0, min(until, stop) - max(low, start)) for start, stop in self._joint_near(low, until))
        usual = self._usual.get((event.bus, event.node, event.type), 0)
        return joint > 0 and until - low - joint <= max(2 * usual, lasting("hole"))

    def in_hole(self, at: int) -> bool:
        """Return whether the recorder lost frames of everybody then."""
        return bool(self._joint_near(at - 3 * STEP, at + 3 * STEP))

    def _joint_near(self, low: int, high: int) -> Sequence[tuple[int, int]]:
        """Return those of `joint` that touch a time."""
        return self.joint[bisect_left(self.joint, low, key=_STOP) : bisect_right(self.joint, high, key=_START)]

    @staticmethod
    def span(event: FlightEvent) -> tuple[int, int]:
        """Return the time in which an event happened."""
        return (event.first if event.before is None else event.before).ran, event.first.ran

    def lasts(self, event: FlightEvent) -> bool:
        """Return whether it goes on to the end of the flight, or nearly so."""
        return event.after is None or event.after.ran > self.stop - lasting("harmless")

    def _one_by_one(self) -> bool:
        """Return whether motors are tried in turn: wherever commands are apart, one alone is above all others."""
        level = self.pulse.level(self.start, self.stop, threshold("spread_percent") / threshold("calm_share"))
        alone = level <= threshold("alone") / max(self.pulse.channels, 1)
        return self.pulse.channels > 2 and len(level) * STEP >= lasting("turning") and float(alone.mean()) >= _MOSTLY

    def _usual_spread(self) -> float:
        """Return how far apart commands may be, in %: somewhat more than nearly all of the first half of the flight."""
        begin = self.start + lasting("take_off")
        spread = self.pulse.spread(begin, max(begin + lasting("take_off"), (self.start + self.stop) // 2))
        usual = float(np.percentile(spread, _NEARLY_ALL)) if len(spread) else 0.0
        most = threshold("spread_percent") / threshold("calm_share")
        return min(max(threshold("calm_percent"), threshold("calm_factor") * usual), most)

    def _swings(self) -> list[Excursion]:
        """Return the times that commands went apart; the last one may never have calmed down."""
        found: list[Excursion] = []
        for one in (*self.standing, *self.events):
            if one.kind != "spread" or (found and (found[-1].again is None or one.first.ran <= found[-1].again)):
                continue
            start = self._onset(one.first.ran)
            found.append(
                Excursion(start, start + STEP, one.values.get("spread", 0.0), self._calm_again(one.first.ran), one)
            )
        return found

    def _onset(self, at: int) -> int:
        """Return until when commands were calm before a time: where the first step begins in which they were not."""
        step = at
        while step > self.start:
            spread = self.pulse.spread(step - STEP, step)
            if len(spread) and float(spread.max()) <= self.calm_limit:
                return step
            step -= STEP
        return self.start

    def _calm_again(self, at: int) -> int | None:
        """Return when commands were calm for long, after a time."""
        need, step = lasting("calm_again"), at
        while step + need <= self.stop:
            above = self.pulse.last_above(self.calm_limit, step, step + need)
            if above is None:
                off = self.pulse.mean(step, step + need).min(initial=100) <= threshold("command_idle_percent")
                return None if off else step  # nobody steers who commands nothing
            step = above + STEP
        return None

    def _joint_losses(self) -> list[tuple[int, int]]:
        """Return the times in which several senders were silent together though they sent: the recorder's losses."""
        silent = [
            one for one in self.events
            if one.kind in _SILENT and one.values.get("missing", 0) > 0 and one.before is not None
        ]  # fmt: skip
        errors = [one.first.ran for one in self.events if one.kind == "errors"]
        found = [
            (one.before.ran, one.first.ran) for one in self.events
            if one.kind == "gap" and one.before
            and not any(0 <= one.first.ran - t <= lasting("follows") for t in errors)
        ]  # fmt: skip
        spans = [
            (one.before.ran, self.border if one.after is None else one.after.ran, (one.bus, one.node))
            for one in silent
            if one.before is not None and one.bus is not None and one.node is not None
        ]  # fmt: skip
        borders = np.array([span[:2] for span in spans], np.int64).reshape(-1, 2)
        for low in dict.fromkeys(borders[:, 0].tolist()):
            at_once = [spans[k][1:] for k in np.flatnonzero((borders[:, 0] <= low) & (low < borders[:, 1])).tolist()]
            if len({node for _, node in at_once}) >= threshold("joint_senders"):
                found.append((low, _until(at_once)))
        return _merged(found)


def _until(several: Sequence[tuple[int, Node]]) -> int:
    """Return how long senders are silent together: until the first of those that matter is heard again."""
    last: dict[Node, int] = {}
    for stop, node in several:
        last[node] = max(stop, last.get(node, stop))
    return sorted(last.values(), reverse=True)[int(threshold("joint_senders")) - 1]


def _merged(spans: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return times in order, of which those that overlap have become one."""
    found: list[tuple[int, int]] = []
    for low, high in sorted(spans):
        if found and low <= found[-1][1]:
            found[-1] = found[-1][0], max(high, found[-1][1])
        else:
            found.append((low, high))
    return found
