"""Frames that form no transfer: as entries of a list, each at its place; foreign ones are summed by identifier."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.facts.identifiers import NOBODY, who
from analyzer.facts.names import type_name
from analyzer.tables import EXTENDED, KINDS, REMOTE, TAIL_ID, VERDICTS, counted
from analyzer.views.marks import ListMark
from analyzer.views.named import rules_of, tag
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.decode.engine import Batch
    from analyzer.filter.memory import NamesFrames
    from analyzer.views.frames.window import FrameWindow, RawFrame
    from analyzer.window.listed import ListedRows
    from analyzer.window.numbering import Numbering
    from dissectors import Registry
    from dissectors.kit import Array

_USED, _FOREIGN, _NO_TAIL = (VERDICTS.index(name) for name in ("used", "foreign", "no tail"))
_REQUEST = KINDS.index("request")
_WHY = {
    "no tail": "no data, no tail byte",
    "orphan": "no start of its transfer",
    "wrong toggle": "of a transfer that starts with toggle 1",
    "wrong transfer id": "transfer ID is not under way",
    "anonymous multi": "anonymous, but not a single frame",
    "duplicate": "copy of the frame before",
    "foreign": "not DroneCAN",
}
_SUMS_SHOWN = 20
_MOST_IDS = 4096


class _Sum:
    """Foreign frames of one identifier: how many, and the first of them."""

    def __init__(self, place: int, frame: RawFrame) -> None:
        self.count, self.place, self.frame = 0, place, frame


class LooseRows:
    """Gives the frames of one batch after another that form no transfer.

    Args:
        registry: the types.
        frames: keeps the frames; it has to be fed first.
        numbering: of frames.
        foreign: give each frame that is not DroneCAN, rather than sums of them.
        named: the rules that name frames.
    """

    def __init__(
        self,
        registry: Registry,
        frames: FrameWindow,
        numbering: Numbering,
        *,
        foreign: bool = False,
        named: NamesFrames | None = None,
    ) -> None:
        self._registry, self._frames, self._numbering = registry, frames, numbering
        self._foreign, self._named = foreign, named
        self._sums: dict[int, _Sum] = {}
        self._beyond = 0

    def feed(self, batch: Batch, picked: ListedRows) -> Iterator[ListMark]:
        """Yield an entry for each picked frame without a transfer."""
        late = (numbers(batch.settled.column(name))[picked.settled].tolist() for name in ("frame", "verdict"))
        for place, verdict in zip(*late, strict=True):
            yield from self._settled(place, verdict)
        if not len(picked.frames):
            return
        rows, verdicts = np.asarray(picked.frames), numbers(batch.frames.column("verdict"))[picked.frames]
        foreign = verdicts == _FOREIGN
        if foreign.any() and not self._foreign:
            self._add(batch, rows[foreign])
            rows, verdicts = rows[~foreign], verdicts[~foreign]
        ids, flags = (numbers(batch.frames.column(name))[rows] for name in ("id", "flags"))
        named = who(ids, flags, verdicts)
        for row, verdict, *whose in zip(*(some.tolist() for some in (rows, verdicts, *named)), strict=True):
            frame = self._frames(batch.first_frame + row)
            if frame is not None:
                yield self._lone(batch.first_frame + row, frame, verdict, *whose)

    def sums(self) -> Iterator[ListMark]:
        """Yield an entry for each identifier of foreign frames, the most frequent first."""
        sums = sorted(self._sums.values(), key=lambda one: (-one.count, one.place))
        for one in sums[:_SUMS_SHOWN]:
            often = f"{one.count:,} frame{'s' * (one.count != 1)}"
            text = f"{often}  {one.frame.candump if one.count == 1 else one.frame.id_text}"
            yield self._mark(one.place, one.frame, "foreign", text, sign="~")
        rest = sum(one.count for one in sums[_SUMS_SHOWN:]) + self._beyond
        if rest:
            text = f"{rest:,} frame{'s' * (rest != 1)} of other identifiers"
            yield ListMark(sums[0].place, None, None, "foreign", text, sign="~")

    def _settled(self, place: int, verdict: int) -> Iterator[ListMark]:
        """Take a late verdict: what was foreign until now is not, or the other way round."""
        frame = self._frames(place)
        if frame is None:
            return
        key = _key(frame.id, frame.flags)
        if verdict == _FOREIGN and not self._foreign:
            self._count(key, 1, place)
        elif key in self._sums:
            self._count(key, -1, place)
        if verdict != _USED and (verdict != _FOREIGN or self._foreign):
            whose = who(*(np.array([one]) for one in (frame.id, frame.flags, verdict)))
            yield self._lone(place, frame, verdict, *(int(one[0]) for one in whose))

    def _lone(self, place: int, frame: RawFrame, verdict: int, node: int, code: int) -> ListMark:
        name = VERDICTS[verdict]
        why = "remote frame" if verdict == _NO_TAIL and frame.flags & REMOTE else _WHY[name]
        text = f"{tag(rules_of(self._named, [[place]])[0])}{why}  {frame.candump}"
        if verdict == _FOREIGN:
            return self._mark(place, frame, name, text, sign=" ")
        if code == NOBODY:
            return self._mark(place, frame, name, text, sign="x")
        kind, type_id = code >> 16, code & 0xFFFF
        message = self._registry.message(kind, type_id, 0)
        dst = str(frame.id >> 8 & 0x7F) if kind >= _REQUEST else "*"
        tail = frame.data[-1] & TAIL_ID if frame.data and not frame.flags & REMOTE else None
        mark = self._mark(place, frame, type_name(message, kind, type_id), text, sign="x")
        return mark._replace(src=str(max(node, 0)), dst=dst, transfer_id=tail)

    def _mark(self, place: int, frame: RawFrame, kind: str, text: str, sign: str) -> ListMark:
        return ListMark(place, frame.t, frame.bus, kind, text, self._numbering.of(place), sign=sign)

    def _add(self, batch: Batch, rows: Array) -> None:
        frames = batch.frames
        keys = _key(numbers(frames.column("id"))[rows].astype(np.int64), numbers(frames.column("flags"))[rows])
        for key, count in zip(*counted(keys), strict=True):
            place = -1 if key in self._sums else batch.first_frame + int(rows[np.argmax(keys == key)])
            self._count(key, count, place)

    def _count(self, key: int, by: int, place: int) -> None:
        """Add frames of an identifier, the first of which is at a place."""
        if key not in self._sums:
            frame = self._frames(place)
            if len(self._sums) >= _MOST_IDS or frame is None:
                self._beyond += by
                return
            self._sums[key] = _Sum(place, frame)
        self._sums[key].count += by
        if self._sums[key].count <= 0:
            del self._sums[key]


def _key(identifier: Any, flags: Any) -> Any:
    return identifier << 1 | (flags & EXTENDED != 0)
