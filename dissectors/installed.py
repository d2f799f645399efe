"""Folders that installed packages offer, by an entry point of the group `analyzer.dissectors`."""

from __future__ import annotations

import os
import sys
from importlib.machinery import PathFinder
from pathlib import Path

from dissectors.toml_table import ProfileError

GROUP = "analyzer.dissectors"

_ABOUT = (".dist-info", ".egg-info")  # folders that say what an installed package is


def folders() -> list[Path]:
    """Return the folder of each entry point, by its name. Raises `ProfileError` for one that gives none."""
    if not _likely():
        return []
    from importlib.metadata import entry_points  # noqa: PLC0415 - it takes longer than all dissectors

    found = []
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        try:
            found.append(Path(entry.load()))
        except (ImportError, AttributeError, TypeError) as error:
            raise ProfileError(f"{GROUP}: {entry.name}", 1, f"{entry.value} gives no folder: {error}") from None
    return found


def _likely() -> bool:
    """Return False if no installed package speaks of the group, by a look at those that lie in plain folders."""
    if any(finder is not PathFinder and hasattr(finder, "find_distributions") for finder in sys.meta_path):
        return True
    return any(_speaks_of_it(folder or os.curdir) for folder in sys.path)


def _speaks_of_it(folder: str) -> bool:
    try:
        abouts = [one.path for one in os.scandir(folder) if one.name.lower().endswith(_ABOUT)]
    except NotADirectoryError:
        return True  # an archive: whoever can read it decides
    except OSError:
        return False
    return folder.lower().endswith(".egg") or any(_names_group(Path(about)) for about in abouts)


def _names_group(about: Path) -> bool:
    try:
        return GROUP.encode() in (about / "entry_points.txt").read_bytes()
    except OSError:
        return False
