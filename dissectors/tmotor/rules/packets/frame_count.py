"""PUSH-009: the frame count of packets goes on by 1 (4.4.4, 4.4.5, frame count rows).

The document does not say what shares a count: all packets of a sender, those of a unit, or those of a frame ID. Where
these readings differ, the first packets of a sender decide; until then all are kept.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

from dissectors.kit import NO_TIME, SECOND, Rule
from dissectors.records import dataclass, field, replace
from dissectors.tmotor.rules.packets.carried import carrier, occurrence, packet_tables, sender_key, unit_key
from dissectors.tmotor.rules.packets.count_steps import BY_ID, BY_UNIT, OF_UNIT, READINGS, CountSteps
from dissectors.tmotor.rules.packets.losses import Before, CaptureGaps, TransferLosses

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from dissectors.kit import Occurrence, Severity, View
    from dissectors.tmotor.rules.packets.count_steps import Hit
    from dissectors.tmotor.rules.packets.losses import KnownLosses

_DECIDES = 32  # packets, from the first in which the readings differ
_MOST_SENDERS = 4096
_MOST_HELD = 8192
_LATE = 5 * SECOND  # a broken transfer comes out 2.0 s after its start, or somewhat later
_SILENCE = 2 * SECOND
_IDS = 32
_NEAR = 8  # so far a transfer may come too late
_FEW = 3  # a longer step to transfer ID 0 is a restart


@dataclass(slots=True)
class _Sender:
    """Signs of how one sender counts: how many packets fit and break each reading, and what each would report."""

    chosen: int | None = None
    fits: list[int] = field(default_factory=lambda: [0] * len(READINGS))
    breaks: list[int] = field(default_factory=lambda: [0] * len(READINGS))
    voters: int = 0
    held: list[Mapping[int, Occurrence]] = field(default_factory=list)

    def vote(self, hit: Hit) -> None:
        """Add a packet that the readings see differently; enough of them decide."""
        for reading, step in enumerate(hit.steps):
            self.fits[reading] += step == 1
            self.breaks[reading] += step not in {None, 1}
        self.voters += 1
        if self.voters >= _DECIDES:
            self.decide()

    def decide(self) -> None:
        """Take the reading that fits most packets; in doubt that of a unit, and a common count.

        The first packet of a unit breaks no count of it and fits none: another reading is only taken if it explains
        what that of a unit does not.
        """
        better = [k for k, count in enumerate(self.breaks) if k == BY_UNIT or count < self.breaks[BY_UNIT]]
        self.chosen = max(better, key=self.fits.__getitem__)

    def settled(self) -> Iterator[Occurrence]:
        """Yield what the chosen reading reports of the packets before the choice."""
        for doubts in self.held:
            if self.chosen is not None and self.chosen in doubts:
                yield doubts[self.chosen]
        self.held = []


class _Doubt(NamedTuple):
    """A packet that breaks a count unless a loss between its transfer and the one before explains it."""

    one: Occurrence
    between: tuple[int, int]
    missing: int


class _Held(NamedTuple):
    """A hit that waits for what may explain it, by each reading; `alike` if the readings do not differ."""

    t: int
    carrier: str
    node: int
    doubts: Mapping[int, _Doubt]
    alike: bool


class FrameCounts(Rule):
    """Follows the counts of every sender."""

    rules = ("PUSH-009",)

    def __init__(self) -> None:
        """Begin with nothing seen."""
        self._losses = TransferLosses()
        self._gaps = CaptureGaps()
        self._steps = CountSteps()
        self._before = Before(unit_key), Before(sender_key)
        self._senders: dict[tuple[str, int], _Sender] = {}
        self._held: deque[_Held] = deque()

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield steps that are not 1, and that nothing explains."""
        self._losses.feed(view)
        self._gaps.feed(view)
        tables = list(packet_tables(view))
        if tables:
            chosen = {key: one.chosen for key, one in self._senders.items() if one.chosen is not None}
            hits = self._steps.feed(tables, chosen)
            past = [before.beside(view.transfers, tables) for before in self._before] if hits else []
            for hit in hits:
                self._hold(view, hit, past)
                yield from self._release(int(hit.table.t[hit.row]))
            for before in self._before:
                before.keep(view.transfers, tables)
        yield from self._release(view.end)
        self._losses.forget()

    def finish(self, _view: View) -> Iterator[Occurrence]:
        """Decide senders with few packets by what there was."""
        while self._held:
            yield from self._judge(self._held.popleft())
        for sender in self._senders.values():
            sender.decide()
            yield from sender.settled()

    def _hold(self, view: View, hit: Hit, past: list[KnownLosses]) -> None:
        """Keep a hit that may be a breach, or that helps to choose a reading."""
        name, node = carrier(hit.table), hit.key >> 8
        sender = self._senders.get((name, node))
        if sender is None:
            if len(self._senders) >= _MOST_SENDERS:
                return
            sender = self._senders.setdefault((name, node), _Sender())
        alike = hit.alike
        if sender.chosen is None and not alike:
            sender.vote(hit)
        readings = range(len(READINGS)) if sender.chosen is None else (sender.chosen,)
        if sender.chosen is None and alike and self._lost(view, hit, past[1]):
            return  # what explains it since the latest packet of all does so since an earlier one
        doubts: dict[int, _Doubt] = {}
        for reading in readings:
            doubt = self._doubt(view, hit, reading, past, next(iter(doubts.values()), None))
            if doubt is not None:
                doubts[reading] = doubt
        if doubts:
            self._held.append(_Held(hit.table.t.item(hit.row), name, node, doubts, alike))

    def _release(self, end: int) -> Iterator[Occurrence]:
        """Judge what nothing that comes out after a time can explain."""
        while self._held and (len(self._held) > _MOST_HELD or (end != NO_TIME and self._held[0].t < end - _LATE)):
            yield from self._judge(self._held.popleft())

    def _judge(self, held: _Held) -> Iterator[Occurrence]:
        sender = self._senders[held.carrier, held.node]
        found = {reading: doubt.one for reading, doubt in held.doubts.items() if not self._explained(held, doubt)}
        if sender.chosen is not None:
            yield from sender.settled()
        elif not held.alike or sender.voters:
            sender.held.append(found)
            return
        chosen = sender.chosen or BY_UNIT
        if chosen in found:
            yield found[chosen]

    def _explained(self, held: _Held, doubt: _Doubt) -> bool:
        return self._losses.explain(held.carrier, held.node, doubt.between, doubt.missing)

    def _lost(self, view: View, hit: Hit, known: KnownLosses) -> bool:
        """Return whether losses since the latest packet of its sender explain a hit that all readings see alike."""
        name, node, step = carrier(hit.table), hit.key >> 8, hit.steps[BY_UNIT]
        _, lead = known.before(known.names(name), node, hit.place)
        between = lead, view.transfers.lead.item(int(hit.table.row[hit.row]))
        return step is not None and self._losses.explain(name, node, between, (step - 1) % 256)

    def _doubt(
        self, view: View, hit: Hit, reading: int, past: list[KnownLosses], other: _Doubt | None
    ) -> _Doubt | None:
        """Return the doubt that a hit is by a reading, if any; the `other` of another reading has the same evidence."""
        table, row, step, t = hit.table, hit.row, hit.steps[reading], view.transfers
        at = int(table.row[row])
        if step in {None, 1} or _restarted(view, at) or _overtaken(view, at, step):
            return None
        if step == 0 and t.has("step")[at] and t.step[at] == 0:
            return None
        known, key = (past[0], hit.key) if reading in OF_UNIT else (past[1], hit.key >> 8)
        names = [table.name] if reading in BY_ID else known.names(carrier(table))
        before, lead = known.before(names, key, hit.place)
        between, missing = (lead, t.lead.item(at)), (step - 1) % 256
        if self._losses.explain(carrier(table), hit.key >> 8, between, missing):
            return None
        if self._gaps.between(before, hit.place >> 16):
            return None
        value = int(table["frame_count"][row])
        values = {"expected": (value - step + 1) % 256, "value": value, "scope": READINGS[reading]}
        severity: Severity | None = "note" if _silent(view, lead, int(table.t[row])) else None
        if other is None:
            one = occurrence(view, table, row, "PUSH-009", values, held=True, drops=True, severity=severity)
        else:
            one = replace(other.one, values=values, severity=severity)
        return _Doubt(one, between, missing)


def _silent(view: View, lead: int, t: int) -> bool:
    """Return whether the packet before came too long ago to say which count follows on it."""
    kept = view.frame(lead)
    return kept is None or (NO_TIME not in (kept.t, t) and t - kept.t > _SILENCE)


def _restarted(view: View, row: int) -> bool:
    """Return whether the transfer IDs of its session say that the node has restarted."""
    t = view.transfers
    return bool(t.transfer_id[row] == 0 and t.has("step")[row] and t.step[row] > _FEW)


def _overtaken(view: View, row: int, step: int) -> bool:
    """Return whether its transfer goes as far back as its count: it came behind one that was sent after it."""
    t, back = view.transfers, 256 - step
    return bool(back <= _NEAR and t.has("step")[row] and t.step[row] == _IDS - back)
