"""A quick start, for a process that is all ours: a program that has imported us goes on as it likes."""

from __future__ import annotations

import os
import sys

_ours = False


class _Hidden:
    def find_spec(self, fullname: str, *_: object) -> None:
        if fullname == "pandas":
            raise ModuleNotFoundError(fullname)


def alone() -> None:
    """Say that nobody else uses this process; to be called before anything heavy is imported.

    numpy's linear algebra, which nothing here needs, would start a thread for each core: a tenth of a second.
    """
    global _ours  # noqa: PLW0603 - a property of the process
    _ours = True
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def plain_arrow() -> None:
    """Keep Arrow from importing pandas, where nobody else uses the process.

    It would, where pandas is installed, with the first list it is given: a quarter of a second for nothing. Afterwards
    Arrow takes a pandas object for any other one.
    """
    if not _ours:
        return
    import pyarrow as pa  # noqa: PLC0415

    hidden = _Hidden()
    sys.meta_path.insert(0, hidden)
    try:
        pa.array([0])  # it looks once
    finally:
        sys.meta_path.remove(hidden)
