"""`--with flight.bin`: the autopilot's own log beside captures."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from analyzer.app.process import streams
from analyzer.cli import status
from analyzer.cli.arguments.options import checked

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping
    from typing import Any

    from analyzer.sources.dataflash import AutopilotLog

EVENTS = "flight_events"


def add_log(parser: argparse.ArgumentParser) -> None:
    """Add the autopilot's log; `--offset` with a time alone says where it lies."""
    group = parser.add_argument_group("the autopilot's side")
    group.add_argument(
        "--with", dest="log", metavar="FLIGHT.bin",
        help="the ArduPilot dataflash log of the same flight: what the autopilot says becomes events, if its outputs "
        "are found among the commands on the bus; --offset SECONDS says instead when it started, from the first frame",
    )  # fmt: skip


def require(args: argparse.Namespace, tables: Collection[str]) -> None:
    """Raise `ValueError` if a log is given for tables of which none tells what it says."""
    if args.log is not None and EVENTS not in tables:
        raise ValueError(f"--with is for the events of flights: give --table {EVENTS}")


class LogBeside:
    """The log that was asked for. Take it before `options.request`, which knows `--offset` of captures alone.

    Raises `argparse.ArgumentTypeError` for an offset without a log, or several.
    """

    def __init__(self, args: argparse.Namespace) -> None:
        self._name: str | None = args.log
        self.log: AutopilotLog | None = None
        self._failed = False
        own = [text for text in args.offset if "=" not in text]
        if own and self._name is None:
            raise argparse.ArgumentTypeError(
                f"--offset: {own[0]!r} is not FILE=+1.5s, and there is no --with FLIGHT.bin"
            )
        if len(own) > 1:
            raise argparse.ArgumentTypeError("--offset: the log starts once: give one time")
        if self._name == "-":
            raise argparse.ArgumentTypeError("--with reads a file, not standard input")
        args.offset = [text for text in args.offset if "=" in text]
        self._given = next((checked("--offset", _seconds, text) for text in own), None)

    def read(self) -> AutopilotLog | None:
        """Read the log, if there is one, and say what is wrong with it; None if nothing of it can be read."""
        if self._name is None:
            return None
        from analyzer.app.triage import autopilot_log  # noqa: PLC0415 - few have a log
        from analyzer.sources.errors import CaptureError  # noqa: PLC0415

        try:
            log = autopilot_log(self._name, self._given)
        except CaptureError as error:
            self._complain(str(error))
            return None
        problems = [] if log.damage is None else [str(log.damage)]
        if log.unreadable:
            problems.append(f"{self._name}: {log.unreadable} places of it cannot be read")
        if log.left:
            problems.append(f"{self._name}: {log.left} records are more than are kept")
        if problems:
            self._complain("; ".join(problems) + f": {log.records} records are used")
        return log

    def conclude(self, found: Mapping[str, Any] | None) -> None:
        """Say it if the log that was read could not be aligned."""
        if found is not None and not found["parts"]:
            self._complain(f"{found['name']}: {found['text']}; nothing of it is told")

    def status(self, others: int) -> int:
        """Return the status of a command that ends with another one without a log."""
        return others or (status.DAMAGED if self._failed else status.OK)

    def _complain(self, text: str) -> None:
        self._failed = True
        streams.complain(text)


def _seconds(text: str) -> int:
    from analyzer.window.limits import duration  # noqa: PLC0415

    sign, size = (text[:1], text[1:]) if text[:1] in ("+", "-") else ("+", text)
    return int(sign + "1") * duration(size)
