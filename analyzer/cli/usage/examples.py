"""Examples of each command, for its help and its manual page; a test runs every one of them.

They stand in `examples.txt`: the command in brackets, then a line each, with what it does behind a #.
"""

from __future__ import annotations

import os

Example = tuple[str, str]  # a command line, and what it does

# The five to begin with, of a capture and of a bus.
FIRST = {
    "info": "what it holds, who speaks, what is broken",
    "check": "which rule was broken, where and by whom",
    "decode": "every transfer, one line each",
    "plot": "the picture of the flight",
    "live": "a bus as it runs",
}


def _read() -> dict[str, tuple[Example, ...]]:
    first = [(f"tailbyte {name} {'can0' if name == 'live' else 'flight.log'}", about) for name, about in FIRST.items()]
    found: dict[str, list[Example]] = {"": [*first, ("tailbyte help", "the manual")]}
    command = ""
    path = os.path.join(os.path.dirname(__file__), "examples.txt")  # noqa: PTH118, PTH120 - help is to be instant
    with open(path, encoding="utf-8") as file:  # noqa: PTH123 - likewise
        lines = file.read().splitlines()
    for line in lines:
        if line.startswith("["):
            command = line.strip("[]")
            found[command] = []
        elif line:
            shown, _, about = line.partition("  # ")
            found[command].append((shown, about))
    return {name: tuple(some) for name, some in found.items()}


EXAMPLES = _read()
