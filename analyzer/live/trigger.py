"""The dash-cam: of all that comes, only the windows around findings are recorded."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.live import conditions, remarks
from analyzer.live.pieces import NO_TIME, Ordered
from analyzer.live.wanted import Wanted, first_met, parse_wanted

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    import numpy.typing as npt

    from analyzer._native import Piece
    from analyzer.live.wanted import Change

SECOND = 1_000_000_000
# Findings may come this much later than what they are about: rules wait for what explains it, transfers for their end.
LATE = 5 * SECOND
# Rows that are kept for windows to come at most, 138 s of a full bus of 1 Mbit/s: some 100 MB.
MOST = 1 << 20


@dataclass(frozen=True, slots=True)
class TriggerPlan:
    """What opens a window, and how much of it lies in front and behind, in nanoseconds."""

    wanted: tuple[Wanted, ...]
    pre: int = 10 * SECOND
    post: int = 5 * SECOND


def parse_trigger(
    texts: Iterable[str], pre: str | None = None, post: str | None = None, rules: Collection[str] = ()
) -> TriggerPlan | None:
    """The values of all `--trigger`, and of `--pre` and `--post`; None if there is no trigger. Raises `ValueError`.

    Triggers are `error` (or worse), `protocol:error`, `TRF-010`, `TRF`; `rules` are the rules that there are.
    """
    wanted = tuple(parse_wanted("--trigger", text, rules) for text in texts)
    given = {
        name: conditions.seconds(f"--{name}", name, value)
        for name, value in (("pre", pre), ("post", post))
        if value is not None
    }
    if given and not wanted:
        raise ValueError(f"--{next(iter(given))} is of no use without --trigger")
    return TriggerPlan(wanted, **given) if wanted else None


class Trigger:
    """Lets rows through whose time is at most `pre` before or `post` behind that of a finding.

    Times are those of the rows, so that load makes no difference; a row without one, or with an earlier one, counts as
    one with that of the row before. When the clock is set back by more than a second, what came before counts as having
    been just then. Rows go out in their order and once: windows that overlap are one, and a finding that is told late
    adds nothing in front of rows that have gone out. In front of each window stand comments that say why it is there,
    and how many frames before it were left out; behind it, one that says that a gap follows.

    On a silent bus no row ends a window: `tick` does, once `post` has passed.

    Args:
        plan: what to wait for.
        most: rows that are kept. On a bus that brings more in `pre` + `LATE` windows begin later.
    """

    def __init__(self, plan: TriggerPlan, most: int = MOST) -> None:
        self._plan, self._most = plan, most
        # Rows that have not gone out, with their times, which never fall.
        self._kept: deque[tuple[Ordered, npt.NDArray[Any]]] = deque()
        self._rows = 0
        self._last: int | None = None
        # The end of the window that is open.
        self._until: int | None = None
        self._left_out = 0
        self.windows = 0

    def feed(self, piece: Piece) -> list[Piece]:
        """Takes the next rows; gives what is to be recorded now."""
        ordered = Ordered(piece)
        while len(ordered):
            known = ordered.t != NO_TIME
            if self._last is None:
                self._last = int(ordered.t[np.argmax(known)]) if known.any() else 0
            t = np.maximum.accumulate(np.where(known, np.maximum(ordered.t, self._last), self._last))
            back = np.flatnonzero(known & (ordered.t < t - SECOND))
            end = int(back[0]) if len(back) else len(t)
            if end:
                self._keep(ordered if end == len(t) else Ordered(ordered.take(slice(0, end))), t[:end])
            if not len(back):
                break
            self._set_back(self._now - int(ordered.t[end]))
            ordered = Ordered(ordered.take(slice(end, len(t))))
        out = self._released()
        self._forget()
        return out

    def found(self, changes: Iterable[Change]) -> list[Piece]:
        """Takes findings about rows that it has had; gives what is to be recorded now."""
        out: list[Piece] = []
        for change in changes:
            finding = first_met(self._plan.wanted, [change])
            if finding is not None:
                t = self._now if finding.last.t_ns is None else finding.last.t_ns
                out += self._fire(t, f"{finding.rule} ({finding.severity}), {_utc(t)}: {finding.text}", change.fresh)
        return out

    def press(self, why: str) -> list[Piece]:
        """Somebody wants what is there now to be recorded; gives it."""
        return self._fire(self._now, f"{why}, {_utc(self._now)}", fresh=True)

    def tick(self, passed: int) -> list[Piece]:
        """So many nanoseconds have passed since rows came; gives what is to be recorded now."""
        return self._shut() if self._until is not None and self._now + passed > self._until else []

    def close(self) -> list[Piece]:
        """Nothing more will come; gives what is to be recorded of that."""
        return self._shut() if self._until is not None else []

    def _keep(self, ordered: Ordered, t: npt.NDArray[Any]) -> None:
        self._last = int(t[-1])
        self._kept.append((ordered, t))
        self._rows += len(ordered)

    def _set_back(self, by: int) -> None:
        """The clock is behind by so much."""
        self._kept = deque((ordered, t - by) for ordered, t in self._kept)
        self._until = None if self._until is None else self._until - by
        self._last = self._now - by

    @property
    def _now(self) -> int:
        return self._last or 0

    def _fire(self, t: int, why: str, fresh: bool) -> list[Piece]:
        until = t + self._plan.post
        if self._until is not None:
            self._until = max(self._until, until)
            return [remarks.comment(self._now, f"trigger, too: {why}")] if fresh else []
        self._skip(t - self._plan.pre)
        start = int(self._kept[0][1][0]) if self._kept else self._now + 1
        if start > until:  # all of it has gone out, or has been forgotten
            return [remarks.comment(self._now, f"trigger, told late: {why}")] if fresh else []
        self.windows += 1
        left, self._left_out = self._left_out, 0
        self._until = until
        text = f"trigger {self.windows}: {why}"
        return [
            remarks.comment(start, f"{left} frames before this are left out"),
            remarks.comment(start, text),
            *self._released(),
        ]

    def _released(self) -> list[Piece]:
        """Rows inside the window, and its end if a row is behind it."""
        out: list[Piece] = []
        while self._until is not None and self._kept:
            ordered, t = self._kept[0]
            inside = int(np.searchsorted(t, self._until, "right"))
            if inside:
                out.append(ordered.take(slice(0, inside)))
                self._drop(inside)
            if inside < len(t):
                out += self._shut()
        return out

    def _shut(self) -> list[Piece]:
        self._until = None
        return [remarks.comment(self._now, "the trigger's window ends, a gap follows")]

    def _skip(self, since: int) -> None:
        """Rows before a time will not be recorded."""
        while self._kept and self._kept[0][1][0] < since:
            self._leave_out(int(np.searchsorted(self._kept[0][1], since, "left")))

    def _forget(self) -> None:
        """Rows that are too old for any window, or too many."""
        self._skip(self._now - self._plan.pre - LATE)
        while self._rows > self._most:
            self._leave_out(min(self._rows - self._most, len(self._kept[0][1])))

    def _leave_out(self, count: int) -> None:
        self._left_out += int(self._kept[0][0].frame[:count].sum())
        self._drop(count)

    def _drop(self, count: int) -> None:
        """The first rows of the first piece."""
        ordered, t = self._kept.popleft()
        self._rows -= count
        if count < len(t):
            self._kept.appendleft((Ordered(ordered.take(slice(count, len(t)))), t[count:]))


def _utc(t: int) -> str:
    seconds, rest = divmod(max(t, 0), SECOND)
    return f"{time.strftime('%Y-%m-%d %H:%M:%S', time.gmtime(seconds))}.{rest // 1000:06} UTC"
