"""The version of the program."""

from __future__ import annotations

UNKNOWN = "unknown"


def version() -> str:
    """Return the installed version, `unknown` in a tree that was never installed."""
    from importlib.metadata import PackageNotFoundError  # noqa: PLC0415 - takes longer than `--help`
    from importlib.metadata import version as installed  # noqa: PLC0415

    try:
        return installed("tailbyte")
    except PackageNotFoundError:
        return UNKNOWN
