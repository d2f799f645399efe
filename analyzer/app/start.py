"""A quick start of commands that need Arrow."""

from __future__ import annotations

import sys
from importlib.abc import MetaPathFinder


class _Hidden(MetaPathFinder):
    def find_spec(self, fullname: str, *_: object) -> None:
        if fullname == "pandas":
            raise ModuleNotFoundError(fullname)


def plain_arrow() -> None:
    """Keep Arrow from importing pandas.

    It would, where pandas is installed, with the first list it is given: a quarter of a second for nothing. Afterwards
    Arrow takes a pandas object for any other one: only for a process that is all ours.
    """
    import pyarrow as pa  # noqa: PLC0415

    hidden = _Hidden()
    sys.meta_path.insert(0, hidden)
    try:
        pa.array([0])  # it looks once
    finally:
        sys.meta_path.remove(hidden)
