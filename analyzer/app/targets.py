"""Outputs of a command: the format that a name means, and what must not be written over."""

from __future__ import annotations

import os
import stat
import sys
from contextlib import suppress
from typing import TYPE_CHECKING

from analyzer.sinks import form_of

if TYPE_CHECKING:
    from collections.abc import Iterable

_SHOWN = 3  # names of files in a complaint


def capture_form(output: str, form: str | None, compression: str | None, pipe: str = "") -> tuple[str, str]:
    """Return format and packing of the capture `output`; `pipe` is the format of standard output if none is given.

    Raises `ValueError` for what does not go together.
    """
    named, packing = form_of(output)
    form = form or (pipe if output == "-" else named)
    if not form and not output:
        raise ValueError("the output has no name")
    if named and form != named:
        raise ValueError(f"{output}: the name says {named}, -F says {form}")
    if not form:
        says = "- says" if output == "-" else f"{output}: the name says"
        raise ValueError(f"{says} no format: give -F candump, mcap or pcapng")
    if compression is not None and form != "mcap":
        raise ValueError("--compression is for MCAP")
    if output == "-" and form != "candump" and sys.stdout.isatty():
        raise ValueError(f"{form} is nothing for a terminal")
    return form, packing


def refuse_input(captures: Iterable[str], output: str) -> None:
    """Raise `ValueError` when a command would write over what it reads, or read on what it writes."""
    if same := next((name for name in captures if _is_file(name, output)), None):
        shown = "standard output" if output == "-" else output
        raise ValueError(f"{shown}: is " + ("standard input itself" if same == "-" else f"the capture {same} itself"))


def refuse_filled(folder: str, *, force: bool) -> None:
    """Raise `ValueError` when a command would put files among others without being told to; hidden ones are none."""
    found: list[str] = []
    with suppress(OSError, ValueError):  # whoever opens it will say what is wrong
        found = sorted(name for name in os.listdir(folder) if not name.startswith("."))  # noqa: PTH208 - any name
    if found and not force:
        more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
        raise ValueError(
            f"{folder}: holds files already ({', '.join(found[:_SHOWN])}{more}): --force writes among them"
        )


def _is_file(capture: str, output: str) -> bool:
    """Return whether both are one regular file; `-` is what the shell made standard input or output."""
    try:
        read, written = (os.stat(number if name == "-" else name) for number, name in enumerate((capture, output)))  # noqa: PTH116
        return stat.S_ISREG(written.st_mode) and os.path.samestat(read, written)
    except (OSError, ValueError):  # whoever opens it will say what is wrong
        return False
