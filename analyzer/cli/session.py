"""One run over one capture: source and engine together, every complaint in one place."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Self

from analyzer.cli import DAMAGED, OK, USAGE, options
from analyzer.engine import Batch, Engine
from analyzer.sources import CaptureError, Source
from analyzer.tables import EVENTS
from analyzer.views.terminal import escape
from dissectors import DsdlError, ProfileError

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator
    from types import TracebackType

# Complaints about single lines before it says only how many there were.
LINES_SHOWN = 5


class Session(AbstractContextManager["Session"]):
    """Reads the capture that the arguments name; `status` is the exit status once it is through.

    Errors of the capture or of a dissector folder end the session with one line on standard error.
    """

    def __init__(self, args: argparse.Namespace) -> None:
        self.status = OK
        self.source = Source(options.capture_name(args), follow=getattr(args, "follow", False))
        self._args = args
        self._complaints = 0
        self.transfers = 0

    def __enter__(self) -> Self:
        """Loads the data types."""
        try:
            self.registry = options.registry(self._args)
        except (DsdlError, ProfileError) as error:
            self.complain(str(error))
            raise SystemExit(USAGE) from None
        self.engine = Engine(self.registry)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> bool:
        """A capture that cannot be opened is a status, not a failure of the program."""
        if isinstance(error, CaptureError):
            self.complain(str(error))
            self.status = DAMAGED
            return True
        return False

    def batches(self) -> Iterator[Batch]:
        """Every batch of the capture; damage found on the way is reported at its end."""
        for chunk in self.source.chunks():
            if chunk:
                for batch in self.engine.feed(chunk):
                    yield self._seen(batch)
            elif self._args.follow:
                yield self._seen(self.engine.flush())
        yield self._seen(self.engine.finish())
        self._conclude()

    def complain(self, text: str) -> None:
        """One line on standard error; text of the capture cannot do anything to the terminal."""
        sys.stderr.write(f"tailbyte: {escape(text)}\n")

    def account(self, shown: int | None) -> None:
        """The sums: every line and every frame, and how many transfers were shown (None: listing was not asked for)."""
        totals = self.engine.totals
        kinds = ", ".join(f"{count} {name}" for name, count in totals.verdicts.items() if count and name != "used")
        lines = totals.lines
        others = {name.replace("_", " "): lines[name] for name in ("error_frames", "drops", "comments", "blank", "unreadable")}
        rest = "".join(f" + {count} {name}" for name, count in others.items() if count)
        listed = f"{self.transfers} transfers" if shown is None else f"{shown} of {self.transfers} transfers shown"
        sys.stderr.write(
            f"-- {listed}; {lines['lines']} lines = {lines['frames']} frames{rest}; "
            f"{lines['frames']} frames = {totals.verdicts['used']} used{' + ' if kinds else ''}{kinds.replace(', ', ' + ')}\n"
        )

    def _seen(self, batch: Batch) -> Batch:
        self.transfers += len(batch.transfers)
        unreadable = EVENTS.index("unreadable")
        if len(batch.events) and self._complaints < LINES_SHOWN:
            rows = batch.events.filter(_equals(batch.events, "kind", unreadable)).to_pylist()
            for row in rows[: LINES_SHOWN - self._complaints]:
                self.complain(f"{self.source.name}: line {row['line']}: {row['text']}")
                self._complaints += 1
        return batch

    def _conclude(self) -> None:
        totals = self.engine.totals
        unreadable = totals.lines["unreadable"]
        if unreadable > self._complaints:
            self.complain(f"{self.source.name}: {unreadable} of {totals.lines['lines']} lines are unreadable")
        if self.source.damage is not None:
            self.complain(str(self.source.damage))
        if self.source.size == 0:
            self.complain(f"{self.source.name}: empty")
        if not totals.balanced:
            self.complain(f"{self.source.name}: lines and frames do not add up: please report this as a bug")
        if unreadable or self.source.damage is not None or self.source.size == 0 or not totals.balanced:
            self.status = DAMAGED


def _equals(batch: object, column: str, value: int) -> object:
    import pyarrow.compute as pc  # noqa: PLC0415

    return pc.equal(batch.column(column), value)  # type: ignore[attr-defined]
