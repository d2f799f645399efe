"""The reference of keys and of the kit, written from what the readers use: `python -m dissectors.reference FILE`.

It stands in FILE (`dissectors/README.md`) between two comments, and is written anew there; without FILE it is printed.
"""

from __future__ import annotations

import re
import sys
from inspect import getdoc, isclass, isfunction, signature
from pathlib import Path
from typing import TYPE_CHECKING

from dissectors import keys, kit

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.keys import Key, Keys

BEGIN, END = "<!-- reference: begin -->\n", "<!-- reference: end -->\n"
# Names of the kit that carry no text of their own.
_ABOUT = {
    "Array": "A numpy array of any dtype and shape.",
    "Feed": "A function over one batch, as `rule` takes it: `View` in, breaches out.",
    "MICROSECOND": "Nanoseconds.",
    "MILLISECOND": "Nanoseconds.",
    "NODES": "Numbers of `sender` are below this.",
    "NO_TIME": "In place of a time that a capture does not have.",
    "SECOND": "Nanoseconds.",
    "SESSION": "Bits of an identifier that the frames of one session have in common: all but the priority.",
    "Severity": "`error`, `warning` or `note`.",
    "Worst": "Which of a row's numbers is worst: `lowest`, `highest`, by size `slowest`, `strongest`, or farthest from "
    "a number.",
    "Values": "What an occurrence says, by name: it fills the page's `text` and makes up its `key`.",
}


def reference() -> str:
    """Return the reference as Markdown."""
    lines = ["## Keys", ""]
    known: set[str] = set()
    for file in keys.FILES:
        lines += _section(f"### `{file.title}`", file)
        for inner in _inside(file):
            if inner.title not in known:
                known.add(inner.title)
                lines += _section(f"#### `{inner.title}`", inner)
    lines += ["## The kit", "", "`from dissectors import kit`", "", "| Name | What it is |", "|---|---|"]
    lines += [f"| `{_call(name)}` | {_cell(_first_line(name))} |" for name in sorted(kit.__all__, key=str.lower)]
    return "\n".join(lines) + "\n"


def renewed(text: str) -> str:
    """Return a text with the reference between its comments. Raises `ValueError` if it has none."""
    head, begin, rest = text.partition(BEGIN)
    _, end, tail = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"no {BEGIN.strip()} and {END.strip()}")
    return f"{head}{begin}\n{reference()}\n{end}{tail}"


def _section(title: str, table: Keys) -> Iterator[str]:
    yield from (title, "", table.about, "")
    if table.keys:
        yield from ("| Key | Holds | Means | Default | Example |", "|---|---|---|---|---|")
        yield from map(_row, table.keys)
        yield ""


def _row(key: Key) -> str:
    default = "required" if key.required else key.default
    example = f"`{key.example}`" if key.example else ""
    return f"| {' | '.join(_cell(cell) for cell in (f'`{key.name}`', key.type, key.about, default, example))} |"


def _inside(table: Keys) -> Iterator[Keys]:
    """Yield the tables inside a table, each with what is inside it."""
    for key in (*table.keys, *([table.other] if table.other else [])):
        inner = _of(key)
        if inner is not None:
            yield inner
            yield from _inside(inner)


def _of(key: Key) -> Keys | None:
    return key.keys if key.keys is not None or key.each is None else _of(key.each)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _call(name: str) -> str:
    found = getattr(kit, name)
    if not isfunction(found):
        return name
    names = [f"*{one.name}" if one.kind is one.VAR_POSITIONAL else f"**{one.name}" if one.kind is one.VAR_KEYWORD
             else one.name for one in signature(found).parameters.values()]  # fmt: skip
    return f"{name}({', '.join(names)})"


def _first_line(name: str) -> str:
    found = getattr(kit, name)
    if name in _ABOUT:
        return _ABOUT[name]
    if not isclass(found) and not isfunction(found):
        raise ValueError(f"nothing is said of {name}")
    return re.split(r"\n\n", getdoc(found) or "", maxsplit=1)[0].replace("\n", " ")


def main(files: list[str]) -> int:
    """Write the reference anew into files, or print it."""
    for file in files:
        path = Path(file)
        path.write_text(renewed(path.read_text(encoding="utf-8")), encoding="utf-8")
    if not files:
        sys.stdout.write(reference())
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
