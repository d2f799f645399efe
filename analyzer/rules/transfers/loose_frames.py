"""Frames outside of transfers in columns: nothing is looked up but for those that are shown."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.facts.identifiers import who
from analyzer.rules.diagnosis.budgets import senders_of
from analyzer.rules.diagnosis.search import FrameLists
from analyzer.rules.frames.malformed import FrameForm
from analyzer.tables import FD, VERDICTS
from dissectors.kit import Occurrences

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from dissectors.kit import Array, Kept, Severity, Values, View

_USED, _FOREIGN = VERDICTS.index("used"), VERDICTS.index("foreign")
_BUS = 32  # bits below the bus in a session


# Of its columns.
_KINDS = (*[np.int64] * 3, np.uint32, np.uint16, *[np.uint8] * 2, *[np.int16] * 2, np.int32, object, bool)


class LooseFrames(NamedTuple):
    """Frames outside of transfers, a row each: cells as in the table of frames, senders and types.

    `session` is the bus above 32 bits of what its identifiers have in common, `tail` the last byte, `size` all bytes of
    data. `lines` are `kept` of frames that may be gone when they are needed, else they are empty.
    """

    number: Array
    session: Array
    t: Array
    id: Array
    flags: Array
    verdict: Array
    tail: Array
    size: Array
    node: Array
    code: Array
    lines: Array
    kept: Array

    @classmethod
    def none(cls) -> LooseFrames:
        """Return no frames."""
        return cls._make(np.empty(0, kind) for kind in _KINDS)

    @classmethod
    def of(cls, view: View, rows: Array, session: Array) -> LooseFrames:
        """Return rows of a batch."""
        f = view.frames
        id_, flags, verdict = f.id[rows], f.flags[rows], f.verdict[rows]
        sender = who(id_, flags, np.where(verdict == _FOREIGN, _USED, verdict))
        cells = rows + f.first, session, f.t[rows], id_, flags, verdict, f.tail[rows], f.length[rows], *sender
        return cls._of(cells)

    @classmethod
    def of_kept(cls, found: Iterable[tuple[int, int, Kept, int, int]]) -> LooseFrames:
        """Return frames of the recent past: number and session of each, node and type."""
        rows = [
            (number, session, kept.t, *kept[2:4], kept.verdict, kept.data[-1] if kept.data else 0, len(kept.data), *who)
            for number, session, kept, *who in found
        ]
        return cls._of(np.array(rows, np.int64).reshape(-1, len(cls._fields) - 2).T.copy())

    @classmethod
    def _of(cls, columns: Iterable[Array]) -> LooseFrames:
        """Return them by all columns but those of lines."""
        cells = [column.astype(kind, copy=False) for column, kind in zip(columns, _KINDS[:-2], strict=True)]
        rows = len(cells[0])
        return cls._make((*cells, np.full(rows, "", object), np.zeros(rows, bool)))

    @classmethod
    def joined(cls, parts: Sequence[LooseFrames]) -> LooseFrames:
        """Return several in the order of their numbers."""
        if not parts:
            return cls.none()
        whole = parts[0] if len(parts) == 1 else cls(*map(np.concatenate, zip(*parts, strict=True)))
        ordered = bool((whole.number[1:] >= whole.number[:-1]).all())
        return whole if ordered else whole.take(np.argsort(whole.number, kind="stable"))

    def take(self, rows: Array | slice) -> LooseFrames:
        """Return some of them."""
        return LooseFrames(*(column[rows] for column in self))

    @property
    def bus(self) -> Array:
        """Their interfaces."""
        found: Array = self.session >> _BUS
        return found

    def keep_lines(self, view: View, end: int) -> None:
        """Keep the lines of frames before one that are not kept yet: they may be gone when they are told."""
        rows = (~self.kept & (self.number < end)).nonzero()[0]
        if len(rows):
            self.lines[rows] = lines = view.each_line(self.number[rows])
            self.kept[rows] = lines.astype(bool)

    @property
    def senders(self) -> Array:
        """Senders and types, a number each."""
        return senders_of(self.bus, self.node, self.code)

    def lists(self) -> FrameLists:
        """Return a list of each one alone."""
        return FrameLists(self.number, np.arange(len(self.number) + 1), self.code, self.flags & FD != 0)

    def whose(self, k: int) -> tuple[int, int]:
        """Return the bus of one, and what the identifiers of its session have in common."""
        session = self.session.item(k)
        return session >> _BUS, session & ((1 << _BUS) - 1)

    def form(self, k: int) -> FrameForm:
        """Return what is said of one of them."""
        return FrameForm(*(column.item(k) for column in (self.id, self.flags, self.tail, self.size)))

    def breaches(
        self, rule: str, values: Callable[[int], Values], *, severity: Severity | None = None, drops: bool = False
    ) -> Occurrences:
        """Return them, whose lines are kept or not, as breaches of a rule; `values` are those of a row."""
        number, lines = self.number, self.lines
        node, code = self.node.astype(np.int64), self.code.astype(np.int64)
        return Occurrences(
            rule=rule, t=self.t, bus=self.bus, node=node, type=code, frame=number, values=values,
            frames=lambda k: (number.item(k),), key=np.zeros(len(number), np.int64), severity=severity, drops=drops,
            lines=(lambda k: (lines[k],)) if self.kept.all() else None,
        )  # fmt: skip
