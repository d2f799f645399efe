"""The frames that a filter selects: for commands that read the captures once to find them and once to use them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.app.filtered.run_filter import RunFilter
from analyzer.decode.engine import SelectedRows
from analyzer.filter.context import all_places
from analyzer.window.first_frames import first_frames
from dissectors.kit.cells import numbers
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.app.run import Run
    from analyzer.decode.engine import Batch
    from analyzer.window.cut import FrameTables
    from dissectors.kit import Array

_NONE = np.zeros(0, np.int64)


class MatchingFrames:
    """The frames of matching transfers, and matching frames, of one capture; and the error frames that match.

    `transfers` counts the matching ones.
    """

    def __init__(self) -> None:
        self._frames, self._lines = [_NONE], [_NONE]
        self._loose, self._holds = [_NONE], [np.zeros(0, bool)]  # frames without a transfer, the last word holds
        self._bits = np.zeros(0, bool)
        self.transfers = 0

    def feed(self, batch: Batch) -> None:
        """Note the rows of a batch that are marked."""
        selected = batch.selected
        if selected is None:
            return
        row, places = all_places(batch.transfers)
        self._frames.append(places[selected.transfers[row]])
        loose = np.flatnonzero(selected.frames) + batch.first_frame
        self._loose.append(loose)
        self._holds.append(np.ones(len(loose), bool))
        if len(batch.settled):
            self._loose.append(numbers(batch.settled.column("frame")).astype(np.int64))
            self._holds.append(selected.settled)
        if len(batch.events):
            self._lines.append(numbers(batch.events.column("line")).astype(np.int64)[selected.events])

    def finish(self) -> None:
        """Take the end of the capture."""
        every, loose = np.concatenate(self._frames), np.concatenate(self._loose)
        self._bits = np.zeros(1 + max(int(some.max()) if len(some) else -1 for some in (every, loose)), bool)
        self._bits[loose] = np.concatenate(self._holds)
        self._bits[every] = True
        self._frames, self._loose, self._holds = [], [], []
        self._lines = [np.unique(np.concatenate(self._lines))]

    def hold(self, run: Run) -> None:
        """Hold what a run copies or decodes to what matches."""
        run.chosen, run.matches = self.rows, self.any

    @property
    def any(self) -> bool:
        """True if anything matches."""
        return bool(self._bits.any()) or bool(len(self._lines[0]))

    def holds(self, places: Array) -> Array:
        """Return which frames match, by their numbers from 0."""
        found = np.zeros(len(places), bool)
        known = places < len(self._bits)
        found[known] = self._bits[places[known]]
        return found

    def rows(self, part: FrameTables | Batch) -> tuple[Array, Array]:
        """Return masks of the frames and of the events of a part of the capture that match."""
        frames = self.holds(np.arange(part.first_frame, part.first_frame + len(part.frames)))
        lines = numbers(part.events.column("line")) if len(part.events) else _NONE
        return frames, np.isin(lines, self._lines[0])

    def mark(self, batches: Iterable[Batch]) -> Iterator[Batch]:
        """Yield the batches of the capture, marked; of `frames` those of transfers are marked, too."""
        for batch in batches:
            frames, events = self.rows(batch)
            settled = numbers(batch.settled.column("frame")).astype(np.int64) if len(batch.settled) else _NONE
            transfers = self.holds(first_frames(batch.transfers))
            yield replace(batch, selected=SelectedRows(transfers, frames, self.holds(settled), events))


def matching_frames(run: Run) -> MatchingFrames | None:
    """Read the captures of a run that has not been read, and return what its filter selects; None without a filter.

    Ends the run if its captures exist only once, or if somebody has ended the reading. Raises what `RunFilter` raises.
    """
    if run.request.filter is None:
        return None
    chosen = RunFilter(run)
    before = run.before()
    found = MatchingFrames()
    if before is None:
        run.require("-Y reads a capture twice here: save it to a file first")
        return found
    if chosen.judges:
        from analyzer.app.naming import named_frames  # noqa: PLC0415 - few filters ask for findings

        chosen.know(named_frames(run))
        before = run.before() or before
    chosen.only(before)
    for batch in chosen.over(before.batches()):
        found.feed(batch)
    run.go_on()
    found.finish()
    found.transfers = chosen.transfers
    if not chosen.conclude() and not found.any and not run.stopped:
        run.complain(f"{run.source.name}: nothing matches the filter")
    return found
