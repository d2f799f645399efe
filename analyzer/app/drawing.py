"""One capture on its way into a recording: read once, judged as `check` does, drawn batch by batch."""

from __future__ import annotations

from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.app.criteria import Criteria
from analyzer.app.filtered.frames import matching_frames
from analyzer.app.judged import JudgedRun
from analyzer.app.marks import EventMarks
from analyzer.app.request import short_names
from analyzer.facts.traffic import ForeignIds
from analyzer.plot import MOST_POINTS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from rerun.chunk import Chunk

    from analyzer.app.request import Request
    from analyzer.app.run import Run
    from analyzer.decode.engine import Batch
    from analyzer.plot.picture import Picture
    from analyzer.rules.checking import Measured

    Over = Callable[[Iterable[Measured]], Iterable[Measured]]


class Drawing:
    """One capture on its way into a recording. Raises `ValueError` for criteria that make no sense.

    Args:
        run: not read yet.
        most_points: of each line, 0 for all; if not given `MOST_POINTS`, and all of what comes live.
    """

    def __init__(self, run: Run, most_points: int | None = None) -> None:
        self._run = run
        default = 0 if run.source.live else MOST_POINTS
        self._most_points = (default if most_points is None else most_points) or None
        self._criteria = Criteria(run.request.rules, run.registry)
        self._judged = JudgedRun(run, self._criteria, foreign=ForeignIds())
        self._marks = EventMarks(run.registry)
        self._shown = 0
        self._batches: Iterator[Measured] = iter(())
        self._chosen = matching_frames(run)
        if self._chosen is not None:
            self._chosen.hold(run)

    def start(self) -> None:
        """Begin to read: what is made ready until `draw` takes no time of its own."""
        batches = self._judged.batches(self._run.batches())
        self._batches = chain(list(islice(batches, 1)), batches)

    def draw(self, send: Callable[[Sequence[Chunk]], None], over: Over = iter) -> Picture:
        """Draw all batches through `send`, as `over` lets them pass. Ends the run when there is no use in going on."""
        from analyzer.plot.picture import Picture  # noqa: PLC0415

        run, settings = self._run, self._criteria.settings
        picture = Picture(send, run.registry, bit_rate=settings.bit_rate, most=self._most_points)
        measured = self._looked_at(picture, over(self._batches))
        if run.request.window or self._chosen is not None:
            self._add_window(picture, (batch for batch, _ in measured))
        else:
            self._add_all(picture, measured)
        return picture

    def finish(self, picture: Picture) -> None:
        """Add the verdict and the summary of the whole capture. Ends the run if there was nothing to draw."""
        run = self._run
        run.go_on()
        run.require_inside(self._shown)
        taken = self._judged.taken(short_names([run.request.names])[0])
        report = self._criteria.report([taken])
        found = self._marks.finish()
        picture.take_events(found.events, run.engine.buses)
        picture.take_flights(found.flights)
        picture.finish(report, taken.checked.facts, ", ".join(run.request.window_words))

    def _again(self) -> Iterator[Batch] | None:
        batches = self._run.again()
        return batches if batches is None or self._chosen is None else self._chosen.mark(batches)

    def _looked_at(self, picture: Picture, batches: Iterable[Measured]) -> Iterator[Measured]:
        for measured in batches:
            picture.note_start(measured.batch)
            self._marks.feed(measured.batch)
            if self._chosen is not None:
                (marked,) = self._chosen.mark([measured.batch])
                measured = measured._replace(batch=marked)  # noqa: PLW2901
            yield measured
            self._run.go_on()

    def _add_all(self, picture: Picture, measured: Iterable[Measured]) -> None:
        from analyzer.plot.parts import whole  # noqa: PLC0415

        for batch, bits in measured:
            picture.feed(whole(batch), bits)

    def _add_window(self, picture: Picture, batches: Iterable[Batch]) -> None:
        from analyzer.window.part import TableSelection  # noqa: PLC0415

        run = self._run
        selection = TableSelection(run.request.window, self._again)
        for part in selection.parts(batches):
            self._shown += len(part.frames) + len(part.transfers) + len(part.events)
            picture.feed(part)
            run.go_on()
        run.require(selection.problem)


def name(request: Request) -> str:
    """Return what the recording is called: the first capture, without the ending of its name."""
    first = request.names[0]
    return "standard input" if first == "-" else Path(first).stem or Path(first).name or "capture"
