"""The tables that flow through the pipeline: their columns, types and meaning, in one place.

Read this file first. A stage takes one of these tables and returns the next one; a row points back to the rows it came
from (`frame`, `transfer`) and never forward. Rows are numbered through the whole capture, from 0; `Batch.first_frame`
and `Batch.first_transfer` are the numbers of a batch's first rows. People are shown frame numbers from 1.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy.typing as npt

MOST_COUNTED = 1 << 16  # numbers in a row, rather than to sort what occurs of them
KINDS = ("message", "anonymous", "request", "response")
VERDICTS = (
    "used",  # exactly one transfer names the frame
    "foreign",  # not DroneCAN, as far as can be told
    "no tail",  # DroneCAN identifier, but no data field
    "orphan",  # continues a transfer of which no start was seen
    "wrong toggle",  # part of a transfer that began with toggle 1
    "wrong transfer id",  # continues a transfer ID that is not under way, while another one is
    "anonymous multi",  # an anonymous transfer must be a single frame
    "duplicate",  # repeats the frame before it byte for byte
)
STATUSES = (
    "ok",
    "unchecked",  # complete, but the type is unknown, so its CRC cannot be judged
    "bad crc",
    "interrupted",  # a frame is missing or out of order, or a new transfer began
    "timed out",  # no end within 2.0 s of the start
    "too short",  # complete, but too short to hold a CRC
    "open",  # the capture ends inside it
)
EVENTS = ("error frame", "drop", "gap", "unreadable", "comment", "frame comment")

# Kinds of time stamps in a capture, bits of Engine.stamps, lowest first.
STAMPS = (
    "absolute",
    "dates without a zone, read as UTC",
    "counted from the first line",
    "differences, added up",
    "none",
    "microseconds",
    "nanoseconds",
)

# Bits of frames.flags; bits 8 to 11 hold the length code of a remote frame, or a raw one above 8.
EXTENDED, REMOTE, ERROR, FD, BRS, ESI, TX, RX = (1 << bit for bit in range(8))
# Bits of the tail byte, the last one of a frame: start of transfer, end of transfer, toggle, transfer ID.
TAIL_START, TAIL_END, TAIL_TOGGLE, TAIL_ID = 0x80, 0x40, 0x20, 0x1F
TRANSFER_IDS = 32

# Bits of frames.anomaly, lowest first; the rule that reads the bit stands behind it.
FRAME_ANOMALIES = (
    "remote",  # CAN-002
    "no tail",  # CAN-005
    "impossible length",  # CAN-019
    "start toggle",  # TRF-002
    "toggle",  # TRF-003, the frame at which the sequence broke
    "time backwards",  # CAP-001
    "cyphal",  # toggles start at 1 throughout, once an identifier
    "limit",  # a bound of the analyzer was reached
)
# Bits of transfers.anomaly, likewise.
TRANSFER_ANOMALIES = (
    "single toggle",  # TRF-001
    "toggle",  # TRF-003
    "duplicate frame",  # TRF-004
    "abandoned",  # TRF-006
    "timeout",  # TRF-007
    "slow",  # TRF-007, a note: longer than 1.0 s
    "crc",  # TRF-010
    "frame not full",  # TRF-012
    "last frame empty",  # TRF-013
    "first frame too short",  # TRF-014
    "needless multi",  # TRF-015
    "transfer id gap",  # TRF-016
    "duplicate",  # TRF-017
    "transfer id repeated",  # TRF-018
    "transfer id restarted",  # TRF-019
    "interleaved",  # TRF-026
    "pause",  # TRF-027
    "long",  # TRF-029
    "priority changed",  # CAN-014
    "destination zero",  # CAN-006
    "source zero",  # CAN-007
    "addressed to itself",  # CAN-012
    "can fd",  # CAN-003
    "cut by end",  # TRF-008
    "limit",
    "other type",  # CAN-020, the CRC is that of another type with this ID
)

_NS = pa.timestamp("ns")


def _field(name: str, kind: pa.DataType, about: str) -> pa.Field:
    return pa.field(name, kind, metadata={"about": about})


FRAMES = pa.schema([
    _field("t", _NS, "capture time; null when the capture has none"),
    _field("bus", pa.uint8(), "index of the interface name"),
    _field("id", pa.uint32(), "identifier, 11 or 29 bits"),
    _field("flags", pa.uint16(), "bits EXTENDED, REMOTE, ERROR, FD, BRS, ESI, TX, RX, length code"),
    _field("line", pa.uint32(), "line or record of the capture, from 1"),
    _field("data", pa.binary(), "data field, tail byte included"),
    _field("verdict", pa.uint8(), "index into VERDICTS"),
    _field("anomaly", pa.uint16(), "bits of FRAME_ANOMALIES"),
])  # fmt: skip

TRANSFERS = pa.schema([
    _field("t", _NS, "time of the first frame"),
    _field("t_end", _NS, "time of the last frame"),
    _field("bus", pa.uint8(), "index of the interface name"),
    _field("kind", pa.uint8(), "index into KINDS"),
    _field("type_id", pa.uint16(), "data type ID; of an anonymous transfer its low 2 bits"),
    _field("variant", pa.uint8(), "which of the known types with this ID, 0 the preferred one; the CRC decides"),
    _field("src", pa.uint8(), "source node ID; 0 when anonymous, and of a sender without one"),
    _field("dst", pa.uint8(), "destination node ID of a service transfer"),
    _field("priority", pa.uint8(), "0 (highest) to 31"),
    _field("transfer_id", pa.uint8(), "0 to 31"),
    _field("status", pa.uint8(), "index into STATUSES"),
    _field("crc_wire", pa.uint16(), "transfer CRC as received; null for a single frame"),
    _field("crc_here", pa.uint16(), "transfer CRC as computed; null when the type is unknown"),
    _field("step", pa.uint8(), "transfer ID minus the previous one of the session, modulo 32; 1 is the rule"),
    _field("gap", pa.duration("ns"), "time since the previous transfer of the session, start to start"),
    _field("anomaly", pa.uint32(), "bits of TRANSFER_ANOMALIES"),
    _field("fd", pa.bool_(), "came as CAN FD: no tail array optimisation, padding possible"),
    _field("frame", pa.list_(pa.uint64()), "numbers of its frames, from 0"),
    _field("payload", pa.binary(), "payload without CRC; CAN FD padding is still there"),
])  # fmt: skip

EVENT_ROWS = pa.schema([
    _field("t", _NS, "capture time"),
    _field("bus", pa.uint8(), "index of the interface name"),
    _field("line", pa.uint32(), "line or record of the capture, from 1"),
    _field("kind", pa.uint8(), "index into EVENTS"),
    _field("class", pa.uint32(), "error class bits (linux/can/error.h), or the number of frames dropped"),
    _field("flags", pa.uint16(), "bits TX, RX of an error frame"),
    _field("tx_errors", pa.uint8(), "transmit error counter"),
    _field("rx_errors", pa.uint8(), "receive error counter"),
    _field("data", pa.binary(), "data field of an error frame, else empty"),
    _field("text", pa.string(), "reason and excerpt of an unreadable line, or the comment"),
])  # fmt: skip

SETTLED = pa.schema([
    _field("frame", pa.uint64(), "number of a frame of an earlier batch"),
    _field("verdict", pa.uint8(), "its final verdict"),
    _field("anomaly", pa.uint16(), "bits to add to its anomalies"),
])  # fmt: skip

FINDINGS = pa.schema([
    _field("finding", pa.uint32(), "number in the order of the report, worst first, from 1"),
    _field("rule", pa.string(), "name of the rule, such as TRF-003"),
    _field("title", pa.string(), "the rule in words"),
    _field("severity", pa.string(), "error, warning or note"),
    _field("category", pa.string(), "whose fault it is: protocol, device or capture"),
    _field("origin", pa.string(), "what states the rule: document, implied, dronecan, heuristic or vehicle"),
    _field("clause", pa.string(), "clause of the document"),
    _field("t", _NS, "time of the first occurrence; null when it has none"),
    _field("t_end", _NS, "time of the last occurrence; null when it has none"),
    _field("bus", pa.uint8(), "index of the interface name; null for what is of the whole capture"),
    _field("node", pa.uint8(), "node ID of who broke the rule; null for nobody in particular"),
    _field("label", pa.string(), "the ESC as people call it, such as ch6"),
    _field("type", pa.string(), "data type"),
    _field("key", pa.string(), "what else tells it apart from findings of the same rule"),
    _field("cause", pa.string(), "the diagnosis in a word"),
    _field("text", pa.string(), "what is wrong, of the first occurrence or of all of them"),
    _field("count", pa.uint64(), "occurrences"),
    _field("frame", pa.uint64(), "number of the frame of the first occurrence, from 0; null when it has none"),
    _field("frame_end", pa.uint64(), "number of the frame of the last occurrence, from 0"),
    _field("transfer", pa.uint64(), "number of the transfer that holds `frame`, from 0; null when none does"),
    _field("frames", pa.list_(pa.uint64()), "numbers of the frames of the first occurrences, from 0"),
    _field("transfers", pa.list_(pa.uint64()), "numbers of the transfers that hold them, from 0"),
    _field("waived", pa.bool_(), "a waiver of the vehicle file excuses it"),
])  # fmt: skip


def _quantity(name: str, kind: pa.DataType, unit: str, about: str) -> pa.Field:
    return pa.field(name, kind, metadata={"unit": unit, "about": about})


ESC = pa.schema([
    _field("transfer", pa.uint64(), "number of the transfer that is the report, from 0"),
    _field("t", _NS, "time of the report's first frame; null when the capture has none"),
    _field("bus", pa.uint8(), "index of the interface name"),
    _field("node", pa.uint8(), "node ID of the ESC"),
    _field("ch", pa.int32(), "channel as people count them, from 1; null while nobody has told it"),
    _field("type", pa.string(), "data type of the report"),
    _quantity("commanded", pa.float32(), "%", "what was commanded last before the report began; null for nothing"),
    _field("command_age", pa.duration("ns"), "time from the first frame of that command to the report's first"),
    _quantity("reported", pa.float32(), "%", "what the ESC says it was commanded"),
    _quantity("rpm", pa.float32(), "rpm", "speed"),
    _quantity("voltage", pa.float32(), "V", "voltage"),
    _quantity("current", pa.float32(), "A", "current"),
    _quantity("temperature", pa.float32(), "degC", "temperature of the ESC"),
    _field("mode", pa.string(), "operating mode in words; null when it tells none"),
    _field("faults", pa.string(), "flags that are set, joined by commas, empty for none; null when it tells none"),
])  # fmt: skip


FLIGHTS = pa.schema([
    _field("flight", pa.uint32(), "number of the flight, from 1"),
    _field("t", _NS, "time of the first report with a motor that turns, command above idle, or armed status"),
    _field("t_end", _NS, "time of the last one"),
    _field("ran", pa.int64(), "nanoseconds of it that were recorded: without holes, whatever the clock did"),
    _field("end", pa.string(), "landed, cut (the capture ends first) or lost (reports end, and others go on)"),
    _field("chs", pa.list_(pa.int32()), "channels that turned, as people count them, from 1"),
    _field("by", pa.string(), "what tells it: telemetry, commands or arming"),
    _field("frame", pa.uint64(), "number of its first frame, from 0"),
    _field("frame_end", pa.uint64(), "number of its last frame, from 0"),
])  # fmt: skip

FLIGHT_EVENTS = pa.schema([
    _field("event", pa.uint32(), "number of the event in the order of the capture, from 1"),
    _field("t", _NS, "time of the last report before it; null where the first one was like that"),
    _field("t_end", _NS, "time of the first report of it: it happened between `t` and this"),
    _field("until", _NS, "time of the first report behind it; null for what is over at once, or lasts"),
    _field("bus", pa.uint8(), "index of the interface name; null for what is of the whole capture"),
    _field("node", pa.uint8(), "node ID; null for nobody in particular"),
    _field("ch", pa.int32(), "channel of the ESC as people count them, from 1; null for no ESC, or if nobody told it"),
    _field("kind", pa.string(), "what kind of event it is"),
    _field("source", pa.string(), "who says so: bus, or autopilot: its own log"),
    _field("type", pa.string(), "data type, or record of the autopilot's log, that tells it"),
    _field("text", pa.string(), "what happened"),
    _field("clause", pa.string(), "clause of the document that says what is told here; empty for none"),
    _field("values", pa.string(), "numbers that belong to it, as a JSON object"),
    _field("frame", pa.uint64(), "number of the first frame of the report at `t_end`, from 0; null in a log"),
])  # fmt: skip


def wrap(schema: pa.Schema, columns: Mapping[str, Any]) -> pa.RecordBatch:
    """Return the native core's columns as one batch, without a copy.

    `columns` maps a name to the bytes of its values, `<name>_offset` to i32 offsets and `<name>_valid` to an Arrow
    bitmap or None.
    """
    rows = len(columns["frame" if "line" not in columns and "t" not in columns else "t"]) // 8
    return pa.RecordBatch.from_arrays([column(field, columns, rows) for field in schema], schema=schema)


def column(field: pa.Field, columns: Mapping[str, Any], rows: int) -> pa.Array:
    """Return one of the native core's columns: see `wrap`."""
    kind, values = field.type, pa.py_buffer(columns[field.name])
    valid = columns.get(f"{field.name}_valid")
    bitmap = None if valid is None else pa.py_buffer(valid)
    offsets = columns.get(f"{field.name}_offset")
    if offsets is None:
        return pa.Array.from_buffers(kind, rows, [bitmap, values])
    if pa.types.is_list(kind):
        inner = kind.value_type
        child = pa.Array.from_buffers(inner, len(values) * 8 // inner.bit_width, [None, values])
        return pa.Array.from_buffers(kind, rows, [bitmap, pa.py_buffer(offsets)], children=[child])
    return pa.Array.from_buffers(kind, rows, [bitmap, pa.py_buffer(offsets), values])


def counted(codes: npt.NDArray[Any]) -> tuple[list[int], list[int]]:
    """Return the integers that occur, in order, and how often; those that lie close together need no sorting."""
    if not len(codes):
        return [], []
    low, high = int(codes.min()), int(codes.max())
    if low == high:
        return [low], [len(codes)]
    if high - low >= MOST_COUNTED:
        values, counts = np.unique(codes, return_counts=True)
        return values.tolist(), counts.tolist()
    often = np.bincount(codes if low == 0 else codes - codes.dtype.type(low))
    values = np.flatnonzero(often)
    return (values + low).tolist(), often[values].tolist()


def distinct(codes: npt.NDArray[Any]) -> list[int]:
    """Return the integers that occur, in order."""
    return counted(codes)[0]


def raw_times(array: pa.Array) -> list[int | None]:
    """Return integer nanoseconds of a time column, None where there is no time."""
    return list(array.cast(pa.int64()).to_pylist())


def raw_rows(table: pa.Table) -> list[dict[str, Any]]:
    """Return the rows of a table, its times as integer nanoseconds: a time of Python has only microseconds."""
    plain = (one.with_type(pa.int64()) if pa.types.is_timestamp(one.type) else one for one in table.schema)
    return list(table.cast(pa.schema(plain)).to_pylist())


def empty(schema: pa.Schema) -> pa.RecordBatch:
    """Return a batch without rows."""
    return pa.RecordBatch.from_pylist([], schema=schema)
