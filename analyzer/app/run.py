"""One capture, or several as one, while it is read: the only place where captures are opened for what they hold."""

from __future__ import annotations

from contextlib import AbstractContextManager, closing, suppress
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np

import dissectors
from analyzer.app.source import are_files
from analyzer.decode.core import LINES, Totals
from analyzer.decode.engine import Batch, Engine
from analyzer.sinks.atomic import TargetError
from analyzer.sources import CaptureError
from analyzer.sources.errors import MergeError
from analyzer.sources.merge import Merged, open_captures
from analyzer.sources.native import frame_batches, rows
from analyzer.tables import EVENT_ROWS, EVENTS, wrap
from analyzer.window.limits import Window
from dissectors import DsdlError, ProfileError
from dissectors.kit.cells import numbers
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator
    from types import TracebackType

    import pyarrow as pa

    from analyzer._native import FrameBatch
    from analyzer.app.request import Request
    from analyzer.app.source import RunSource
    from analyzer.decode.core import AskedSessions
    from analyzer.window.cut import FrameTables
    from dissectors import Registry
    from dissectors.kit import Array

    Over = Callable[[Iterator[FrameBatch]], Iterator[FrameBatch]]

_Item = TypeVar("_Item")

# Complaints about single lines before it says only how many there were.
LINES_SHOWN = 5

# How a run stands: all is well; something could not be read or written; what was asked for is not there; it was ended.
RunState = Literal["whole", "damaged", "refused", "interrupted"]


class RunEndedError(Exception):
    """It has been said why there is no use in going on."""


class Run(AbstractContextManager["Run"]):
    """Reads the captures of a request, once; `state` tells how it went.

    In a `with` statement errors of the capture, of an output or of a dissector folder end the block with one complaint;
    without it they are raised. Setting `stopped` ends the reading: what a pipe or a growing file has delivered is still
    given.

    Args:
        request: what is asked.
        complain: takes a line about whatever is not as it should be.
        registry: the types, those of the request if not given.
        source: the captures if they are open already.

    Raises `DsdlError` or `ProfileError` for a broken dissector folder.
    """

    def __init__(
        self,
        request: Request,
        complain: Callable[[str], None] = lambda _: None,
        registry: Registry | None = None,
        source: RunSource | None = None,
    ) -> None:
        self.request, self.complain = request, complain
        self.source: RunSource = source or open_captures(request.captures, request.merging, follow=request.follow)
        self.registry = dissectors.load(request.dissectors, request.trusted) if registry is None else registry
        self.unpack_only(None)
        self.totals = Totals(dict.fromkeys(LINES, 0))
        self.transfers = 0
        # Gives masks of the frames and events that a filter has chosen of what is copied, or decoded by itself.
        self.chosen: Callable[[FrameTables], tuple[Array, Array]] | None = None
        self.matches = False  # it has chosen anything, in the window or not
        self._state: RunState = "whole"
        self._complaints = 0
        self._reading: RunSource = self.source

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> bool:
        """Take what cannot be opened or written as the state that it leaves, not as a failure."""
        damaged = isinstance(error, (CaptureError, TargetError))
        # Types are compiled when they occur, captures are compared when they are opened.
        if damaged or isinstance(error, (DsdlError, ProfileError, MergeError)):
            self.complain(str(error))
            self._state = "damaged" if damaged else "refused"
            return True
        return isinstance(error, RunEndedError)

    @property
    def state(self) -> RunState:
        """How it stands as far as that is known."""
        return "interrupted" if self.stopped else self._state

    @property
    def stopped(self) -> bool:
        """True once the reading was ended on purpose."""
        return self._reading.stopped

    @stopped.setter
    def stopped(self, value: bool) -> None:
        self._reading.stopped = value

    @property
    def waits(self) -> bool:
        """True while it waits for bytes and would not notice `stopped`."""
        return self._reading.waits

    @property
    def unit(self) -> str:
        """The unit that the captures are counted in: line or record."""
        units = {part.unit for part in self.source.parts}
        return units.pop() if len(units) == 1 else "record"

    def renewed(self) -> Run:
        """Return another run over the same captures, from their start. Raises what opening them raises."""
        return Run(self.request, self.complain, self.registry, self.source.again())

    def before(self) -> Run | None:
        """Return a silent run over the whole captures, to read them before this one does; None if they exist only once.

        What stops this run stops that one.
        """
        if not are_files(self.source):
            return None
        self._reading = self.source.again()
        return Run(replace(self.request, window=Window()), registry=self.registry, source=self._reading)

    # ---- batches

    def unpack_only(self, tables: Collection[str] | None, sessions: AskedSessions | None = None) -> None:
        """Have these tables made, and transfers of these sessions, others only counted; None for all; at the start."""
        self._asked = None if tables is None else frozenset(tables), sessions
        self.engine: Engine = self._engine()

    def batches(self, *, early: bool = False) -> Iterator[Batch]:
        """Yield every batch of the capture; damage found on the way is complained of at its end.

        With `early` nobody may want the capture to its end: nothing is read before it is asked for.
        """
        self._reading = self.source
        pieces = self.engine.core.run(self.source.chunks())
        for piece in pieces if early else self.ahead(pieces):
            for batch in self.engine.decoded(piece):
                yield self._seen(batch)
                del batch  # else they would be there while the next ones are made
            del piece
        self._conclude()

    def count(self, step: Callable[[], None] = lambda: None) -> None:
        """Read the capture for its account alone: no message is unpacked; `step` is called after each piece."""
        chunks = self.source.chunks()
        # Nothing is left for this thread but to put transfers together, so the other one is to parse.
        for piece in self.engine.core.run(self.ahead(rows(chunks)) if self._threaded else chunks):
            self._seen(self.engine.bare(piece))
            step()
        self._conclude()

    def inside(self, *, alone: bool = False) -> Iterator[Batch]:
        """Yield the batches inside the window, decoded as a capture of its own, `alone` also numbered as one."""
        from analyzer.window.cut import FrameSelection  # noqa: PLC0415 - most runs have no window
        from analyzer.window.decoder import WindowDecoder  # noqa: PLC0415

        if not self.request.window and self.chosen is None:
            yield from self.batches()
            return
        if not alone:
            self._learn()
        selection = FrameSelection(self.request.window, self.frame_batches_again, self.chosen)
        decoder = WindowDecoder(self.engine, selection, alone=alone)
        for batch in decoder.batches(self.ahead(frame_batches(self.source.chunks()))):
            yield self._seen(batch)
            del batch  # else it would be there while the next one is made
        self._conclude(whole=False)
        if selection.problem is not None:
            self.reject(selection.problem)
        elif self.chosen is None and not decoder.rows:
            self.reject(self.request.outside)
        else:
            self.require_inside(decoder.rows)

    def again(self) -> Iterator[Batch] | None:
        """Return the batches once more, with nothing counted or complained of; None if they exist only once."""
        return None if (chunks := self._chunks_again()) is None else self._engine().run(chunks)

    def ahead(self, items: Iterator[_Item]) -> Iterator[_Item]:
        """Return what is read for this run; if there may be threads and the captures are files, one reads it ahead."""
        if not self._threaded:
            return items
        from analyzer.app.process.threads import ahead  # noqa: PLC0415 - not every run has threads

        return ahead(items)

    # ---- frames that are not decoded

    def frame_batches(self) -> Iterator[FrameBatch]:
        """Yield the rows of the capture without decoding them; complaints as with `batches`."""
        for batch in frame_batches(self.source.chunks()):
            for name, count in batch.lines.items():
                self.totals.lines[name] = self.totals.lines.get(name, 0) + count
            if batch.lines["unreadable"]:
                self._complain_of(wrap(EVENT_ROWS, batch.columns()[1]))
            yield batch
        self._conclude()

    def frame_batches_inside(self, *, again: bool = False, over: Over = iter) -> Iterator[FrameBatch]:
        """Yield the rows inside the window; `again` reads them once more or ends the run; `over` sees all of them."""
        if (batches := self.frame_batches_again() if again else self.frame_batches()) is None:
            self.require("cannot be read a second time")
            return
        batches = over(batches)
        if not self.request.window and self.chosen is None:
            yield from batches
            return
        from analyzer.window.cut import FrameSelection  # noqa: PLC0415 - most runs have no window

        selection = FrameSelection(self.request.window, self.frame_batches_again, self.chosen)
        yield from selection.cut(batches)
        self.require(selection.problem)

    def frame_batches_again(self) -> Iterator[FrameBatch] | None:
        """Return the rows once more, in the same way; None if they exist only once."""
        return None if (chunks := self._chunks_again()) is None else frame_batches(chunks)

    # ---- whether to go on

    def unhurried(self, texts: Iterable[str]) -> Iterator[str]:
        """Yield the texts; once stopped no more of them if the capture is there to be read again."""
        for text in texts:
            if self._reading.stopped and not self._reading.live:
                return
            yield text

    def reject(self, reason: str) -> None:
        """Complain that what was asked for does not go with this capture."""
        self.complain(f"{self.source.name}: {reason}")
        if self._state == "whole":
            self._state = "refused"

    def require(self, problem: str | None) -> None:
        """End the run if the capture does not have what was asked for, for this reason."""
        if problem is not None:
            self.reject(problem)
            raise RunEndedError

    def require_inside(self, found: int) -> None:
        """End the run if a window was asked for and nothing was found inside it; under a filter only say so."""
        if not self.request.window or found:
            return
        if self.chosen is None:
            self.require(self.request.outside)
        elif self.matches:
            self.complain(f"{self.source.name}: nothing that matches is inside the window")

    def go_on(self) -> None:
        """End the run if output that is there whole or not at all has become impossible.

        After Ctrl-C a part of a file is no result; what a pipe has delivered exists only once, and is one.
        """
        if self._state == "refused":
            raise RunEndedError
        if self.stopped and not self.source.live:
            self.complain("interrupted, nothing is written")
            raise KeyboardInterrupt

    # ----

    @property
    def _threaded(self) -> bool:
        alone = self.source.live or self.request.follow or self.request.threads == 1  # signals end the main one
        return not alone and are_files(self.source)

    def _engine(self) -> Engine:
        """Return a new engine; what comes live is shown at once, everything else waits for its batch."""
        (only, sessions), readings = self._asked, self.request.rules.readings()
        return Engine(self.registry, readings, ahead=not self.source.live, only=only, sessions=sessions)

    def _learn(self) -> None:
        """Find out how the capture's nodes are read from its first batch, of which a window may see nothing."""
        chunks = self._chunks_again()
        if chunks is not None:
            first = self._engine()
            with suppress(CaptureError), closing(first.run(chunks)) as batches:
                next(batches, None)
            self.engine.know(first)
            self._reading = self.source

    def _chunks_again(self) -> Iterator[bytes | FrameBatch] | None:
        if self.source.live:
            return None
        self._reading = self.source.again()
        return self._reading.chunks()

    def _seen(self, batch: Batch) -> Batch:
        self.transfers, self.totals = self.engine.transfers, self.engine.totals
        self._complain_of(batch.events)
        return batch

    def _complain_of(self, events: pa.RecordBatch) -> None:
        if not len(events) or self._complaints >= LINES_SHOWN:
            return
        merged = len(self.source.parts) > 1
        unreadable = np.flatnonzero(numbers(events.column("kind")) == EVENTS.index("unreadable")).tolist()
        lines, texts = events.column("line"), events.column("text")
        for row in unreadable[: LINES_SHOWN - self._complaints]:
            place = "" if merged else f"{self.source.name}: {self.unit} {lines[row]}: "
            self.complain(f"{place}{texts[row]}")
            self._complaints += 1

    def _conclude(self, *, whole: bool = True) -> None:
        """Say what there is to say at the end of a capture, `whole` or cut; the notes of formats come first."""
        totals, source = self.totals, self.source
        for part in source.parts:
            for note in part.notes:
                self.complain(f"{part.name}: {note}")
        unreadable, balanced = totals.lines["unreadable"], totals.balanced
        damages = [part.damage for part in source.parts if part.damage]
        if unreadable > self._complaints:
            self.complain(f"{source.name}: {unreadable} of {totals.lines['lines']} {self.unit}s are unreadable")
        for damage in damages:
            self.complain(str(damage))
        for name in (empty := self._empty(whole=whole)):
            self.complain(f"{name}: empty")
        if not balanced:
            self.complain(f"{source.name}: lines and frames do not add up: please report this as a bug")
        if unreadable or damages or empty or not balanced:
            self._state = "damaged"
        if source.problem is not None:
            self.reject(source.problem)

    def _empty(self, *, whole: bool) -> list[str]:
        """Return the names of captures without a single record."""
        source = self.source
        if source.stopped or not whole:
            return []
        alone = [source.name] if not self.totals.lines["lines"] and source.damage is None else []
        return source.empty if isinstance(source, Merged) else alone
