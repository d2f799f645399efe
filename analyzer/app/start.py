"""A quick start, for a process that is all ours: a program that has imported us goes on as it likes."""

from __future__ import annotations

import os
import sys
from types import ModuleType
from typing import Any

_COMPUTE = "pyarrow.compute"

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


class _Compute(ModuleType):
    """Stands for `pyarrow.compute` until somebody asks for more of it than Arrow's own methods do."""

    def __getattr__(self, name: str) -> Any:
        import importlib  # noqa: PLC0415

        if name.startswith("__"):
            raise AttributeError(name)
        if sys.modules.get(_COMPUTE) is self:
            del sys.modules[_COMPUTE]
        return getattr(importlib.import_module(_COMPUTE), name)


def plain_arrow() -> None:
    """Keep Arrow from importing more than it needs, where nobody else uses the process.

    Where pandas is installed it would import that with the first list it is given: a quarter of a second for nothing.
    Afterwards Arrow takes a pandas object for any other one. The first `take` or `cast` would import `pyarrow.compute`,
    which writes the documentation of 286 functions: that takes half as long as all else of Arrow.
    """
    if not _ours:
        return
    import pyarrow as pa  # noqa: PLC0415

    if _COMPUTE not in sys.modules:
        _light_compute()
    hidden = _Hidden()
    sys.meta_path.insert(0, hidden)
    try:
        pa.array([0])  # it looks once
    finally:
        sys.meta_path.remove(hidden)


def _light_compute() -> None:
    """Put what `take`, `cast` and the like of Arrow's own classes call where they look for it."""
    import pyarrow as pa  # noqa: PLC0415

    try:
        from pyarrow import _compute as core  # noqa: PLC0415
    except ImportError:
        return  # another version of Arrow

    call, module = core.call_function, _Compute(_COMPUTE)

    def take(data: Any, indices: Any, *, boundscheck: bool = True, memory_pool: Any = None) -> Any:
        return call("take", [data, indices], core.TakeOptions(boundscheck=boundscheck), memory_pool)

    def kept(data: Any, mask: Any, null_selection_behavior: str = "drop", *, memory_pool: Any = None) -> Any:
        return call("filter", [data, mask], core.FilterOptions(null_selection_behavior), memory_pool)

    def cast(
        arr: Any, target_type: Any = None, safe: bool | None = None, options: Any = None, memory_pool: Any = None
    ) -> Any:
        if options is None:
            kind = pa.types.lib.ensure_type(target_type)
            options = core.CastOptions.unsafe(kind) if safe is False else core.CastOptions.safe(kind)
        return call("cast", [arr], options, memory_pool)

    module.__dict__.update(take=take, filter=kept, cast=cast, call_function=call)
    module.__dict__.update(Expression=core.Expression, NullOptions=core.NullOptions)
    sys.modules[_COMPUTE] = module
