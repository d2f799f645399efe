"""Triggers: of all that comes, only the windows around findings are recorded."""

from __future__ import annotations

import time
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from analyzer.live import conditions, remarks
from analyzer.live.frame_batches import NO_CLOCK, OrderedRows
from analyzer.live.patterns import FindingPattern, first_match, parse_pattern
from analyzer.live.recording.axis import Axis
from dissectors.records import dataclass
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from analyzer._native import FrameBatch
    from analyzer.report.newest import Change
    from dissectors.kit import Array

# Rows and bytes that are kept for windows to come at most, 138 s of a full bus of 1 Mbit/s.
MOST, MOST_BYTES = 1 << 20, 128 << 20
# Bytes of a row beside its data, and of each piece that rows come in.
_ROW, _PIECE = 72, 3000


@dataclass(frozen=True, slots=True)
class TriggerPlan:
    """The findings that open a window, and how much of it lies in front and behind, in nanoseconds."""

    wanted: tuple[FindingPattern, ...]
    pre: int = 10 * SECOND
    post: int = 5 * SECOND


def parse_trigger(
    texts: Iterable[str], pre: str | None = None, post: str | None = None, rules: Collection[str] = ()
) -> TriggerPlan | None:
    """Read all `--trigger`, `--pre` and `--post`; None if there is no trigger. Raises `ValueError`.

    Triggers are `error` (or worse), `protocol:error`, `TRF-010`, `TRF`; `rules` are the rules that there are.
    """
    wanted = tuple(parse_pattern("--trigger", text, rules) for text in texts)
    given = {
        name: conditions.parse_seconds(f"--{name}", name, value)
        for name, value in (("pre", pre), ("post", post))
        if value is not None
    }
    if given and not wanted:
        raise ValueError(f"--{next(iter(given))} is of no use without --trigger")
    return TriggerPlan(wanted, **given) if wanted else None


@dataclass(frozen=True, slots=True)
class _Kept:
    """Rows that have not gone out, where they are on the axis, and what is in front of them.

    `before` is the time that the row in front says, `frames` are those of the capture so far, `weight` the bytes a row.
    """

    ordered: OrderedRows
    come: Array
    since: Array
    before: int
    frames: int
    weight: int

    @property
    def first(self) -> int:
        """The time that the first row says, or the one in front of it."""
        return self._said(slice(0, 1))

    @property
    def last(self) -> int:
        """The time that the last one says."""
        return self._said(slice(None))

    def behind(self, count: int) -> _Kept:
        """Return what is left behind so many rows."""
        rows = slice(count, len(self.ordered))
        return _Kept(
            OrderedRows(self.ordered.take(rows)), self.come[rows], self.since[rows], self._said(slice(0, count)),
            self.frames + int(self.ordered.frame[:count].sum()), self.weight,
        )  # fmt: skip

    def place(self, number: int) -> int | None:
        """Return where the frame with this number, from 1, is on the axis; None if it is not among them."""
        wanted = number - self.frames
        if not 0 < wanted <= int(self.ordered.frame.sum()):
            return None
        return int(self.come[self.ordered.behind_frame(wanted) - 1])

    def _said(self, rows: slice) -> int:
        said = self.ordered.t[rows][self.ordered.clocks()[rows] != NO_CLOCK]
        return int(said[-1]) if len(said) else self.before


class Trigger:
    """Lets rows through from `pre` before the frames of a finding until `post` behind them.

    Times are those of the rows on one `Axis`, so that neither load makes a difference nor clocks that are set, or not
    the same. However late a finding is told, rows are there as long as the limits allow; what they do not is said. Rows
    go out in their order and once: windows that overlap are one, and a finding that is told late adds nothing in front
    of rows that have gone out. In front of each window stand comments that say why it is there, and how many frames
    before it were left out; behind it, one that says that a gap follows.

    On a silent bus no row ends a window: `tick` does, once `post` has passed.

    Args:
        plan: what to wait for.
        most: rows that are kept.
        most_bytes: bytes that they may take.
    """

    def __init__(self, plan: TriggerPlan, most: int = MOST, most_bytes: int = MOST_BYTES) -> None:
        self._plan, self._most, self._most_bytes = plan, most, most_bytes
        self._kept: deque[_Kept] = deque()
        self._rows = self._bytes = self._frames = 0
        # Where on the axis the last row was that had to be forgotten.
        self._forgotten: int | None = None
        self._notes: list[str] = []
        self._axis = Axis()
        # The time of the last row, as it says.
        self._said = 0
        # The end of the window that is open, on the axis.
        self._until: int | None = None
        self._left_out = 0
        self.windows = 0

    def feed(self, batch: FrameBatch) -> list[FrameBatch]:
        """Take the next rows; return what is to be recorded now."""
        ordered = OrderedRows(batch)
        if len(ordered):
            weight = _ROW + (_PIECE + ordered.size) // len(ordered)
            kept = _Kept(ordered, *self._axis.place(ordered), self._said, self._frames, weight)
            self._kept.append(kept)
            self._rows += len(ordered)
            self._bytes += len(ordered) * weight
            self._frames += int(ordered.frame.sum())
            self._said = kept.last
        out = self._released()
        self._forget()
        return out

    def take_findings(self, changes: Iterable[Change]) -> list[FrameBatch]:
        """Take findings about rows that it has had; return what is to be recorded now.

        Of those that come together the first in time opens its window first, whatever their order.
        """
        found: list[tuple[tuple[int, int], str, bool]] = []
        for change in changes:
            finding = first_match(self._plan.wanted, [change])
            if finding is not None:
                t = self._said if finding.last.t_ns is None else finding.last.t_ns
                at = self._axis.now if finding.last.t_ns is None else self._axis.locate(finding.bus, t)
                why = f"{finding.rule} ({finding.severity}), {_utc(t)}: {finding.text}"
                found.append(((self._first(change, at), at), why, change.fresh))
        found.sort(key=lambda one: one[0])
        return [part for one in found for part in self._fire(*one)]

    def notes(self) -> list[str]:
        """Return the lines that are new for people."""
        notes, self._notes = self._notes, []
        return notes

    def record_now(self, why: str) -> list[FrameBatch]:
        """Open a window, as somebody wants what is there now; return what is to be recorded."""
        return self._fire((self._axis.now, self._axis.now), f"{why}, {_utc(self._said)}", fresh=True)

    def tick(self, passed: int) -> list[FrameBatch]:
        """Note that so many ns have passed since rows of a bus came; return what is to be recorded now."""
        return self._shut() if self._until is not None and self._axis.now + passed > self._until else []

    def finish(self) -> list[FrameBatch]:
        """End: nothing more will come. Return what is to be recorded of that."""
        return self._shut() if self._until is not None else []

    def _first(self, change: Change, at: int) -> int:
        """Return where the first of the frames is that a change is about; `at` is the last one."""
        finding = change.finding
        places = [at] if change.since is None else [at, self._axis.locate(finding.bus, change.since)]
        if change.fresh and finding.frames:
            number = min(finding.frames)
            kept = next((one for one in reversed(self._kept) if one.frames < number), None)
            place = None if kept is None else kept.place(number)
            places += [] if place is None else [place]
        return min(places)

    def _fire(self, span: tuple[int, int], why: str, fresh: bool) -> list[FrameBatch]:
        start, until = span[0] - self._plan.pre, span[1] + self._plan.post
        if self._until is not None:
            self._until = max(self._until, until)
            return [remarks.make_comment(self._said, f"trigger, too: {why}")] if fresh else []
        self._skip(start)
        lost = self._missing(start, until)
        if (self._kept[0].since[0] if self._kept else self._axis.now + 1) > until:
            # All of it has gone out, or has been forgotten.
            return [remarks.make_comment(self._said, f"trigger, told late{lost}: {why}")] if fresh else []
        t = self._kept[0].first if self._kept else self._said
        self.windows += 1
        left, self._left_out = self._left_out, 0
        self._until = until
        if lost:
            self._notes.append(f"trigger {self.windows}{lost}")
        return [
            remarks.make_comment(t, f"{left} frames before this are left out"),
            remarks.make_comment(t, f"trigger {self.windows}{lost}: {why}"),
            *self._released(),
        ]

    def _released(self) -> list[FrameBatch]:
        """Return the rows inside the window, and its end if a row is behind it."""
        out: list[FrameBatch] = []
        while self._until is not None and self._kept:
            kept = self._kept[0]
            inside = int(np.searchsorted(kept.since, self._until, "right"))
            if inside:
                out.append(kept.ordered.take(slice(0, inside)))
                self._drop(inside)
            if inside < len(kept.since):
                out += self._shut()
        return out

    def _shut(self) -> list[FrameBatch]:
        self._until = None
        return [remarks.make_comment(self._said, "the trigger's window ends, a gap follows")]

    def _skip(self, since: int) -> None:
        """Forget rows before a time, which will not be recorded."""
        while self._kept and self._kept[0].come[0] < since:
            self._leave_out(int(np.searchsorted(self._kept[0].come, since, "left")))

    def _missing(self, start: int, until: int) -> str:
        """Say how much of a window is forgotten; nothing if all of it is there."""
        if self._forgotten is None or self._forgotten < start:
            return ""
        if self._forgotten >= until:
            return ", its frames are no longer held"
        return f", its first {(self._forgotten - start) / SECOND:.3g} s are no longer held"

    def _forget(self) -> None:
        """Forget the oldest rows while there are too many."""
        while self._rows > self._most or (self._bytes > self._most_bytes and self._rows > 1):
            kept = self._kept[0]
            excess = max(self._rows - self._most, -(-(self._bytes - self._most_bytes) // kept.weight))
            count = min(excess, len(kept.come))
            self._forgotten = int(kept.come[count - 1])
            self._leave_out(count)

    def _leave_out(self, count: int) -> None:
        self._left_out += int(self._kept[0].ordered.frame[:count].sum())
        self._drop(count)

    def _drop(self, count: int) -> None:
        """Drop the first rows of the first batch."""
        kept = self._kept.popleft()
        self._rows -= count
        self._bytes -= count * kept.weight
        if count < len(kept.ordered):
            self._kept.appendleft(kept.behind(count))


def _utc(t: int) -> str:
    seconds, rest = divmod(max(t, 0), SECOND)
    return f"{time.strftime('%Y-%m-%d %H:%M:%S', time.gmtime(seconds))}.{rest // 1000:06} UTC"
