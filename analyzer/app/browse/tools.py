"""Other commands for the browser: they run as processes of their own, and say in a line how they went."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.browser.supply import Supply

_TABLE = re.compile(r"(.+\.(?:csv|parquet|arrow|feather))(?: +(\S+))?", re.IGNORECASE)  # and which one
_LISTED = (".jsonl", ".json")
_FRAMES = (".log", ".txt", ".candump", ".pcapng", ".mcap", ".gz", ".zst")
_AROUND = "2s"
_DAMAGED = 3  # the status of a command that met something damaged
_MOST_COLUMNS, _MOST_FILTERS = 20, 100


class BrowserTools:
    """Writes, plots and keeps for a browser; `said` are lines about what has ended meanwhile."""

    def __init__(self, supply: Supply) -> None:
        self._supply = supply
        self.said: list[str] = []
        self.columns: list[str] = []

    def write(self, path: str, filter_text: str) -> str:
        """Begin to write what a filter selects: frames, rows as JSON, or with the name of a table all of its rows.

        Raises `ValueError` with the reason why not.
        """
        named = _TABLE.fullmatch(path)
        target = Path(path if named is None else named[1]).expanduser()
        if target.exists():
            raise ValueError(f"{target}: exists already: another name, please")
        chosen = (*self._supply.window, *(("-Y", filter_text) if filter_text else ()))
        kind = target.suffix.lower()
        if named is not None:
            words = ("export", *self._captures(), "--table", named[2] or "transfers", "-o", str(target), *chosen)
        elif kind in _FRAMES:
            words = ("convert", *self._captures(), "-o", str(target), *chosen)
        elif kind in _LISTED:
            words = ("decode", *self._captures(), "-T", kind[1:], *chosen)
        else:
            known = " ".join((*_FRAMES[:5], ".csv", ".parquet", *_LISTED))
            raise ValueError(f"{target.name}: the name is to end in one of {known}")
        self._start(words, f"written: {target}", target, str(target) if kind in _LISTED else os.devnull)
        return f"writing {target} ..."

    def plot(self, frame: int) -> str:
        """Open the picture around a frame, from 0. Raises `ValueError`."""
        self._start(("plot", *self._captures(), "--around", f"{frame + 1}+-{_AROUND}"), "the picture has been closed")
        return f"opening the picture around frame {frame + 1:,} ..."

    def keep_columns(self, names: Sequence[str]) -> None:
        """Keep columns for the next time."""
        self.columns = list(names)
        self._keep("columns", names)

    def _keep(self, name: str, lines: Sequence[str]) -> None:
        path = kept_file(name)
        if path is None:
            return
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
        except OSError as error:
            self.said.append(f"{path}: {error.strerror}: {name} are not kept")

    def keep_filter(self, text: str) -> None:
        """Keep a filter for the next time, the newest last."""
        some = [one for one in kept_lines("filters", _MOST_FILTERS) if one != text]
        self._keep("filters", [*some[1 - _MOST_FILTERS :], text])

    def _captures(self) -> tuple[str, ...]:
        paths = tuple(self._supply.paths)
        if not paths or "-" in paths:
            raise ValueError("what comes from a bus or a pipe exists only once: record it, and view the file")
        safe = (f"./{path}" if path.startswith("-") else path for path in paths)
        return (*safe, *self._supply.arguments)

    def _start(
        self, words: Sequence[str], done: str, target: Path | None = None, output: str = os.devnull
    ) -> None:  # fmt: skip
        """Begin a command that makes a file, with its output in another one. Raises `ValueError` if that cannot be."""
        try:
            with open(output, "wb") as out:  # noqa: PTH123 - the name of no file, mostly
                process = subprocess.Popen(  # noqa: S603 - ourselves
                    [sys.executable, "-m", "analyzer", *words], stdin=subprocess.DEVNULL, stdout=out,
                    stderr=subprocess.PIPE, text=True,
                )  # fmt: skip
        except OSError as error:
            raise ValueError(f"{output}: {error.strerror}") from None

        def wait() -> None:
            _, errors = process.communicate()
            lines = [line for line in errors.splitlines() if line.strip()]
            last = lines[-1] if lines else ""
            told = last or f"it ended with {process.returncode}"
            if process.returncode == _DAMAGED and target is not None and target.exists():
                told = f"{done}, but {told}"  # what could be read of it is written
            self.said.append(done if process.returncode == 0 else told)

        threading.Thread(target=wait, name=words[0], daemon=True).start()


def kept_file(name: str) -> Path | None:
    """Return where something is kept for the next time, if there is a home."""
    try:
        home = os.environ.get("XDG_CONFIG_HOME") or str(Path.home() / ".config")
    except RuntimeError:
        return None
    return Path(home) / "tailbyte" / name


def kept_lines(name: str, most: int) -> list[str]:
    """Return what was kept the last time, so many lines at most."""
    path = kept_file(name)
    try:
        text = "" if path is None else path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return []
    return [line.strip() for line in text.splitlines() if line.strip()][:most]


def kept_columns() -> list[str]:
    """Return the columns of the last time."""
    return kept_lines("columns", _MOST_COLUMNS)


def kept_filters() -> list[str]:
    """Return the filters of earlier times, the newest last."""
    return kept_lines("filters", _MOST_FILTERS)
