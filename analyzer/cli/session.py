"""One run over one capture: source and engine together, every complaint in one place."""

from __future__ import annotations

import argparse
from contextlib import AbstractContextManager, ExitStack
from typing import TYPE_CHECKING, Self

import pyarrow.compute as pc

from analyzer.cli import DAMAGED, INTERRUPTED, OK, USAGE, options, streams
from analyzer.cli.interrupt import graceful
from analyzer.engine import LINES, Batch, Engine, Totals
from analyzer.sinks.atomic import TargetError
from analyzer.sources import CaptureError, Source
from analyzer.sources.errors import MergeError
from analyzer.sources.merge import Merged, open_captures
from analyzer.sources.native import rows
from analyzer.tables import EVENT_ROWS, EVENTS, wrap
from dissectors import DsdlError, ProfileError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from types import TracebackType

    import pyarrow as pa

    from analyzer._native import Piece
    from analyzer.window import Window

# Complaints about single lines before it says only how many there were.
LINES_SHOWN = 5


class _RejectedError(Exception):
    """It has been said what the capture does not have."""


class Session(AbstractContextManager["Session"]):
    """Reads the capture that the arguments name; `status` is the exit status once it is through.

    Errors of the capture or of a dissector folder end the session with one line on standard error. Ctrl-C ends the
    reading: what a pipe or a growing file has delivered is still shown.
    """

    def __init__(self, args: argparse.Namespace) -> None:
        self.source: Source | Merged = Source("")
        self.totals = Totals(dict.fromkeys(LINES, 0))
        self.transfers = 0
        self.held: list[str] | None = None
        self._args = args
        self._status = OK
        self._complaints = 0
        self._reading: Source | Merged = self.source
        self._cleanup = ExitStack()

    @property
    def status(self) -> int:
        """Exit status as far as it is known."""
        return INTERRUPTED if self._reading.stopped else self._status

    def __enter__(self) -> Self:
        """Loads the data types."""
        try:
            names, plan = options.captures(self._args), options.plan(self._args)
            self.source = self._reading = open_captures(names, plan, follow=getattr(self._args, "follow", False))
            self.registry = options.registry(self._args)
        except (argparse.ArgumentTypeError, DsdlError, ProfileError, OSError) as error:
            self.complain(str(error))
            raise SystemExit(USAGE) from None
        self.engine = Engine(self.registry)
        self._cleanup.enter_context(graceful(lambda: self._reading))
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> bool:
        """A capture that cannot be opened, or an output that cannot be written, is a status, not a failure."""
        self._cleanup.close()
        self.release()
        if isinstance(error, _RejectedError):
            return True
        if isinstance(error, (CaptureError, TargetError)):
            self.complain(str(error))
            self._status = DAMAGED
            return True
        # Types are compiled when they occur, captures are compared when they are opened.
        if isinstance(error, (DsdlError, ProfileError, MergeError)):
            self.complain(str(error))
            self._status = USAGE
            return True
        return False

    def batches(self) -> Iterator[Batch]:
        """Every batch of the capture; damage found on the way is reported at its end."""
        for chunk in self.source.chunks():
            if chunk != b"":
                for batch in self.engine.feed(chunk):
                    yield self._seen(batch)
            else:
                yield self._seen(self.engine.flush())
        yield self._seen(self.engine.finish())
        self._conclude()

    def inside(self, window: Window) -> Iterator[Batch]:
        """Batches of what is inside the window, decoded as a capture of its own; of all of it without a window."""
        from analyzer.cut import FrameSelection  # noqa: PLC0415 - most runs have no window
        from analyzer.windowed import Windowed  # noqa: PLC0415

        if not window:
            yield from self.batches()
            return
        selection = FrameSelection(window, self.pieces_again)
        windowed = Windowed(self.engine, selection)
        pieces = (piece for piece in rows(self.source.chunks()) if not isinstance(piece, bytes))
        for batch in windowed.batches(pieces):
            yield self._seen(batch)
        self._conclude(whole=False)
        if selection.problem is not None:
            self.reject(selection.problem)
        elif not windowed.rows:
            self.reject("nothing is inside the window")

    def pieces(self) -> Iterator[Piece]:
        """The rows of the capture without decoding them; complaints as with `batches`."""
        for piece in rows(self.source.chunks()):
            if not isinstance(piece, bytes):
                for name, count in piece.lines.items():
                    self.totals.lines[name] = self.totals.lines.get(name, 0) + count
                if piece.lines["unreadable"]:
                    self._complain_of(wrap(EVENT_ROWS, piece.columns()[1]))
                yield piece
        self._conclude()

    def pieces_inside(self, window: Window, *, again: bool = False) -> Iterator[Piece]:
        """The rows inside the window; `again` reads them once more. Ends the session if that does not go."""
        pieces = self.pieces_again() if again else self.pieces()
        if pieces is None:
            self.require("cannot be read a second time")
            return
        if not window:
            yield from pieces
            return
        from analyzer.cut import FrameSelection  # noqa: PLC0415 - most runs have no window

        selection = FrameSelection(window, self.pieces_again)
        yield from selection.cut(pieces)
        self.require(selection.problem)

    def again(self) -> Iterator[Batch] | None:
        """The capture once more, with nothing counted or complained about; None if it exists only once."""
        chunks = self._again()
        return None if chunks is None else Engine(self.registry).run(chunks)

    def pieces_again(self) -> Iterator[Piece] | None:
        """The rows once more, in the same way."""
        chunks = self._again()
        return None if chunks is None else (piece for piece in rows(chunks) if not isinstance(piece, bytes))

    def unhurried(self, texts: Iterable[str]) -> Iterator[str]:
        """The texts; after Ctrl-C no more of them if the capture is there to be read again."""
        for text in texts:
            if self._reading.stopped and not self._reading.live:
                return
            yield text

    def complain(self, text: str) -> None:
        """One line on standard error, later if a pager owns the terminal."""
        if self.held is None:
            streams.complain(text)
        else:
            self.held.append(text)

    def release(self) -> None:
        """Says what was held back."""
        held, self.held = self.held, None
        for text in held or ():
            streams.complain(text)

    def reject(self, reason: str) -> None:
        """What was asked for does not go with this capture."""
        self.complain(f"{self.source.name}: {reason}")
        self._status = self._status or USAGE

    def require(self, problem: str | None) -> None:
        """Ends the session if the capture does not have what was asked for, for this reason."""
        if problem is not None:
            self.reject(problem)
            raise _RejectedError

    def require_inside(self, found: int, window: Window) -> None:
        """Ends the session if a window was asked for and nothing was found inside it."""
        self.require("nothing is inside the window" if window and not found else None)

    def go_on(self) -> None:
        """For output that is there whole or not at all: ends the session once that has become impossible.

        After Ctrl-C a part of a file is no result; what a pipe has delivered exists only once, and is one.
        """
        if self._status == USAGE:
            raise _RejectedError
        if self.status == INTERRUPTED and not self.source.live:
            self.complain("interrupted, nothing is written")
            raise KeyboardInterrupt

    def account(self, shown: int | None) -> None:
        """The sums: every line and every frame, and how many transfers were shown (None: listing was not asked for)."""
        totals = self.totals
        kinds = "".join(f" + {count} {name}" for name, count in totals.verdicts.items() if count and name != "used")
        listed = f"{self.transfers} transfers" if shown is None else f"{shown} of {self.transfers} transfers shown"
        frames = totals.lines["frames"]
        streams.tell(f"-- {listed}; {self.sum()}; {frames} frames = {totals.verdicts['used']} used{kinds}\n")

    def sum(self) -> str:
        """What became of every line or record, as a sum."""
        lines = self.totals.lines
        others = LINES[2:]
        rest = "".join(f" + {lines[name]} {name.replace('_', ' ')}" for name in others if lines[name])
        return f"{lines['lines']} {self._unit()}s = {lines['frames']} frames{rest}"

    def _unit(self) -> str:
        units = {part.unit for part in self.source.parts}
        return units.pop() if len(units) == 1 else "record"

    def _again(self) -> Iterator[bytes | Piece] | None:
        if self.source.live:
            return None
        self._reading = self.source.again()
        return self._reading.chunks()

    def _seen(self, batch: Batch) -> Batch:
        self.transfers += len(batch.transfers)
        self.totals = self.engine.totals
        self._complain_of(batch.events)
        return batch

    def _complain_of(self, events: pa.RecordBatch) -> None:
        if not len(events) or self._complaints >= LINES_SHOWN:
            return
        merged = len(self.source.parts) > 1
        rows_ = events.filter(pc.equal(events.column("kind"), EVENTS.index("unreadable"))).to_pylist()
        for row in rows_[: LINES_SHOWN - self._complaints]:
            place = "" if merged else f"{self.source.name}: {self._unit()} {row['line']}: "
            self.complain(place + row["text"])
            self._complaints += 1

    def _conclude(self, *, whole: bool = True) -> None:
        """What is to be said at the end of a capture, `whole` or cut; the notes of formats come first."""
        totals, source = self.totals, self.source
        for part in source.parts:
            for note in part.notes:
                self.complain(f"{part.name}: {note}")
        unreadable, balanced = totals.lines["unreadable"], totals.balanced
        damages = [part.damage for part in source.parts if part.damage is not None]
        nothing = whole and totals.lines["lines"] == 0 and not damages
        empty = (
            [] if source.stopped else source.empty if isinstance(source, Merged) and whole else [source.name] * nothing
        )
        if unreadable > self._complaints:
            self.complain(f"{source.name}: {unreadable} of {totals.lines['lines']} {self._unit()}s are unreadable")
        for damage in damages:
            self.complain(str(damage))
        for name in empty:
            self.complain(f"{name}: empty")
        if not balanced:
            self.complain(f"{source.name}: lines and frames do not add up: please report this as a bug")
        if unreadable or damages or empty or not balanced:
            self._status = DAMAGED
        if source.problem is not None:
            self.reject(source.problem)
