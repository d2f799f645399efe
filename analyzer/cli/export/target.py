"""The goal of an export: what its output is called, the format asked for and the tables chosen, together."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.sinks import ALL

if TYPE_CHECKING:
    from collections.abc import Sequence

FORMS = ("parquet", "arrow", "csv", "mcap")
_NAMED = {form: form for form in FORMS} | {"pq": "parquet", "feather": "arrow"}
_PACKED = ("gz", "zst", "zstd", "bz2", "xz", "lz4", "zip")


@dataclass(frozen=True, slots=True)
class Goal:
    """The tables that are written, by name, all if there are none, and where; `folder` means a file for each."""

    form: str
    path: str
    folder: bool
    tables: tuple[str, ...]

    @property
    def findings(self) -> bool:
        """True if they are among what is written: MCAP has them if nothing is chosen."""
        return "findings" in self.tables or (self.form == "mcap" and not self.tables)


def goal(output: str, form: str | None, tables: Sequence[str]) -> Goal:
    """Return what the arguments ask for. Raises `ValueError` when they do not go together."""
    if not output:
        raise ValueError("-o is empty: give a folder or a file")
    named = _NAMED.get(_suffix(output))
    into = output.endswith("/") or Path(output).is_dir()
    if form is None and output == "-":
        raise ValueError("- says no format: give -F parquet, arrow, csv or mcap")
    if form is not None and named not in (None, form) and not into:
        raise ValueError(f"-o {output} and -F {form} contradict each other")
    alone = len(tables) == 1 and ALL not in tables
    one = not into and alone and Path(output).exists()
    if not (into or named):
        _check_suffix(output, free=one or form == "mcap")
    form = form or named or "parquet"
    if output == "-" and form != "csv" and sys.stdout.isatty():
        raise ValueError(f"{form} is nothing for a terminal")
    if form == "mcap":
        return _mcap(output, tables, into=into)
    folder = into or (named is None and output != "-" and not one)
    if not folder and not alone:
        raise ValueError(f"{output}: one file holds one table: choose it with --table NAME, or give a folder")
    return Goal(form, output, folder, tuple(tables))


def _mcap(output: str, tables: Sequence[str], *, into: bool) -> Goal:
    if "transfers" in tables:
        raise ValueError("MCAP holds messages, frames, events and findings, but no table of transfers")
    for name in ("esc", "flights", "flight_events"):
        if name in tables:
            raise ValueError(
                f"MCAP holds messages, frames, events and findings: {name} is a table for Parquet, Arrow or CSV"
            )
    if into:
        raise ValueError(f"{output}: is a folder, and MCAP is one file: give it a name")
    return Goal("mcap", output, folder=False, tables=() if ALL in tables else tuple(tables))


def _suffix(output: str) -> str:
    return Path(output).suffix.lower()[1:]


def _check_suffix(output: str, *, free: bool) -> None:
    """Raise `ValueError` for what no format is called and hardly is a folder; `free` allows all but packed ones."""
    suffix = _suffix(output)
    if suffix in _PACKED:
        raise ValueError(f"{output}: an export is not packed: leave .{suffix} away, or end it in / for a folder")
    if suffix and not free:
        raise ValueError(f"{output}: no format is called .{suffix}: parquet, arrow, csv, mcap; a folder ends in /")
