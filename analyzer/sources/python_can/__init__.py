"""Captures that python-can reads: ASC, TRC, CSV, BLF and MDF 4.

What a message means is left to python-can's readers. What stands around the messages is done here, so that no odd line
or object ends the reading: lines and objects are found, numbered and counted one by one, each is handed to python-can,
and times come from the capture itself as integers, not from python-can's floats.
"""

from __future__ import annotations

import logging
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer._native import FrameBatch
    from analyzer.sources import Source

_READERS = {
    "Vector ASC": "asc",
    "PEAK TRC": "trc",
    "python-can CSV": "comma",
    "Vector BLF": "blf",
    "MDF 4": "mdf",
}
# What python-can logs of lines that it does not understand is told as unreadable records here.
logging.getLogger("can").addHandler(logging.NullHandler())


def read(source: Source, chunks: Iterator[bytes]) -> Iterator[bytes | FrameBatch]:
    """Return the batches of a capture in one of these formats."""
    module: Any = import_module(f"analyzer.sources.python_can.{_READERS[source.format.name]}")
    yield from module.read(source, chunks)
