"""What programs of others write: python-can's messages and files, BLF as Vector has it, and pydronecan's values."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can
import dronecan
from dronecan import dsdl, transport

from analyzer._native import FrameBatch
from analyzer.decode.core import Totals
from analyzer.sources import Source
from analyzer.sources.formats import FORMATS
from kit.encode import Frame as SentFrame
from kit.rows import BRS, ESI, EXTENDED, FD, REMOTE, RX, TX, Fault, Frame, Record, records

if TYPE_CHECKING:
    import random
    from collections.abc import Iterable


WRITERS: dict[str, Any] = {
    ".asc": can.ASCWriter,
    ".trc": can.TRCWriter,
    ".csv": can.CSVWriter,
    ".blf": can.BLFWriter,
    ".mf4": can.MF4Writer,
}
NAMES = {
    ".asc": "Vector ASC",
    ".trc": "PEAK TRC",
    ".csv": "python-can CSV",
    ".blf": "Vector BLF",
    ".mf4": "MDF 4",
}
TEXT = (".asc", ".trc", ".csv")


def message(record: Record) -> can.Message:
    """As a python-can bus delivers it; bus can0 is channel 0."""
    common = {"timestamp": (record.t or 0) / 10**9, "channel": int(record.bus.removeprefix("can"))}
    if isinstance(record, Fault):
        return can.Message(
            arbitration_id=record.error,
            is_extended_id=False,
            is_error_frame=True,
            is_rx=not record.flags & TX,
            data=record.data,
            **common,
        )
    fd = bool(record.flags & FD)
    return can.Message(
        arbitration_id=record.id,
        is_extended_id=bool(record.flags & EXTENDED),
        is_remote_frame=bool(record.flags & REMOTE),
        is_fd=fd,
        bitrate_switch=bool(record.flags & BRS),
        error_state_indicator=bool(record.flags & ESI),
        is_rx=not record.flags & TX,
        dlc=record.code if record.flags & REMOTE else len(record.data),
        data=record.data,
        **common,
    )


class _Kept(io.BytesIO):
    """Keeps its bytes when a writer closes it."""

    name = "capture"
    kept = b""

    def close(self) -> None:
        self.kept = self.getvalue()
        super().close()


def library_file(suffix: str, found: Iterable[Record], **how: Any) -> bytes:
    """The bytes that python-can's writer makes of the frames."""
    file = _Kept()
    stream = io.TextIOWrapper(file, write_through=True) if suffix in TEXT else file
    with WRITERS[suffix](stream, **how) as writer:
        for record in found:
            writer(message(record))
    return file.kept


def pieces_of(suffix: str, data: bytes, size: int = 1 << 20) -> tuple[list[FrameBatch], Source]:
    """The pieces of a capture that comes in chunks of this size; each record is accounted for."""
    source = Source(f"capture{suffix}")
    source.format = next(form for form in FORMATS if form.name == NAMES[suffix])
    chunks = (data[at : at + size] for at in range(0, len(data), size))
    pieces = [piece for piece in source.reader()(source, chunks) if isinstance(piece, FrameBatch)]
    for piece in pieces:
        assert Totals(piece.lines).balanced
    return pieces, source


def frames(suffix: str, data: bytes, size: int = 1 << 20) -> list[Record]:
    return records(pieces_of(suffix, data, size)[0])


def total(pieces: Iterable[FrameBatch], name: str) -> int:
    return sum(piece.lines[name] for piece in pieces)


BLF_START = 1_600_000_000_000_000_000
CLASSIC, CONTAINER, ERROR_EXT, FD_MESSAGE, FD_64 = 1, 10, 73, 100, 101


def blf_file(*containers: bytes, size: int = 0) -> bytes:
    """As CANoe writes one; the start is 2020-09-13 12:26:40."""
    times = struct.pack("<8H", 2020, 9, 0, 13, 12, 26, 40, 0) * 2
    body = b"".join(containers)
    return struct.pack("<4sL8B2Q2L", b"LOGG", 144, 2, 12, 0, 3, 2, 6, 8, 1, size, 0, 0, 0) + times + bytes(72) + body


def blf_container(data: bytes, method: int = 2, packed: bytes | None = None) -> bytes:
    packed = (zlib.compress(data) if method == 2 else data) if packed is None else packed
    size = 32 + len(packed)
    head = struct.pack("<4sHHLL", b"LOBJ", 16, 1, size, CONTAINER) + struct.pack("<H6xL4x", method, len(data))
    return head + packed + bytes(size % 4)


def blf_object(kind: int, body: bytes, t: int = 0, flags: int = 2, version: int = 1) -> bytes:
    times = struct.pack("<LHHQ", flags, 0, 0, t) if version == 1 else struct.pack("<LBxHQ8x", flags, 0, 0, t)
    head = 16 + len(times)
    return struct.pack("<4sHHLL", b"LOBJ", head, version, head + len(body), kind) + times + body


def blf_message(t: int, number: int = 1, *, way: int = 0, channel: int = 1, code: int = 8, **how: int) -> bytes:
    return blf_object(CLASSIC, struct.pack("<HBBL8s", channel, way, code, number, bytes(range(8))), t, **how)


def blf_frame(t: int, number: int = 1, flags: int = RX, bus: str = "can0") -> Frame:
    return Frame(BLF_START + t, bus, number, flags, bytes(range(8)))


SPECS = Path(dronecan.__file__).parent / "dsdl_specs"
HALVES = [
    (kind, known)
    for (_, group), known in sorted(dronecan.DATATYPES.items())
    for kind in (("request", "response") if group == dsdl.CompoundType.KIND_SERVICE else ("message",))
]


def names_on_disk() -> set[str]:
    return {path.relative_to(SPECS).as_posix() for path in SPECS.rglob("[0-9]*.uavcan")}


def fill(value: Any, numbers: random.Random, how: str) -> None:
    """Random content for one of pydronecan's values; `how`: least, most or any."""
    if isinstance(value, transport.PrimitiveValue):
        bits = value._type.bitlen
        code = {"least": 0, "most": (1 << bits) - 1}.get(how, numbers.getrandbits(bits))
        value._bits = format(code, f"0{bits}b")
    elif isinstance(value, transport.ArrayValue):
        kind, limit = value._type, value._type.max_size
        items = value._ArrayValue__items
        if kind.mode == dsdl.ArrayType.MODE_DYNAMIC:
            count = {"least": 0, "most": limit}.get(how, numbers.randint(0, min(limit, numbers.choice((3, 12, limit)))))
            items[:] = [value.new_item() for _ in range(count)]
        for item in items:
            fill(item, numbers, how)
    elif isinstance(value, transport.CompoundValue):
        fields = transport.get_fields(value)
        if transport.is_union(value):
            name = numbers.choice(sorted(fields))
            transport.switch_union_field(value, name)
            fill(fields[name], numbers, how)
        else:
            for item in fields.values():
                fill(item, numbers, how)


def plain(value: Any) -> Any:
    """pydronecan's value as numbers, lists and dictionaries; of a union the member that is set."""
    if isinstance(value, transport.PrimitiveValue):
        return value.value
    if isinstance(value, transport.ArrayValue):
        return [plain(item) for item in value._ArrayValue__items]
    fields = transport.get_fields(value)
    if transport.is_union(value):
        name = transport.get_active_union_field(value)
        return {name: plain(fields[name])}
    return {name: plain(item) for name, item in fields.items() if not name.startswith("_void")}


def transfer(kind: str, value: Any, number: int, fd: bool) -> transport.Transfer:
    service = kind != "message"
    return transport.Transfer(
        payload=value, source_node_id=11, dest_node_id=22 if service else None, transfer_id=number % 32, canfd=fd,
        service_not_message=service, request_not_response=kind == "request", transfer_priority=number % 32,
    )  # fmt: skip


def frames_of(sent: transport.Transfer) -> list[SentFrame]:
    return [SentFrame(f.message_id, bytes(f.bytes), fd=f.canfd) for f in sent.to_frames()]


def new(known: Any, kind: str) -> Any:
    return known() if kind == "message" else getattr(known, kind.capitalize())()


def received(text: str) -> list[tuple[int, transport.Transfer]]:
    """(number of the last frame, transfer) of everything in a capture, as pydronecan reassembles it."""
    open_ones: dict[int, list[transport.Frame]] = {}
    found = []
    for number, row in enumerate(text.splitlines(), 1):
        ident, _, data = row.split()[2].partition("#")
        frame = transport.Frame(int(ident, 16), bytes.fromhex(data), canfd=False)
        waiting = open_ones.setdefault(frame.message_id, [])
        waiting.append(frame)
        if frame.end_of_transfer:
            transfer = transport.Transfer()
            transfer.from_frames(open_ones.pop(frame.message_id))
            found.append((number, transfer))
    return found
