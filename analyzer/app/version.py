"""The version of the program."""

from __future__ import annotations

import os
import sys

UNKNOWN = "unknown"

_ABOUT = ("tailbyte-", ".dist-info")  # around the version, in the name of the folder that an installation leaves


def version() -> str:
    """Return the installed version, `unknown` in a tree that was never installed."""
    for folder in sys.path:
        try:
            names = [one.name for one in os.scandir(folder or os.curdir)]
        except OSError:
            continue  # there is none, or it is an archive
        for name in names:
            if name.startswith(_ABOUT[0]) and name.endswith(_ABOUT[1]):
                return name.removeprefix(_ABOUT[0]).removesuffix(_ABOUT[1])
    from importlib.metadata import PackageNotFoundError  # noqa: PLC0415 - takes longer than `--help`
    from importlib.metadata import version as installed  # noqa: PLC0415

    try:
        return installed("tailbyte")
    except PackageNotFoundError:
        return UNKNOWN
