"""One run over one capture: source and engine together, every complaint in one place."""

from __future__ import annotations

from contextlib import AbstractContextManager, ExitStack
from typing import TYPE_CHECKING, Self

import pyarrow.compute as pc

from analyzer.cli import DAMAGED, INTERRUPTED, OK, USAGE, options, streams
from analyzer.cli.interrupt import graceful
from analyzer.engine import Batch, Engine
from analyzer.sources import CaptureError, Source
from analyzer.tables import EVENTS
from dissectors import DsdlError, ProfileError

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Iterator
    from types import TracebackType

# Complaints about single lines before it says only how many there were.
LINES_SHOWN = 5


class Session(AbstractContextManager["Session"]):
    """Reads the capture that the arguments name; `status` is the exit status once it is through.

    Errors of the capture or of a dissector folder end the session with one line on standard error. Ctrl-C ends the
    reading: what a pipe or a growing file has delivered is still shown.
    """

    def __init__(self, args: argparse.Namespace) -> None:
        self.source = Source(options.capture_name(args), follow=getattr(args, "follow", False))
        self.transfers = 0
        self.held: list[str] | None = None
        self._args = args
        self._status = OK
        self._complaints = 0
        self._reading = self.source
        self._cleanup = ExitStack()

    @property
    def status(self) -> int:
        """Exit status as far as it is known."""
        return INTERRUPTED if self._reading.stopped else self._status

    def __enter__(self) -> Self:
        """Loads the data types."""
        try:
            self.registry = options.registry(self._args)
        except (DsdlError, ProfileError, OSError) as error:
            self.complain(str(error))
            raise SystemExit(USAGE) from None
        self.engine = Engine(self.registry)
        self._cleanup.enter_context(graceful(lambda: self._reading))
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> bool:
        """A capture that cannot be opened is a status, not a failure of the program."""
        self._cleanup.close()
        self.release()
        if isinstance(error, CaptureError):
            self.complain(str(error))
            self._status = DAMAGED
            return True
        if isinstance(error, (DsdlError, ProfileError)):  # types are compiled when they occur
            self.complain(str(error))
            self._status = USAGE
            return True
        return False

    def batches(self) -> Iterator[Batch]:
        """Every batch of the capture; damage found on the way is reported at its end."""
        for chunk in self.source.chunks():
            if chunk:
                for batch in self.engine.feed(chunk):
                    yield self._seen(batch)
            else:
                yield self._seen(self.engine.flush())
        yield self._seen(self.engine.finish())
        self._conclude()

    def again(self) -> Iterator[Batch] | None:
        """The capture once more, with nothing counted or complained about; None if it exists only once."""
        if self.source.live:
            return None
        self._reading = Source(self.source.name)
        return Engine(self.registry).run(self._reading.chunks())

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

    def account(self, shown: int | None) -> None:
        """The sums: every line and every frame, and how many transfers were shown (None: listing was not asked for)."""
        totals = self.engine.totals
        lines = totals.lines
        others = ("error_frames", "drops", "comments", "blank", "unreadable")
        rest = "".join(f" + {lines[name]} {name.replace('_', ' ')}" for name in others if lines[name])
        kinds = "".join(f" + {count} {name}" for name, count in totals.verdicts.items() if count and name != "used")
        listed = f"{self.transfers} transfers" if shown is None else f"{shown} of {self.transfers} transfers shown"
        streams.tell(
            f"-- {listed}; {lines['lines']} lines = {lines['frames']} frames{rest}; "
            f"{lines['frames']} frames = {totals.verdicts['used']} used{kinds}\n"
        )

    def _seen(self, batch: Batch) -> Batch:
        self.transfers += len(batch.transfers)
        unreadable = EVENTS.index("unreadable")
        if len(batch.events) and self._complaints < LINES_SHOWN:
            rows = batch.events.filter(pc.equal(batch.events.column("kind"), unreadable)).to_pylist()
            for row in rows[: LINES_SHOWN - self._complaints]:
                self.complain(f"{self.source.name}: line {row['line']}: {row['text']}")
                self._complaints += 1
        return batch

    def _conclude(self) -> None:
        totals, damage = self.engine.totals, self.source.damage
        unreadable = totals.lines["unreadable"]
        empty = totals.lines["lines"] == 0 and damage is None and not self.source.stopped
        if unreadable > self._complaints:
            self.complain(f"{self.source.name}: {unreadable} of {totals.lines['lines']} lines are unreadable")
        if damage is not None:
            self.complain(str(damage))
        if empty:
            self.complain(f"{self.source.name}: empty")
        if not totals.balanced:
            self.complain(f"{self.source.name}: lines and frames do not add up: please report this as a bug")
        if unreadable or damage is not None or empty or not totals.balanced:
            self._status = DAMAGED
