"""`-T csv`, `jsonl` or `json` with `-e NAME`: the chosen fields of each row under their names."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING

from analyzer.views.fields import fixed
from analyzer.views.records import csv_word

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.views.formats import Writer
    from analyzer.window.listed import ListedRows

# What is written in digits and is no number, or may be one by chance.
_WORDS = ("frame.time", "frame.data", "payload", "frame.interface_name", "dronecan.type", "dronecan.kind")
_NUMBER = re.compile(r"-?(?:0|[1-9]\d*)(?:\.\d+)?(?:[eE][+-]?\d+)?")


class ChosenRecords:
    """Writes what the writer of `-T fields` gives as records: numbers as numbers in JSON, several values as a list.

    Args:
        lines: writes the fields, separated by tabs.
        names: what they are called.
        form: csv, json or jsonl.
        texts: those of the names that are of texts, whatever these look like.
    """

    def __init__(self, lines: Writer, names: Sequence[str], form: str, texts: Collection[str] = ()) -> None:
        self._lines, self._form, self._before = lines, form, "\n"
        self._keys = [(json.dumps(name), name in texts or fixed(name) in _WORDS) for name in names]
        self._head = ",".join(map(csv_word, names)) + "\r\n"

    def begin(self) -> str:
        """Write what stands before the first record."""
        return {"json": "[", "csv": self._head}.get(self._form, "")

    def rows(self, batch: Batch, picked: ListedRows) -> Iterator[str]:
        """Write a record for each row."""
        return self._records(self._lines.rows(batch, picked))

    def end(self) -> str:
        """Write the rows that still waited, and what stands behind the last record."""
        rest = "".join(self._records(self._lines.end().splitlines(keepends=True)))
        return rest + ("\n]\n" if self._form == "json" else "")

    def _records(self, lines: Iterable[str]) -> Iterator[str]:
        for line in lines:
            cells = line.removesuffix("\n").split("\t")
            if self._form == "csv":
                yield ",".join(map(csv_word, cells)) + "\r\n"
                continue
            members = (f"{key}:{_value(cell, word)}" for (key, word), cell in zip(self._keys, cells, strict=True))
            text = "{" + ",".join(members) + "}"
            if self._form == "jsonl":
                yield text + "\n"
            else:
                before, self._before = self._before, ",\n"
                yield before + text


def _value(cell: str, word: bool) -> str:
    """Return a cell in JSON: null for none, a list for several numbers."""
    if not cell:
        return "null"
    parts = [] if word else cell.split(",")
    if parts and all(map(_NUMBER.fullmatch, parts)):
        return cell if len(parts) == 1 else f"[{cell}]"
    return json.dumps(cell, ensure_ascii=False)
