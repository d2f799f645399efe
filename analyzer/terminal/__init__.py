"""The monitor: what a bus does now, on a terminal of 80 by 24 and more. It draws snapshots and knows no bus."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analyzer.terminal.feed import Feed


class MonitorError(Exception):
    """The display failed, and said why on standard error."""


def possible() -> bool:
    """Return True if there is a terminal to show it on: keys come from stdin, pictures go to stderr."""
    streams = (sys.__stdin__, sys.__stderr__)
    return os.environ.get("TERM") != "dumb" and all(stream is not None and stream.isatty() for stream in streams)


def run(feed: Feed) -> None:
    """Show the feed until it ends or the user quits; in the main thread, on the terminal of this process.

    Raises whatever the feed raises, and `MonitorError` if the display itself fails.
    """
    from analyzer.terminal.app import Monitor  # noqa: PLC0415 - Textual takes a third of a second

    app = Monitor(feed)
    app.run(mouse=False)
    if app.problem is not None:
        raise app.problem
    if app.return_code:
        raise MonitorError("the monitor failed")
