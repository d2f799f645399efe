"""MCAP with decoded telemetry that Foxglove and Rerun open: a topic for each message type and node, raw frames beside.

`/can0/node_23/<table>` holds Protocol Buffers messages with the columns of that table; `/can0/from_can_bus` and its
neighbours hold the frames as `sinks.mcap` writes them; `/can0/events` error frames, drops and what was unreadable, and
`/findings` what the rules found, as `foxglove.Log`. Log time is the time of a transfer's first frame, 0 in a capture
without times. An unreadable line, which has no time of its own, stands at that of the frame in front of it. Findings
are known at the end and written last; readers go by time, with the index of each chunk.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

import numpy as np
import pyarrow as pa

from analyzer import _native
from analyzer.sinks import portable, telemetry_log
from analyzer.sinks.extent import Extent
from analyzer.sinks.mcap import CHUNK, McapSink
from analyzer.sinks.telemetry_log import stamps
from analyzer.sinks.telemetry_rows import encode
from analyzer.sinks.telemetry_schema import Schema, log_schema, schema
from analyzer.tables import EVENTS
from dissectors.kit.cells import numbers
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from analyzer.sinks.telemetry_log import LogRows
    from analyzer.window.part import BatchPart
    from dissectors.kit import Array

    Encoded = tuple[bytes, bytes, bytes, bytes]

# IDs of channels below it belong to raw frames: 3 directions and 2 kinds for each of 255 buses.
_FIRST_CHANNEL = 2048
# IDs have 16 bits. What nodes beyond this many channels send goes to one topic a type, `/others/<table>`.
MOST_CHANNELS = 60_000
# How the native core hands over frames and events, and Arrow does not.
_FILLED = {"t": NO_TIME, "bus": 0, "tx_errors": 0, "rx_errors": 0}


class TelemetryExport:
    """Takes the parts of a capture one after the other.

    Args:
        file: takes the bytes.
        wanted: names of tables, `frames` and `events` among them; all if empty.
        about: what is known of the capture.

    `frames`, `messages` (of the topics of nodes), `events` and `findings` count what was written so far; `extent`
    is the part of the capture that came.
    """

    def __init__(self, file: BinaryIO, wanted: Collection[str], about: Mapping[str, str]) -> None:
        self._sink = McapSink(file)
        self._wanted = wanted
        self._about = about
        self._schemas: dict[str, Schema] = {}
        self._channels: dict[tuple[str, str, int], int] = {}
        self._latest = 0
        self.extent = Extent()
        self.frames = self.messages = self.events = self.findings = 0

    def feed(self, part: BatchPart) -> None:
        """Write rows of every table; they are in the file afterwards."""
        self.extent.feed(part)
        if self._wants("frames"):
            self._sink.write(_frame_batch(part))
            self.frames += len(part.frames)
            self._sink.close_chunk()
        wanted = {name: table for name, table in part.messages.items() if self._wants(name)}
        tables = [self._messages(name, table, part.buses) for name, table in wanted.items()]
        self.messages += sum(map(len, wanted.values()))
        if self._wants("events") and len(part.events):
            tables.append(self._events(part))
            self.events += len(part.events)
        self._put(tables)

    def add_findings(self, log: LogRows) -> None:
        """Write what the rules found in the whole capture, after its last part."""
        if len(log.messages):
            channels = [self._log_channel("findings")] * len(log.messages)
            self._put([self._logged(log.messages, log.times, channels)])
        self.findings = log.findings

    def finish(self) -> None:
        """Write the end of the file."""
        self._sink.close_chunk()
        self._sink.container.metadata("tailbyte", self._about)
        self._sink.close()

    @property
    def capture(self) -> str:
        """The name of the capture."""
        return self._about.get("tailbyte.capture", "")

    @property
    def lost(self) -> dict[str, int]:
        """The rows that raw frames could not hold, in words, and how often."""
        return self._sink.lost if self._wants("frames") else {}

    def _messages(self, name: str, table: pa.RecordBatch, buses: tuple[str, ...]) -> Encoded:
        rows = portable.messages(table, buses)
        if name not in self._schemas:
            self._schemas[name] = schema(name, rows.schema)
        bus, src = (numbers(table.column(c)).astype(np.int64) for c in ("bus", "src"))
        found, inverse = np.unique(bus << 8 | src, return_inverse=True)
        about = {k.decode(): v.decode() for k, v in (table.schema.metadata or {}).items()} | _units(rows.schema)
        of = [self._channel(name, buses[key >> 8], key & 0xFF, about) for key in found.tolist()]
        times = stamps(table.column("t"))
        ends, data = encode(rows, self._schemas[name].columns)
        return np.array(of, np.uint16)[inverse].tobytes(), times.tobytes(), ends, data

    def _channel(self, name: str, bus: str, node: int, about: Mapping[str, str]) -> int:
        key, of = (name, bus, node), self._schemas[name]
        if key in self._channels:
            return self._channels[key]
        if len(self._channels) < MOST_CHANNELS:
            self._open(key, f"/{self._sink.topic(bus)}/node_{node}/{name}", of, {"node": str(node), **about})
            return self._channels[key]
        others = name, "", -1
        if others not in self._channels:
            self._open(others, f"/others/{name}", of, about)
        return self._channels[others]

    def _open(self, key: tuple[str, str, int], topic: str, of: Schema, about: Mapping[str, str]) -> None:
        container = self._sink.container
        number = _FIRST_CHANNEL + len(self._channels)
        bus = {"bus": key[1]} if key[1] else {}
        container.channel(
            number, topic, "protobuf", container.schema(of.name, "protobuf", of.descriptors), {**bus, **about}
        )
        self._channels[key] = number

    def _events(self, part: BatchPart) -> Encoded:
        buses = [None if k is None else part.buses[k] for k in part.events.column("bus").to_pylist()]
        channels = [self._log_channel("events", bus or "") for bus in buses]
        times = self._event_times(part)
        return self._logged(telemetry_log.events(part, times, buses, self.capture), times, channels)

    def _logged(self, log: pa.RecordBatch, times: Array, channels: Sequence[int]) -> Encoded:
        ends, data = encode(log, log_schema().columns)
        return np.array(channels, np.uint16).tobytes(), times.tobytes(), ends, data

    def _event_times(self, part: BatchPart) -> Array:
        """Give what has no time of its own that of the frame in front of it in the capture."""
        frames, events = part.frames, part.events
        times, known = stamps(events.column("t")), stamps(frames.column("t"))
        missing = np.asarray(events.column("t").is_null())
        before = np.searchsorted(numbers(frames.column("line")), numbers(events.column("line"))[missing])
        near = known if len(known) else np.array([self._latest])
        times[missing] = near[np.maximum(before - 1, 0)]
        self._latest = int(max(near[-1], self._latest))
        return times

    def _log_channel(self, what: str, bus: str = "") -> int:
        key = what, bus, 0
        if key not in self._channels:
            self._open(key, f"/{self._sink.topic(bus)}/{what}" if bus else f"/{what}", log_schema(), {})
        return self._channels[key]

    def _put(self, tables: list[Encoded]) -> None:
        head = self._sink.container.head()
        for chunk in _native.message_records(tables, len(head), CHUNK):
            self._sink.container.chunk(chunk)

    def _wants(self, name: str) -> bool:
        return not self._wanted or name in self._wanted


def _units(columns: pa.Schema) -> dict[str, str]:
    return {f"unit.{f.name}": f.metadata[b"unit"].decode() for f in columns if b"unit" in (f.metadata or {})}


def _frame_batch(part: BatchPart) -> _native.FrameBatch:
    """Return frames, error frames and drops as they came from the reader; the other events are only told."""
    kinds = numbers(part.events.column("kind"))
    rows = np.flatnonzero(np.isin(kinds, [EVENTS.index("error frame"), EVENTS.index("drop")]))
    events = part.events.take(pa.array(rows))
    return _native.FrameBatch.of(_buffers(part.frames), _buffers(events), list(part.buses))


def _buffers(table: pa.RecordBatch) -> dict[str, bytes]:
    out = {}
    for name, column in zip(table.schema.names, table.columns, strict=True):
        if name in _FILLED:
            missing = np.asarray(column.is_null())
            out[f"{name}_valid"] = (~missing).astype(np.uint8).tobytes()
            out[name] = np.where(missing, _FILLED[name], numbers(column)).astype(numbers(column).dtype).tobytes()
        elif pa.types.is_binary(column.type) or pa.types.is_string(column.type):
            _, offsets, data = column.buffers()
            out[f"{name}_offset"] = offsets.slice(0, 4 * (len(column) + 1)).to_pybytes() or bytes(4)
            out[name] = b"" if data is None else data.to_pybytes()
        else:
            out[name] = numbers(column).tobytes()
    return out
