"""Frames outside of transfers in columns: nothing is looked up but for those that are shown."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.identifiers import who
from analyzer.rules.diagnosis.budgets import senders_of
from analyzer.rules.diagnosis.search import FrameLists
from analyzer.rules.frames.malformed import FrameForm
from analyzer.rules.recent import NO_FRAME, soon_gone
from analyzer.tables import FD, VERDICTS
from dissectors.kit import Occurrences

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from dissectors.kit import Array, Kept, Severity, Values, View

_USED, _FOREIGN = VERDICTS.index("used"), VERDICTS.index("foreign")
_BUS = 32  # bits below the bus in a session


_WIDE = ("number", "session", "t")
_NARROW = ("id", "flags", "verdict", "tail", "size", "node", "code", "kinds", "kept")
_PLACES = {name: (wide, place) for wide, names in ((True, _WIDE), (False, _NARROW)) for place, name in enumerate(names)}


class LooseFrames:
    """Frames outside of transfers, a row each: cells as in the table of frames, senders and types.

    `session` is the bus above 32 bits of what its identifiers have in common, `tail` the last byte, `size` all bytes of
    data. `kinds` are bits that say what is told of each. Those are `kept` (1) that waited from one batch to another:
    their lines are looked up when they are told, or before the frames are gone (2).

    Args:
        wide: the first three columns, one below the other, int64.
        narrow: the others, int32.
        lines: one for each, empty if it was not looked up; None as long as none was.
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
    kinds: Array
    kept: Array

    def __init__(self, wide: Array, narrow: Array, lines: Array | None = None) -> None:
        self.wide, self.narrow, self.lines = wide, narrow, lines

    def __getattr__(self, name: str) -> Array:
        """Return a column."""
        known = _PLACES.get(name)
        if known is None:
            raise AttributeError(name)
        wide, place = known
        found: Array = (self.wide if wide else self.narrow)[place]
        return found

    def __len__(self) -> int:
        """Return how many there are."""
        return int(self.wide.shape[1])

    @classmethod
    def none(cls) -> LooseFrames:
        """Return no frames."""
        return cls.blank(0)

    @classmethod
    def blank(cls, rows: int) -> LooseFrames:
        """Return rows without frames, of which no lines are looked up."""
        blank = cls(np.zeros((len(_WIDE), rows), np.int64), np.zeros((len(_NARROW), rows), np.int32))
        blank.number[:] = NO_FRAME
        return blank

    @classmethod
    def of(cls, view: View, rows: Array, session: Array) -> LooseFrames:
        """Return rows of a batch, of no kind."""
        f = view.frames
        id_, flags, verdict = f.id[rows], f.flags[rows], f.verdict[rows]
        sender = who(id_, flags, np.where(verdict == _FOREIGN, _USED, verdict))
        return cls._of(rows + f.first, session, f.t[rows], id_, flags, verdict, f.tail[rows], f.length[rows], *sender)

    @classmethod
    def of_kept(cls, found: Iterable[tuple[int, int, Kept, int, int]]) -> LooseFrames:
        """Return frames of the recent past: number and session of each, node and type."""
        rows = [
            (number, session, kept.t, *kept[2:4], kept.verdict, kept.data[-1] if kept.data else 0, len(kept.data), *who)
            for number, session, kept, *who in found
        ]
        return cls._of(*np.array(rows, np.int64).reshape(-1, len(_PLACES) - 2).T)

    @classmethod
    def _of(cls, *columns: Array) -> LooseFrames:
        """Return them by all columns but the last two."""
        made = cls.blank(len(columns[0]))
        for name, column in zip(_PLACES, columns, strict=False):
            getattr(made, name)[:] = column
        return made

    @classmethod
    def joined(cls, parts: Sequence[LooseFrames]) -> LooseFrames:
        """Return several in the order of their numbers."""
        parts = [one for one in parts if len(one)]
        if not parts:
            return cls.none()
        whole = parts[0] if len(parts) == 1 else cls.behind_each_other(parts)
        ordered = bool((whole.number[1:] >= whole.number[:-1]).all())
        return whole if ordered else whole.take(np.argsort(whole.number, kind="stable"))

    @classmethod
    def behind_each_other(cls, parts: Sequence[LooseFrames]) -> LooseFrames:
        """Return several in the order in which they are given."""
        lines = None
        if any(one.lines is not None for one in parts):
            lines = np.concatenate([_no_lines(len(one)) if one.lines is None else one.lines for one in parts])
        wide, narrow = [one.wide for one in parts], [one.narrow for one in parts]
        return cls(np.concatenate(wide, axis=1), np.concatenate(narrow, axis=1), lines)

    def take(self, rows: Array | slice) -> LooseFrames:
        """Return some of them: those at places, or those of a mask."""
        if isinstance(rows, slice):
            cells = self.wide[:, rows], self.narrow[:, rows]
        else:
            rows = rows.nonzero()[0] if rows.dtype == bool else rows
            cells = self.wide.take(rows, axis=1), self.narrow.take(rows, axis=1)
        return LooseFrames(*cells, None if self.lines is None else self.lines[rows])

    def put(self, rows: Array, frames: LooseFrames) -> None:
        """Put others in place of some."""
        self.wide[:, rows], self.narrow[:, rows] = frames.wide, frames.narrow
        if self.lines is None and frames.lines is not None:
            self.lines = _no_lines(len(self))
        if self.lines is not None:
            self.lines[rows] = "" if frames.lines is None else frames.lines

    def clear(self, rows: Array) -> None:
        """Leave no frames in place of some."""
        self.number[rows] = NO_FRAME
        if self.lines is not None:
            self.lines[rows] = ""

    @property
    def bus(self) -> Array:
        """Their interfaces."""
        found: Array = self.session >> _BUS
        return found

    def keep_lines(self, view: View) -> None:
        """Keep the lines of all: they are of earlier batches, and the frames may be gone when they are told."""
        kept = self.kept
        np.maximum(kept, 1, out=kept)
        old = ((self.number < soon_gone(view.frames)) & (kept == 1)).nonzero()[0]
        if len(old):
            if self.lines is None:
                self.lines = _no_lines(len(self))
            self.lines[old] = view.each_line(self.number[old])
            kept[old] = 2

    def look_up(self, view: View, rows: Array) -> list[str]:
        """Return the lines of some, empty ones of frames that are gone."""
        found = _no_lines(len(rows)) if self.lines is None else self.lines[rows]
        missing = (~found.astype(bool)).nonzero()[0]
        if len(missing):
            found[missing] = view.each_line(self.number[rows[missing]])
        lines: list[str] = found.tolist()
        return lines

    @property
    def senders(self) -> Array:
        """Senders and types, a number each."""
        return senders_of(self.bus, self.node, self.code)

    def lists(self) -> FrameLists:
        """Return a list of each one alone."""
        return FrameLists(self.number, np.arange(len(self) + 1), self.code, self.flags & FD != 0)

    def whose(self, k: int) -> tuple[int, int]:
        """Return the bus of one, and what the identifiers of its session have in common."""
        session = self.session.item(k)
        return session >> _BUS, session & ((1 << _BUS) - 1)

    def form(self, k: int) -> FrameForm:
        """Return what is said of one of them."""
        return FrameForm(*(column.item(k) for column in (self.id, self.flags, self.tail, self.size)))

    def breaches(
        self,
        view: View,
        rule: str,
        values: Callable[[int], Values],
        *,
        severity: Severity | None = None,
        drops: bool = False,
    ) -> Occurrences:
        """Return them, whose lines are kept or not, as breaches of a rule; `values` are those of a row."""
        number = self.number
        return Occurrences(
            rule=rule, t=self.t, bus=self.bus, node=self.node, type=self.code, frame=number, values=values,
            frames=lambda k: (number.item(k),), key=np.zeros(len(number), np.int64), severity=severity, drops=drops,
            lines=(lambda k: tuple(filter(None, self.look_up(view, np.array([k]))))) if self.kept.all() else None,
        )  # fmt: skip


def _no_lines(count: int) -> Array:
    return np.full(count, "", object)
