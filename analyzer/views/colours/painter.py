"""The colours of the rows of a list, batch by batch."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.decode.engine import Batch
    from analyzer.views.colours.rules import ColourRule
    from analyzer.window.listed import ListedRows
    from dissectors.kit import Array

NO_RULE = -1


class RowColours(NamedTuple):
    """The codes of picked rows: None for one that no rule is about, "" for one that is to stay as it is.

    `transfers` are in the order of the picked ones, `frames` by place, `events` by row.
    """

    transfers: list[str | None]
    frames: dict[int, str]
    events: dict[int, str]


class FrameColours(NamedTuple):
    """The rules that hold for frames, each a place in the rules or `NO_RULE`.

    `frames` are all of the batch as ones without a transfer, `settled` rows of `Batch.settled`, `events` all events;
    `members` are frames of the transfers that ended, by their `places`.
    """

    frames: Array
    settled: Array
    events: Array
    places: Array
    members: Array


class Painter:
    """Finds the first rule that holds for each row.

    Args:
        rules: at least one.
        frame_list: rows are frames, not transfers.
    """

    def __init__(self, rules: Sequence[ColourRule], *, frame_list: bool = False) -> None:
        self.codes = [rule.codes for rule in rules]
        self._matchers = [rule.filter.matcher(frame_list=frame_list) for rule in rules]

    def feed(self, batch: Batch, picked: ListedRows) -> RowColours:
        """Take the next batch, and which of its rows are listed."""
        codes, first = self.codes, batch.first_frame
        transfers, frames, events = (np.full(len(rows), NO_RULE) for rows in (picked[0], picked[1], picked[3]))
        late = np.full(len(picked.settled), NO_RULE)
        for k, matcher in enumerate(self._matchers):
            matches = matcher.feed(batch)
            if len(transfers):
                _mark(transfers, matches.transfers[picked.transfers], k)
            if len(frames):
                _mark(frames, matches.loose(picked.frames), k)
            if len(late):
                _mark(late, matches.settled[picked.settled], k)
            if len(events):
                _mark(events, matches.events[picked.events], k)
        places = (picked.frames + first).tolist()
        found = {at: codes[k] for at, k in zip(places, frames.tolist(), strict=True) if k != NO_RULE}
        if len(late):
            settled = np.asarray(batch.settled.column("frame"))[picked.settled].tolist()
            found |= {at: codes[k] for at, k in zip(settled, late.tolist(), strict=True) if k != NO_RULE}
        rows = zip(np.asarray(picked.events).tolist(), events.tolist(), strict=True)
        words: list[str | None] = [*codes, None]
        return RowColours(
            [words[k] for k in transfers.tolist()], found, {row: codes[k] for row, k in rows if k != NO_RULE}
        )

    def frames(self, batch: Batch) -> FrameColours:
        """Take the next batch of a list of frames."""
        sizes = len(batch.frames), len(batch.settled), len(batch.events)
        found = [np.full(size, NO_RULE) for size in sizes]
        places, members = np.zeros(0, np.int64), np.zeros(0, np.int64)
        for k, matcher in enumerate(self._matchers):
            matches = matcher.feed(batch)
            for rows, holds in zip(found, (matches.frames, matches.settled, matches.events), strict=True):
                _mark(rows, holds, k)
            places, holds = matches.members
            members = np.full(len(places), NO_RULE) if k == 0 else members
            _mark(members, holds, k)
        return FrameColours(found[0], found[1], found[2], places, members)


def _mark(found: Array, holds: Array, rule: int) -> None:
    found[(found == NO_RULE) & holds] = rule
