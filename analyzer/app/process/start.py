"""A quick start, for a process that is all ours: a program that has imported us goes on as it likes."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

_FIRST = 200_000  # objects: more than any command makes while it starts
# Objects that are made until garbage is looked for, and how often until older and the oldest ones are looked through:
# in a command that ends, and in a session without end. A log full of faults makes millions that live on: looking took
# 5 % of the time. In a session few live on, but what a terminal shows refers to itself: 50,000 took 7 MB.
_USUAL, _IN_SESSIONS = (400_000, 20, 10), (3_000, 4, 2)
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8  # malloc.h of glibc
_KEPT, _LARGE = 64 << 20, 32 << 20  # bytes that are free at the top; bytes of what the system is asked for alone
_SMALL = 64 << 10
_MIDDLE = 256 << 10  # where much lives on between what is freed, which leaves holes that nothing else fits into
_OLDEST = 2  # generation of garbage
_ARENAS = 2  # whatever the number of threads: what one of them has freed another one takes

_ours = False
_thresholds = _USUAL


class _Hidden:
    def find_spec(self, fullname: str, *_: object) -> None:
        if fullname == "pandas":
            raise ModuleNotFoundError(fullname)


def alone() -> None:
    """Say that nobody else uses this process; to be called before anything heavy is imported.

    numpy's linear algebra, which nothing here needs, would start a thread for each core: a tenth of a second. Arrow
    would keep memory of its own beside everybody else's, and clear each page anew that it had given back. What is
    made while a command starts lives until it ends: no garbage is looked for in it, neither then nor at the end. Where
    thousands of findings are made, hardly anything is garbage that refers to itself: it is looked for seldom.
    """
    global _ours  # noqa: PLW0603 - a property of the process
    _ours = True
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")

    def settle(phase: str, _: object) -> None:
        if phase == "stop":
            gc.callbacks.remove(settle)
            gc.set_threshold(*_thresholds)
            gc.freeze()

    gc.callbacks.append(settle)
    gc.set_threshold(_FIRST)
    atexit.register(gc.freeze)


def is_alone() -> bool:
    """Return whether nobody else uses this process."""
    return _ours


def keep_memory(arenas: int = _ARENAS) -> None:
    """Keep what is freed for what is needed next, where nobody else uses the process.

    Columns of a batch are large enough for glibc to give each back to the system and to ask for the next one anew: then
    every page of it is cleared once more, and each time all threads wait.
    """
    _tune(_KEPT, _LARGE, arenas)


def return_columns(*, faulty: bool) -> None:
    """Give back freed columns as long as captures are `faulty`, where nobody else uses the process.

    What is told of the faults lives on between the columns of a batch: what these leave behind is too small for the
    next ones, whose clearing costs little beside judging them. Else columns are kept, as after `keep_memory`.
    """
    mallopt = _of_libc("mallopt")
    if mallopt is not None:
        mallopt(_MMAP_THRESHOLD, _MIDDLE if faulty else _LARGE)


def return_freed() -> None:
    """Give back once what is free by now, where nobody else uses the process: what comes next is of another size."""
    trim = _of_libc("malloc_trim")
    if trim is not None:
        trim(0)


def return_memory() -> None:
    """Give back what is freed, where nobody else uses the process: for sessions without end, whose batches are small.

    Without that glibc keeps ever larger blocks for itself, and zeros that nobody has written take memory, too. What is
    free between blocks that live long is given back with the oldest garbage.
    """
    global _thresholds  # noqa: PLW0603 - a property of the process
    _thresholds = _IN_SESSIONS
    _tune(_SMALL, _SMALL)

    def trim_with(phase: str, about: dict[str, int]) -> None:
        if phase == "stop" and about["generation"] == _OLDEST:
            return_freed()

    if _ours:
        gc.callbacks.append(trim_with)


def end_start() -> None:
    """Let what the start has left behind go, where nobody else uses the process: from here on garbage is looked for."""
    if _ours:
        gc.collect()


def _tune(kept: int, large: int, arenas: int = _ARENAS) -> None:
    mallopt = _of_libc("mallopt")
    if mallopt is not None:
        mallopt(_TRIM_THRESHOLD, kept)
        mallopt(_MMAP_THRESHOLD, large)
        mallopt(_ARENA_MAX, arenas)


def _of_libc(name: str) -> Any:
    """Return a function of the C library, None where it has none, or where somebody else uses the process, too."""
    if not _ours:
        return None
    import ctypes  # noqa: PLC0415 - numpy imports it anyway

    return getattr(ctypes.CDLL(None), name, None)


class _Masked:
    """A kind of array of which there is none, as long as nobody imports it."""


class _Light(ModuleType):
    """Stands for a module until somebody asks for more of it than is needed here."""

    def __getattr__(self, name: str) -> Any:
        import importlib  # noqa: PLC0415

        if name.startswith("__"):
            raise AttributeError(name)
        if sys.modules.get(self.__name__) is self:
            del sys.modules[self.__name__]
        return getattr(importlib.import_module(self.__name__), name)

    @classmethod
    def put(cls, module: str, **content: Any) -> None:
        """Put it where the module would be, unless that is there."""
        if module not in sys.modules:
            sys.modules[module] = light = cls(module)
            light.__dict__.update(content)
            package, _, name = module.rpartition(".")
            if package in sys.modules:
                setattr(sys.modules[package], name, light)


class _Later:
    """A class that is imported once somebody makes one, derives another from it, or asks anything of it."""

    def __init__(self, found: Callable[[], Any]) -> None:
        self._found = found

    def __call__(self, *given: Any, **named: Any) -> Any:
        return self._found()(*given, **named)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._found(), name)

    def __mro_entries__(self, _: tuple[Any, ...]) -> tuple[Any, ...]:
        return (self._found(),)

    def __instancecheck__(self, one: Any) -> bool:
        return isinstance(one, self._found())

    def __subclasscheck__(self, one: Any) -> bool:
        return issubclass(one, self._found())

    def __or__(self, other: Any) -> Any:
        return self._found() | other

    def __ror__(self, other: Any) -> Any:
        return other | self._found()


class _Classes(_Light):
    """A module whose classes are imported when somebody needs one."""

    def __getattr__(self, name: str) -> Any:
        found = super().__getattr__
        is_class = name[:1].isupper() and not name.isupper()
        return _Later(lambda: found(name)) if is_class else found(name)


def plain_can() -> None:
    """Keep python-can and asyncio from importing what a bus hardly ever needs, where nobody else uses the process.

    That are all readers and writers of files, a bus for several threads, and OpenSSL. To be called before python-can
    is imported; whatever asks for them still gets them.
    """
    if not _ours:
        return
    import importlib.util  # noqa: PLC0415

    found = importlib.util.find_spec("can")
    if found is not None and found.submodule_search_locations:
        inside = [os.path.join(*found.submodule_search_locations, "io")]  # noqa: PTH118
        _Classes.put("can.io", __path__=inside)
        _Classes.put("can.thread_safe_bus")
    _Light.put("ssl")
    _Light.put("asyncio.sslproto")


def plain_arrow() -> None:
    """Keep Arrow from importing more than it needs, where nobody else uses the process.

    Where pandas is installed it would import that with the first list it is given: a quarter of a second for nothing.
    Afterwards Arrow takes a pandas object for any other one. The first `take` or `cast` would import `pyarrow.compute`,
    which writes the documentation of 286 functions: that takes half as long as all else of Arrow. To see that the first
    array is not masked it and numpy would import all of `numpy.ma`.
    """
    if not _ours:
        return
    import numpy as np  # noqa: PLC0415
    import pyarrow as pa  # noqa: PLC0415

    inside = [os.path.join(*np.__path__, "ma")]  # noqa: PTH118
    _Light.put("numpy.ma", __path__=inside, MaskedArray=_Masked, is_masked=lambda _: False)
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

    call = core.call_function

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

    others = {name: getattr(core, name) for name in ("Expression", "NullOptions", "call_function")}
    _Light.put("pyarrow.compute", take=take, filter=kept, cast=cast, **others)
