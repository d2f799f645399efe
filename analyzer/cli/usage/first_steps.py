"""The words of `tailbyte` alone: five commands to try first, with a capture of the folder where it is called."""

from __future__ import annotations

import os
from itertools import islice
from shlex import quote

from analyzer.cli.usage.examples import FIRST
from analyzer.cli.usage.here import interfaces

# Names that captures have; .txt and .csv are too often something else.
SUFFIXES = (".log", ".candump", ".mcap", ".pcapng", ".pcap", ".blf", ".asc", ".trc", ".mf4")
_PACKED = (".gz", ".zst")
# Entries of the folder that are looked at.
_MOST = 1000
_WIDE = 40  # a longer name would make lines of two


def first_steps() -> str:
    """Return the commands, each with what it does."""
    found = newest_capture()
    bus = next(iter(interfaces()), "can0")
    steps = [(f"tailbyte {name} {bus if name == 'live' else found or 'flight.log'}", FIRST[name]) for name in FIRST]
    if not found:  # somebody without a capture makes one
        steps = [("tailbyte simulate -o flight.log", "a capture, if there is none"), *steps[:3], steps[-1]]
    wide = max(len(line) for line, _ in steps)
    lines = "".join(f"  {line:{wide}}  {about}\n" for line, about in steps)
    return (
        "tailbyte reads, decodes and judges captures of DroneCAN buses. To begin with:\n\n"
        f"{lines}\nAll commands: tailbyte --help; the manual: tailbyte help\n"
    )


def newest_capture() -> str:
    """Return the newest capture of this folder by its name, ready for a shell; "" if there is none to be seen."""
    try:
        with os.scandir() as entries:
            files = [(one.stat().st_mtime, one.name) for one in islice(entries, _MOST) if _may_be_capture(one)]
    except OSError:
        return ""
    return quote(max(files)[1]) if files else ""


def _may_be_capture(entry: os.DirEntry[str]) -> bool:
    name = entry.name.lower()
    for packed in _PACKED:
        name = name.removesuffix(packed)
    fits = entry.name.isprintable() and not entry.name.startswith(("-", ".")) and len(entry.name) < _WIDE
    return name.endswith(SUFFIXES) and fits and entry.is_file()
