"""Several captures as one: named, shifted in time, merged in the order of their frames."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import TYPE_CHECKING

from analyzer._native import Merger
from analyzer.sources import Source
from analyzer.sources.clocks import align
from analyzer.sources.errors import CaptureError, MergeError
from analyzer.sources.native import rows

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer._native import FrameBatch
    from analyzer.sources.origin import FileObject, Origin


@dataclass(frozen=True, slots=True)
class Plan:
    """The names, clocks and buses that a person gives to captures.

    `names` maps what stands behind `--bus NAME=` (a capture, an interface, or CAPTURE:INTERFACE) to the name; `offsets`
    maps a capture to the nanoseconds to add to its times. With `same_bus` all of them recorded one bus.
    """

    names: dict[str, str] = field(default_factory=dict)
    offsets: dict[str, int] = field(default_factory=dict)
    same_bus: bool = False

    def __bool__(self) -> bool:
        """Return whether even a single capture is changed by it."""
        return bool(self.names or self.offsets or self.same_bus)


class Merged:
    """Reads captures side by side; to the rest of the program it is one `Source`.

    Args:
        parts: the captures, each of them not read yet.
        plan: names and offsets.
        found: the offsets that an earlier reading found, by capture; None looks for them.
    """

    def __init__(self, parts: Sequence[Source], plan: Plan, found: dict[int, tuple[int, int]] | None = None) -> None:
        self.parts = tuple(parts)
        self.plan = plan
        self.found = found
        self._stopped = False
        # By capture: names of its interfaces so far, and how many records it has had.
        self._seen: list[list[str]] = []
        self._rows: list[int] = []

    @property
    def name(self) -> str:
        """All names."""
        return ", ".join(part.name for part in self.parts)

    @property
    def live(self) -> bool:
        """True if some of the bytes exist only once."""
        return any(part.live for part in self.parts)

    @property
    def waits(self) -> bool:
        """True while the reading waits for bytes."""
        return any(part.waits for part in self.parts)

    @property
    def stopped(self) -> bool:
        """True if the reading was ended on purpose."""
        return self._stopped

    @stopped.setter
    def stopped(self, value: bool) -> None:
        self._stopped = value
        for part in self.parts:
            part.stopped = value

    @property
    def damage(self) -> CaptureError | None:
        """The first capture that could not be read to its end."""
        return next((part.damage for part in self.parts if part.damage is not None), None)

    @property
    def size(self) -> int:
        """Bytes read so far."""
        return sum(part.size for part in self.parts)

    @property
    def length(self) -> int | None:
        """Bytes there are to read, if that is known."""
        lengths = [part.length for part in self.parts]
        return None if None in lengths else sum(length or 0 for length in lengths)

    def again(self) -> Merged:
        """Return the same captures once more."""
        return Merged([part.again() for part in self.parts], self.plan, self.found)

    def chunks(self) -> Iterator[bytes | FrameBatch]:
        """Batches of the merged rows. Raises `MergeError`, and `CaptureError` when a capture cannot be opened."""
        merger = Merger(self._entries(), self.plan.same_bus)
        self._seen, self._rows = [[] for _ in self.parts], [0] * len(self.parts)
        streams = [rows(part.chunks()) for part in self.parts]
        while (index := merger.awaited) is not None:
            batch = next(streams[index], None)
            if isinstance(batch, bytes):
                yield b""
                continue
            if batch is None:
                merger.finish(index)
            else:
                merger.push(index, batch, self._label(self.parts[index]))
                self._seen[index] = batch.buses
                self._rows[index] += batch.lines["lines"]
            yield merger.take()

    @property
    def problem(self) -> str | None:
        """After the reading: what was asked for and is not in these captures."""
        interfaces = sorted({name for names in self._seen for name in names})
        for where, name in self.plan.names.items():
            capture, _, interface = where.rpartition(":")
            inside = [
                names for part, names in zip(self.parts, self._seen, strict=True) if is_capture(capture, part.name)
            ]
            whole = any(is_capture(where, part.name) for part in self.parts)
            if not (whole or where in interfaces or any(interface in names for names in inside)):
                return f"--bus {name}={where}: no such capture or interface (there is {', '.join(interfaces)})"
        return None

    @property
    def empty(self) -> list[str]:
        """After the reading: the captures without a single record."""
        return [part.name for part, rows_ in zip(self.parts, self._rows, strict=True) if not rows_ and not part.damage]

    def _label(self, part: Source) -> str:
        return f"{part.name}: {part.unit}" if len(self.parts) > 1 else ""

    def _entries(self) -> list[tuple[int, list[tuple[str | None, str]]]]:
        given = dict(self._given())
        if self.found is None:
            self.found = {}
            if len(self.parts) > 1 and all(part.repeatable for part in self.parts):
                self.found = align([part.again() for part in self.parts], given, lambda: self._stopped)
        for index, (offset, frames) in self.found.items():
            self.parts[index].notes.append(f"times shifted by {offset / 1e9:+.6f} s, as {frames} common frames show")
        offsets = {index: offset for index, (offset, _) in self.found.items()} | given
        return [(offsets.get(index, 0), list(self._names(part.name))) for index, part in enumerate(self.parts)]

    def _given(self) -> Iterator[tuple[int, int]]:
        for name, offset in self.plan.offsets.items():
            found = [index for index, part in enumerate(self.parts) if is_capture(name, part.name)]
            if not found:
                raise MergeError(f"--offset {name}: no such capture among {self.name}")
            yield from ((index, offset) for index in found)

    def _names(self, path: str) -> Iterator[tuple[str | None, str]]:
        """Return new names of this capture's interfaces, the most particular ones first."""
        general: list[tuple[str | None, str]] = []
        for where, name in self.plan.names.items():
            capture, _, interface = where.rpartition(":")
            if is_capture(where, path):
                general.append((None, name))
            elif is_capture(capture, path):
                yield interface, name
            elif not any(is_capture(part, other.name) for part in (where, capture) for other in self.parts):
                general.insert(0, (where, name))
        yield from general


def open_captures(
    origins: Sequence[Origin | FileObject], plan: Plan | None = None, *, follow: bool = False
) -> Source | Merged:
    """Return one capture as it is, several or renamed ones merged. Nothing is read yet."""
    if len(origins) == 1 and not plan:
        return Source(origins[0], follow=follow)
    return Merged([Source(one, follow=follow) for one in origins], plan or Plan())


def is_capture(name: str, path: str) -> bool:
    """Return whether a person means this capture by that name: its path or its last part."""
    return name in (path, PurePath(path).name)


def bus_name(text: str) -> tuple[str, str]:
    """`NAME=CAPTURE`, `NAME=INTERFACE` or `NAME=CAPTURE:INTERFACE`: what is named, and the name. Raises ValueError."""
    name, equals, where = text.partition("=")
    if not equals or not where or not re.fullmatch(r"[\x21-\x7e]{1,64}", name):
        raise ValueError(f"{text!r} is not NAME=CAPTURE, NAME=INTERFACE or NAME=CAPTURE:INTERFACE")
    return where, name
