"""One capture on its way into a recording: read once, judged as `check` does, drawn batch by batch."""

from __future__ import annotations

import os
from contextlib import contextmanager
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.cli import options

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from rerun.chunk import Chunk

    from analyzer.cli.progress import Progress
    from analyzer.cli.session import Session
    from analyzer.engine import Batch
    from analyzer.plot.picture import Picture
    from analyzer.report.model import Report
    from analyzer.rules.checking import Checked, Measured
    from analyzer.window import Window


class Drawing:
    """One capture on its way into a recording. Raises `ValueError` for arguments that make no sense."""

    def __init__(self, args: argparse.Namespace, session: Session, window: Window) -> None:
        from analyzer.rules.checking import Check  # noqa: PLC0415
        from analyzer.rules.settings import Settings  # noqa: PLC0415

        self._args, self._session, self._window = args, session, window
        self._settings = Settings(bit_rate=args.bitrate, dialects=options.dialects(args, session.registry))
        self._check = Check(session.registry, self._settings)
        self._shown = 0
        self._batches: Iterator[Measured] = iter(())

    def start(self) -> None:
        """Begins to read: what is made ready until `draw` takes no time of its own."""
        from analyzer.ahead import ahead  # noqa: PLC0415

        parts = self._session.source.parts
        for part in parts:
            part.hashed = True
        batches = self._check.measured(self._session.batches())
        if all(os.path.isfile(part.name) for part in parts):  # noqa: PTH113 - signals end other reading here, in this thread
            batches = ahead(batches)
        with _opening():
            self._batches = chain(list(islice(batches, 1)), batches)

    def draw(self, send: Callable[[Sequence[Chunk]], None]) -> Picture:
        """Everything, through `send`. Ends the session when there is no use in going on."""
        from analyzer.cli.progress import Progress  # noqa: PLC0415
        from analyzer.plot.picture import Picture  # noqa: PLC0415

        args, session = self._args, self._session
        picture = Picture(
            send, session.registry, forced=self._settings.dialects, bit_rate=args.bitrate, most=args.max_points
        )
        with Progress(session.source) as progress:
            session.held = [] if progress.active else None
            measured = self._judged(picture, progress)
            if self._window:
                self._add_window(picture, (batch for batch, _ in measured))
            else:
                self._add_all(picture, measured)
        session.go_on()
        session.require_inside(self._shown, self._window)
        report, checked = self._report()
        picture.finish(report, checked.facts, _words(args))
        return picture

    def _judged(self, picture: Picture, progress: Progress) -> Iterator[Measured]:
        """Every batch of the capture, once the rules have seen it."""
        with _opening():
            for measured in progress.over(self._batches):
                self._check.feed(measured)
                picture.look(measured.batch)
                yield measured
                self._session.go_on()

    def _add_all(self, picture: Picture, measured: Iterable[Measured]) -> None:
        from analyzer.plot.parts import whole  # noqa: PLC0415

        for batch, bits in measured:
            picture.add(whole(batch), bits)

    def _add_window(self, picture: Picture, batches: Iterable[Batch]) -> None:
        from analyzer.sinks.part import PartSelection  # noqa: PLC0415

        selection = PartSelection(self._window, self._session.again)
        for part in selection.parts(batches):
            self._shown += len(part.frames) + len(part.transfers) + len(part.events)
            picture.add(part)
            self._session.go_on()
        self._session.require(selection.problem)

    def _report(self) -> tuple[Report, Checked]:
        """What `check` would say of the whole capture."""
        from analyzer.conformance import damage_of, ids, order  # noqa: PLC0415
        from analyzer.report.build import Taken, build  # noqa: PLC0415
        from analyzer.rules.catalogue import load  # noqa: PLC0415
        from analyzer.rules.gate import DEFAULT, FailOn  # noqa: PLC0415

        session, names = self._session, options.captures(self._args)
        checked = self._check.finish(session.source.parts, session.engine)
        taken = Taken(
            id=ids([names])[0],
            path=names[0],
            checked=checked,
            damage=damage_of(session.source, session.totals),
            live=session.source.live,
            arguments=tuple(names[1:]),
        )
        told = order(FailOn.parse([DEFAULT]), {}, None, None)
        return build([taken], session.registry, load(session.registry), self._settings, told), checked


@contextmanager
def _opening() -> Iterator[None]:
    """Ctrl-C while a capture was being opened."""
    from analyzer.sources.errors import StopReading  # noqa: PLC0415

    try:
        yield
    except StopReading:
        raise KeyboardInterrupt from None


def name(args: argparse.Namespace) -> str:
    """What the recording is called: the first capture, without the ending of its name."""
    first = options.captures(args)[0]
    return "standard input" if first == "-" else Path(first).stem or Path(first).name or "capture"


def _words(args: argparse.Namespace) -> str:
    """The window as it was asked for."""
    given = (
        ("from", args.start),
        ("to", args.stop),
        ("last", args.last),
        ("around", args.around),
        ("frames", args.frames),
    )
    return ", ".join(f"--{name} {value}" for name, value in given if value is not None)
