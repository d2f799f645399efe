"""`-T fields -e NAME`: tab-separated values by the names of display filters, one line a transfer."""

from __future__ import annotations

import difflib
import json
from typing import TYPE_CHECKING, Any

from analyzer.decode.readings import reading_column
from analyzer.facts.json_number import number
from analyzer.tables import KINDS, STATUSES
from analyzer.views.members import cells
from analyzer.views.rows import TransferRows
from analyzer.views.terminal import escape
from analyzer.views.times import TimeFormat
from analyzer.window.numbering import Numbering
from dissectors import UnknownNameError
from dissectors.notes import columns

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.views.frames.window import FrameData, RawFrame
    from analyzer.window.listed import ListedRows
    from dissectors import Registry
    from dissectors.schema import Message, Packet

_FIXED = {
    "frame.number": "number of the first frame, from 1",
    "frame.time_epoch": "seconds since 1970",
    "frame.time_relative": "seconds since the first frame of the capture",
    "frame.time_delta": "seconds since the previous transfer",
    "frame.interface_name": "interface",
    "can.id": "identifier",
    "can.len": "data bytes, tail byte included",
    "can.flags.xtd": "1: 29-bit identifier",
    "can.flags.rtr": "1: remote frame",
    "can.flags.err": "1: error frame",
    "dronecan.src": "source node; 0 when anonymous, and of a sender without an ID",
    "dronecan.dst": "destination node of a service",
    "dronecan.priority": "0 is highest",
    "dronecan.type_id": "data type ID",
    "dronecan.type": "data type",
    "dronecan.kind": "message, anonymous, request or response",
    "dronecan.transfer_id": "transfer ID",
    "dronecan.status": "what became of the transfer",
}
_OF_MESSAGES = ("bits_left", "trusted")
_OF_PACKETS = ("packet_ok", "header_ok", "length_ok", "checksum_ok", "checksum_end", "count_step", "count_step_id")
_TIMES = {"frame.time_epoch": "e", "frame.time_relative": "r", "frame.time_delta": "d"}

Column = tuple[str, str]  # a message or packet table and a column of it


class Fields:
    """Writes the fields `names`, as the writers of `records` do; several values of a cell are joined by commas.

    Numbers are those of the tables (physical), enumerations their number, flags 1 or 0, arrays all their elements. A
    field that a transfer does not have is empty.

    Raises `ValueError` for a name that does not exist, with near ones.
    """

    def __init__(
        self,
        registry: Registry,
        names: Sequence[str],
        frame_data: FrameData,
        zero: int | None = None,
        *,
        header: bool = False,
        numbering: Numbering | None = None,
    ) -> None:
        self._registry = registry
        self._names = list(names)
        self._columns = {name: find(registry, name) for name in names if name not in _FIXED}
        self._frame_data = frame_data
        self._clocks = {name: TimeFormat(mode, digits=9) for name, mode in _TIMES.items()}
        self._clocks["frame.time_relative"].zero = zero
        self._header = header
        self._numbering = numbering or Numbering()

    def begin(self) -> str:
        """Write the names, if asked for."""
        return "\t".join(self._names) + "\n" if self._header else ""

    def rows(self, batch: Batch, picked: ListedRows | None = None) -> Iterator[str]:
        """Write a line for each picked transfer (all if not given)."""
        for clock in self._clocks.values():
            clock.start(batch.frames)
        rows = TransferRows(batch, self._registry, picked and picked.transfers)
        cells_ = [self._fixed(rows, n) if n in _FIXED else _found(rows, self._columns[n]) for n in self._names]
        for row in zip(*cells_, strict=True):
            yield "\t".join(row) + "\n"

    def end(self) -> str:
        """Write nothing: nothing stands behind the last line."""
        return ""

    def _fixed(self, rows: TransferRows, name: str) -> list[str]:
        if name in _TIMES:
            return self._clocks[name].column(rows.all_times(), rows.picked.tolist())
        if name == "frame.number":
            return [str(self._numbering.of(number - 1)) for number in rows.first_frames()]
        if name == "frame.interface_name":
            names = [escape(bus) for bus in rows.batch.buses]
            return [names[bus] for bus in rows.column("bus")]
        if name.startswith("can."):
            return [self._of_frames(frames, _FRAME[name.removeprefix("can.")]) for frames in rows.column("frame")]
        if name == "dronecan.type":
            return ["" if m is None else m.name for m in rows.messages]
        column = name.removeprefix("dronecan.")
        texts = {"kind": KINDS, "status": STATUSES}.get(column)
        return [_text(value if texts is None else texts[value]) for value in rows.column(column)]

    def _of_frames(self, numbers: Sequence[int], read: Callable[[RawFrame], int]) -> str:
        """Write one value if all frames agree, else one for each."""
        frames = [self._frame_data(n) for n in numbers]
        values = ["" if frame is None else str(read(frame)) for frame in frames]
        return values[0] if len(set(values)) == 1 else ",".join(values)


_FRAME: dict[str, Callable[[RawFrame], int]] = {
    "id": lambda frame: frame.id,
    "len": lambda frame: len(frame.data),
    "flags.xtd": lambda frame: int(frame.flag("xtd")),
    "flags.rtr": lambda frame: int(frame.flag("rtr")),
    "flags.err": lambda frame: int(frame.flag("err")),
}


def find(registry: Registry, name: str) -> Column:
    """Find the table and column of `<Message>.<field>[.<part>]` or `<Message>.<Packet>.<field>[.<part>]`.

    Raises `ValueError` with near names for one that does not exist.
    """
    words = name.split(".")
    for cut in range(len(words) - 1, 0, -1):
        try:
            message = registry.resolve(".".join(words[:cut]))
        except UnknownNameError as error:
            if any(candidate.endswith(f".{'.'.join(words[:cut])}") for candidate in error.candidates):
                raise ValueError(f"no field {name!r}: {error}") from None  # ambiguous, not unknown
            continue
        rest = words[cut:]
        packet = next((p for p in (message.packets.packets if message.packets else ()) if p.name == rest[0]), None)
        if packet is not None and len(rest) > 1:
            return _column(f"{message.table}.{packet.name}", packet, ".".join(rest[1:]), _measured(packet), name)
        return _column(message.table, message, ".".join(rest), _about(message), name)
    near = difflib.get_close_matches(name, [*_FIXED, *registry.names()], n=3, cutoff=0.5)
    raise ValueError(f"no field {name!r}" + _near(near))


def _column(table: str, of: Message | Packet, column: str, extra: Sequence[str], name: str) -> Column:
    known = {own: own for own in (*_own(of), *extra)}
    for field, note in of.notes.items():
        if note.name:
            known |= {note.name + own.removeprefix(field): own for own in _own(of) if _within(own, field)}
    if column not in known:
        near = difflib.get_close_matches(column, known, n=3, cutoff=0.5)
        raise ValueError(f"no field {name!r}" + _near([f"{name.removesuffix(column)}{n}" for n in near]))
    return table, known[column]


def _within(column: str, field: str) -> bool:
    return column == field or column.startswith(f"{field}.")


def _near(names: Sequence[str]) -> str:
    return f"; did you mean {', '.join(names)}?" if names else ""


def _own(of: Message | Packet) -> Iterator[str]:
    yield from (name for name, _ in columns(of.layout, of.notes))
    for field, note in of.notes.items():
        yield from [f"{field}.text"] if note.text else []
        yield from [f"{field}.value", f"{field}.unit"] if note.unit_by is not None else []
    yield from (derived.name for derived in of.derived)


def field_names(registry: Registry) -> Iterator[str]:
    """Give every name that `-e` takes. Compiles every type the registry knows."""
    yield from _FIXED
    for table in registry.names():
        message = registry.resolve(table)
        yield from (f"{table}.{column}" for column in _own(message))
        yield from (f"{table}.{column}" for column in _about(message)[len(_OF_MESSAGES) :])
        for packet in message.packets.packets if message.packets else ():
            yield from (f"{table}.{packet.name}.{column}" for column in (*_own(packet), *_measured(packet)))


def _about(message: Message) -> Sequence[str]:
    """Give columns about a message; only one that has doubtful fields says how they are read."""
    readings = [reading_column(reading.name) for reading in message.readings]
    return (*_OF_MESSAGES, *readings, "decided") if readings else _OF_MESSAGES


def _measured(packet: Packet) -> Sequence[str]:
    """Give columns about a packet; only one that has numbers has a byte order."""
    return (*_OF_PACKETS, "big_endian", "decided") if packet.numbers else _OF_PACKETS


def _found(rows: TransferRows, column: Column) -> list[str]:
    table, name = column
    texts: list[list[str]] = [[] for _ in range(len(rows))]
    for part in (*rows.typed, *rows.packets):
        if part.name == table and part.of is not None:
            for at, value in zip(part.at, cells(part, name), strict=True):
                texts[at].append(_text(value))
    return [",".join(some) for some in texts]


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "1" if value else "0"
    if isinstance(value, float):
        return str(number(value))
    if isinstance(value, list):
        return ",".join(map(_text, value))
    if isinstance(value, dict):
        return json.dumps(value, separators=(",", ":"))
    return escape(str(value))
