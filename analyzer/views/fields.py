"""`-T fields -e NAME`: tab-separated values by the names of display filters, one line a transfer."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING

import pyarrow as pa

from analyzer.decode.told import reading_column
from analyzer.tables import KINDS, STATUSES
from analyzer.views.json_fields import HEX, structure_template
from analyzer.views.members import ALL, PLAIN, CellTemplates
from analyzer.views.pick import Pick
from analyzer.views.sheets import Sheets, type_column, types_of
from analyzer.views.terminal import escape
from analyzer.views.times import TimeFormat
from analyzer.window.first_frames import first_frames
from analyzer.window.numbering import Numbering
from dissectors import UnknownNameError
from dissectors.kit.cells import pylist
from dissectors.notes import columns

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.views.frames.window import FrameData, RawFrame
    from analyzer.views.members import Take
    from analyzer.views.sheets import SheetColumns, Template
    from analyzer.window.listed import ListedRows
    from dissectors import Registry
    from dissectors.schema import Message, Packet

_FIXED = {
    "frame.number": "number of the first frame, from 1",
    "frame.time": "date and time, local",
    "frame.time_epoch": "seconds since 1970",
    "frame.time_relative": "seconds since the first frame of the capture",
    "frame.time_delta": "seconds since the previous transfer",
    "frame.interface_name": "interface",
    "can.id": "identifier",
    "can.len": "data bytes, tail byte included",
    "can.flags.xtd": "1: 29-bit identifier",
    "can.flags.rtr": "1: remote frame",
    "can.flags.err": "1: error frame",
    "frame.data": "bytes, tail byte included",
    "dronecan.src": "source node; 0 when anonymous, and of a sender without an ID",
    "dronecan.dst": "destination node of a service",
    "dronecan.priority": "0 is highest",
    "dronecan.type_id": "data type ID",
    "dronecan.type": "data type",
    "dronecan.kind": "message, anonymous, request or response",
    "dronecan.transfer_id": "transfer ID",
    "dronecan.status": "what became of the transfer",
    "payload": "bytes of the transfer, without CRC and tail bytes",
}
_SHORT = {"src": "dronecan.src", "dst": "dronecan.dst", "data.data": "frame.data"}
_OF_MESSAGES = ("bits_left", "trusted")
_OF_PACKETS = ("packet_ok", "header_ok", "length_ok", "checksum_ok", "checksum_end", "count_step", "count_step_id")
_TIMES = {"frame.time_epoch": "e", "frame.time_relative": "r", "frame.time_delta": "d"}

_TYPE = "type"  # places in the list of names of types
_WORDS = ("frame.interface_name", "dronecan.type")  # whose words are given with each batch

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
        self._columns = {name: named(registry, name) for name in names if fixed(name) not in _FIXED}
        self._frame_data = frame_data
        self._clocks = {name: TimeFormat(mode, digits=9) for name, mode in _TIMES.items()}
        self._clocks["frame.time_relative"].zero = zero
        self._dates = TimeFormat("ad", digits=9)
        self._header = header
        self._numbering = numbering or Numbering()
        self._messages = {table for table, _ in self._columns.values() if registry.message_of(table) is not None}
        self._sheets = Sheets(registry, self._row, self._part, {**_BESIDE, _TYPE: pa.uint32()}, escaped=True)

    def begin(self) -> str:
        """Write the names, if asked for."""
        return "\t".join(self._names) + "\n" if self._header else ""

    def rows(self, batch: Batch, picked: ListedRows | None = None) -> Iterator[str]:
        """Write a line for each picked transfer (all if not given)."""
        for clock in self._clocks.values():
            clock.start(batch.frames)
        pick = Pick(batch, picked and picked.transfers)
        beside = {name: self._beside(pick, name) for name in map(fixed, self._names) if name in _BESIDE}
        batch, rows = pick.batch, pick.rows
        types, places = type_column(batch, self._registry)
        words = [[escape(bus) for bus in batch.buses], ["" if m is None else m.name for m in types]]
        return self._sheets.texts(batch, rows, types_of(types, places, rows), beside | {_TYPE: places}, words)

    def end(self) -> str:
        """Write nothing: nothing stands behind the last line."""
        return ""

    def _row(self, columns: SheetColumns) -> Template:
        parts: list[Template] = []
        for place, name in enumerate(self._names):
            parts.append(("text", "\t" if place else ""))
            own = name in self._columns
            parts.append(self._cell(place, self._columns[name][0]) if own else self._fixed(columns, fixed(name)))
        return ("all", [*parts, ("text", "\n")])

    def _fixed(self, columns: SheetColumns, name: str) -> Template:
        if name in _TIMES:
            return columns.of(name, ("number", PLAIN, ("seconds", False, True)))
        if name in _WORDS:
            return columns.of(_TYPE if name == "dronecan.type" else "bus", ("word", _WORDS.index(name)))
        if name in _BESIDE:
            return columns.of(name, _NUMBER if name == "frame.number" else ("or", "", ("copy",)))
        if name == "payload":
            return columns.of(name, HEX)
        column = name.removeprefix("dronecan.")
        texts = {"kind": KINDS, "status": STATUSES}.get(column, ())
        cases = [(value, ("text", text)) for value, text in enumerate(texts)]
        return columns.of(column, ("switch", PLAIN, cases, _NUMBER))

    def _cell(self, place: int, table: str) -> Template:
        """Return a template of what messages or packets have; a transfer may have several packets."""
        inside: Template = ("packets", place, ",", True)
        return ("message", place, "") if table in self._messages else inside

    def _part(self, table: str, of: Message | Packet | None, columns: SheetColumns) -> list[Template | None]:
        found = [self._columns.get(name) for name in self._names]
        return [
            None if of is None or one is None or one[0] != table else _CELLS.column(of, columns, one[1])
            for one in found
        ]

    def _beside(self, pick: Pick, name: str) -> pa.Array:
        """Return a column that is no column of a table."""
        transfers = pick.batch.transfers
        if name in _TIMES:
            return pick.elapsed(self._clocks[name])
        if name == "frame.time":
            return self._dates.dates(transfers.column("t"))
        if name == "frame.number":
            return pa.array(self._numbering.of_all(first_frames(transfers)))
        frames = pylist(transfers.column("frame"))
        return pa.array([self._of_frames(some, _FRAME[name]) for some in frames], pa.string())

    def _of_frames(self, numbers: Sequence[int], read: Callable[[RawFrame], int | str]) -> str:
        """Write one number if all frames agree, else what each has."""
        frames = [self._frame_data(n) for n in numbers]
        values = ["" if frame is None else read(frame) for frame in frames]
        agree = len(set(values)) == 1 and isinstance(values[0], int)
        return str(values[0]) if agree else ",".join(map(str, values))


_FRAME: dict[str, Callable[[RawFrame], int | str]] = {
    "can.id": lambda frame: frame.id,
    "can.len": lambda frame: len(frame.data),
    "can.flags.xtd": lambda frame: int(frame.flag("xtd")),
    "can.flags.rtr": lambda frame: int(frame.flag("rtr")),
    "can.flags.err": lambda frame: int(frame.flag("err")),
    "frame.data": lambda frame: frame.data.hex().upper(),
}
_BESIDE = {
    **dict.fromkeys(_TIMES, pa.int64()),
    "frame.number": pa.int64(),
    "frame.time": pa.string(),
    **dict.fromkeys(_FRAME, pa.string()),
}


def fixed(name: str) -> str:
    """Return a name of what every row has as it is in full."""
    return _SHORT.get(name, name)


def named(registry: Registry, name: str) -> Column:
    """Find the table and column of a name as filters have it, too: any ending that only one field of a type has.

    Raises `ValueError` for what does not exist.
    """
    try:
        return find(registry, name)
    except ValueError as error:
        from analyzer.filter.fields import FIXED, MEANT  # noqa: PLC0415
        from analyzer.filter.language.errors import FilterError  # noqa: PLC0415 - most names are those of tables
        from analyzer.filter.names import FilterNames  # noqa: PLC0415

        if "," in name:
            raise ValueError(
                f"one field for each -e: {' '.join(f'-e {one}' for one in name.split(','))[:80]}"
            ) from None
        if name in FIXED:
            hint = str(error).removeprefix(f"no field {name!r}")
            raise ValueError(f"{name!r} is a field of filters, not of -e{hint}") from None
        if meant := [one for one in MEANT.get(name.lower(), ()) if fixed(one) in _FIXED]:
            raise ValueError(f"no field {name!r}" + _near(meant)) from None
        try:
            ref = FilterNames(registry).find(name, name, 0)
        except FilterError as unknown:
            raise (ValueError(unknown.reason) if len(unknown.candidates) > 1 else error) from None
        if ref.origin != "table":
            raise
        column = ".".join((ref.column, *ref.path))
        if len(ref.tables) > 1:
            every = ", ".join(f"{table}.{column}" for table in ref.tables)
            raise ValueError(f"no field {name!r}: it may be any of {every}") from None
        return ref.tables[0], column


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
    known |= {field: f"{field}.text" for field, note in of.notes.items() if note.text and f"{field}.text" in known}
    for field, note in of.notes.items():
        if note.name:
            known |= {note.name + own.removeprefix(field): own for own in _own(of) if _within(own, field)}
    if column not in known:
        near = difflib.get_close_matches(column, known, n=3, cutoff=0.5)
        raise ValueError(f"no field {name!r}" + _near([f"{name.removesuffix(column)}{n}" for n in near]))
    return table, known[column]


def texts_among(registry: Registry, names: Iterable[str]) -> Iterator[str]:
    """Yield those of some names that are of texts on the bus."""
    for name in names:
        if fixed(name) in _FIXED:
            continue
        table, column = named(registry, name)
        of = registry.definition(table)
        note = None if of is None else of.notes.get(column.removesuffix(".text"))
        if note is not None and note.text:
            yield name


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


def _single(kind: pa.DataType, take: Take) -> Template:
    if pa.types.is_struct(kind):
        return structure_template(kind)
    return ("copy",) if pa.types.is_string(kind) else ("number", take, ("json", "0", "1", False))


_NUMBER: Template = ("number", PLAIN, ("plain",))
_CELLS = CellTemplates("", _single, lambda element: ("each", ",", ALL, "", element))
