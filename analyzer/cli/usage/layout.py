"""How help is laid out: as wide as the terminal, up to what can be read, with the examples at its end."""

from __future__ import annotations

import argparse
import shutil
import textwrap

from analyzer.cli.usage.examples import EXAMPLES

# Longer lines are hard to read.
_WIDEST = 100
# A longer command line has what it does above it, not beside it.
_COLUMN = 50


class Layout(argparse.HelpFormatter):
    """Wraps each paragraph by itself; lines that begin with a space stay as they are."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=min(shutil.get_terminal_size().columns - 2, _WIDEST))

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        """Wrap what stands between the options."""
        return "\n\n".join(
            textwrap.indent(part, indent)
            if part.startswith(" ") or "\n " in part
            else textwrap.fill(" ".join(part.split()), width, initial_indent=indent, subsequent_indent=indent)
            for part in text.split("\n\n")
        )


def examples(command: str) -> str:
    """Return the examples of a command, or of all of them together (""), for the end of its help."""
    lines = EXAMPLES.get(command, ())
    wide = max((len(line) for line, _ in lines if len(line) <= _COLUMN), default=0)
    shown = []
    for line, about in lines:
        row = f"  {line:{wide}}  {about}"
        fits = len(line) <= wide and len(row) < shutil.get_terminal_size().columns
        shown += [row] if fits else [f"  # {about}", f"  {line}"]
    return "\n".join(["examples:", *shown]) if shown else ""
