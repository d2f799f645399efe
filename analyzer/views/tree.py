"""`-V`: everything about one transfer as a tree, down to the bits of its values and where they came from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.facts.names import type_name
from analyzer.tables import KINDS, STATUSES
from analyzer.views.branches import Branch, branches, word_bits
from analyzer.views.members import cells
from analyzer.views.named import rules_of
from analyzer.views.phrases import octets
from analyzer.views.places import USUAL, FieldPlace, fixed, places, span
from analyzer.views.rows import TransferRows
from analyzer.views.terminal import PLAIN, Palette, escape
from analyzer.views.times import MODES, TimeFormat
from analyzer.views.wording import anomalies
from analyzer.window.numbering import Numbering
from dissectors.records import dataclass, replace
from dissectors.schema import Packet

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.rules.named_frames import NamedFrames
    from analyzer.views.rows import MessagePart
    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.schema import Message

_REQUEST = KINDS.index("request")
_ANONYMOUS = KINDS.index("anonymous")
_STEP = "    "
_COUNTS = {"count_step": "for its unit", "count_step_id": "for its unit and type"}


class Tree:
    """Writes the details of picked transfers.

    Args:
        registry: the types that the batches were decoded with.
        clock: writes relative times.
        palette: colours for a terminal.
        only: tables (`ESCStatus`, `uavcan.protocol.GetNodeInfo.Response`) to show in full; all if empty. Of other
            types only the first line is shown, as tshark's `-O` does.
        numbering: of frames; those of the capture if not given.
        named: the rules that name frames.
    """

    def __init__(
        self,
        registry: Registry,
        clock: TimeFormat,
        palette: Palette = PLAIN,
        only: Collection[str] = (),
        numbering: Numbering | None = None,
        named: NamedFrames | None = None,
    ) -> None:
        self._registry = registry
        self._clock = clock
        self._palette = palette
        self._only = frozenset(only)
        self._numbering = numbering or Numbering()
        self._named = named

    def details(self, batch: Batch, picked: Array | None = None) -> Iterator[list[str]]:
        """Give the lines of each picked transfer (all if not given), in order."""
        self._clock.start(batch.frames)
        rows = TransferRows(batch, self._registry, picked)
        typed = {at: (part, k) for part in rows.typed for k, at in enumerate(part.at)}
        inner = rows.inner()
        values, named = _Values(), rules_of(self._named, rows.column("frame"))
        for at in range(len(rows)):
            lines = [self._palette.paint("head", self._title(rows, at))]
            if named[at]:
                lines.append(self._palette.paint("note", f"{_STEP}findings: {', '.join(named[at])}"))
            message = rows.messages[at]
            if not self._only or (message is not None and message.table in self._only):
                lines += _indented(_identifier(rows, at))
                lines += _indented(self._transfer(rows, at))
                lines += self._content(rows, at, typed.get(at), inner.get(at, []), values)
            yield lines

    def _title(self, rows: TransferRows, at: int) -> str:
        message, frames = rows.messages[at], rows.column("frame")[at]
        name = type_name(message, rows.column("kind")[at], rows.column("type_id")[at])
        bus = escape(rows.batch.buses[rows.column("bus")[at]])
        numbers = ", ".join(str(self._numbering.of(frame)) for frame in frames[:8]) + (
            ", ..." if len(frames) > 8 else ""
        )
        return f"{name} on {bus}, frame{'s' * (len(frames) != 1)} {numbers} ({len(frames)})"

    def _transfer(self, rows: TransferRows, at: int) -> Iterator[str]:
        def get(name: str) -> Any:
            return rows.column(name)[at]

        status = get("status")
        yield f"Transfer: {STATUSES[status]}"
        t, end, gap, step = get("t"), get("t_end"), get("gap"), get("step")
        if t is None:
            yield _STEP + "time: not recorded"
        else:
            yield f"{_STEP}time: {TimeFormat('ad', digits=9).text(t)} ({MODES['ad'].rpartition(', ')[2]})"
            since = self._clock.seconds(t - (self._clock.zero or 0), signed=self._clock.signed)
            yield f"{_STEP}since {'zero' if self._clock.signed else 'first frame'}: {since} s"
        if t is not None and end is not None:
            yield f"{_STEP}took: {self._clock.seconds(end - t)} s"
        if step is not None:
            yield f"{_STEP}transfer ID step: +{step}" + (" (+1 is the rule)" if step != 1 else "")
        if gap is not None:
            yield f"{_STEP}since the previous one: {self._clock.seconds(gap)} s"
        wire, here = get("crc_wire"), get("crc_here")
        if wire is None:
            yield _STEP + "CRC: none, a single frame has none" if len(get("frame")) < 2 else _STEP + "CRC: not known"
        elif here is None:
            yield f"{_STEP}CRC: {wire:04X}, not checked"
        else:
            yield f"{_STEP}CRC: {wire:04X}, computed {here:04X}: {'good' if wire == here else 'BAD'}"
        for word in anomalies(get("anomaly"), step):
            yield self._palette.paint("note", f"{_STEP}! {word}")

    def _content(
        self,
        rows: TransferRows,
        at: int,
        found: tuple[MessagePart, int] | None,
        packets: list[tuple[int, MessagePart, int]],
        values: _Values,
    ) -> Iterator[str]:
        payload, message = rows.column("payload")[at], rows.messages[at]
        if found is None or message is None:
            what = "Payload, not decoded" if message is not None else "Payload of an unknown type"
            yield f"{_STEP}{what}: {octets(payload, len(payload))}"
            return
        row = _Row(*found, values, payload)
        where = row.places(message, row.get("layout"))
        full = message.full_name if message.full_name != message.name else ""
        yield f"{_STEP}Message {message.name}" + _aside(full, _clause(message.clause))
        yield from _warnings(row)
        yield from row.draw(message, where, _STEP * 2)
        family = message.packets
        data = span(where, family.field) if family is not None else None
        for offset, inner, k in packets:
            yield from _packet(_Row(inner, k, values, payload), offset, data)


class _Values:
    """Columns of the parts seen, converted once for all their rows."""

    def __init__(self) -> None:
        self._columns: dict[tuple[int, str], list[Any]] = {}
        self.places: dict[str, list[FieldPlace]] = {}  # by table, of those whose rows all have the same

    def cell(self, part: MessagePart, row: int, column: str) -> Any:
        key = id(part), column
        if key not in self._columns:
            self._columns[key] = cells(part, column)
        return self._columns[key][row]


@dataclass(frozen=True, slots=True)
class _Row:
    """One row of a message or packet table, and the payload it came from."""

    part: MessagePart
    row: int
    values: _Values
    payload: bytes

    def get(self, column: str) -> Any:
        return self.values.cell(self.part, self.row, column)

    def places(self, of: Message | Packet, code: int) -> list[FieldPlace]:
        known = self.values.places.get(self.part.name)
        if known is None:
            known = places(of.layout, {m.name: self.get(m.name) for m in of.layout.fields if m.name}, code)
            if fixed(of.layout):  # the same for every row of the table
                self.values.places[self.part.name] = known
        return known

    def draw(self, of: Message | Packet, where: list[FieldPlace], pad: str) -> Iterator[str]:
        for branch in branches(of, self.get, where, self.payload):
            yield from _lines(branch, pad)


def _identifier(rows: TransferRows, at: int) -> Iterator[str]:
    """Return the identifier's fields (4.1.2), rebuilt from the transfer; an anonymous one has bits not kept."""
    kind, type_id = rows.column("kind")[at], rows.column("type_id")[at]
    src, dst, priority = rows.column("src")[at], rows.column("dst")[at], rows.column("priority")[at]
    name = type_name(rows.messages[at], kind, type_id)
    if kind >= _REQUEST:
        word = priority << 24 | type_id << 16 | (kind == _REQUEST) << 15 | (dst or 0) << 8 | 1 << 7 | src
        fields = [
            (24, 28, f"priority: {priority}"), (16, 23, f"service type: {type_id} ({name})"),
            (15, 15, f"direction: {KINDS[kind]}"), (8, 14, f"destination node: {dst}"), (7, 7, "service: yes"),
            (0, 6, f"source node: {src}"),
        ]  # fmt: skip
    else:
        word = priority << 24 | type_id << 8 | src
        of_type = [(8, 23, f"message type: {type_id} ({name})")]
        if kind == _ANONYMOUS:
            of_type = [(8, 9, f"message type: {type_id} ({name}), its low 2 bits")]
        fields = [
            (24, 28, f"priority: {priority}"), *of_type, (7, 7, "service: no"),
            (0, 6, f"source node: {src}" + (" (anonymous)" if kind == _ANONYMOUS else "")),
        ]  # fmt: skip
    yield "Identifier" + (f" {word:08X}" if kind != _ANONYMOUS else ", anonymous: bits 10-23 are no part of the type")
    for low, high, text in fields:
        yield f"{_STEP}{word_bits(word, 29, low, high)} = {text}"


def _packet(found: _Row, offset: int, data: FieldPlace | None) -> Iterator[str]:
    """Return a packet from byte `offset` of the array whose bits are `data`."""
    get, of, pad = found.get, found.part.of, _STEP * 2
    start = offset * 8 + (data.start if data is not None else 0)
    if of is None:
        yield f"{pad}Unrecognised data from byte {start // 8 + 1}, {get('reason')}: {octets(get('data'), 255)}"
        return
    where = [FieldPlace(p.path, p.role, p.start + start, p.bits, p.type) for p in found.places(of, USUAL)]
    yield f"{pad}Packet {of.name}" + _aside(f"from byte {start // 8 + 1}", _clause(of.clause))
    verdicts = [
        "header of this direction" if get("header_ok") else "header of the OTHER direction",
        "" if get("complete") else "cut off",
        "length good" if get("length_ok") else "length BAD",
        f"checksum good (bytes 1 to {get('checksum_end')})" if get("checksum_ok") else "checksum BAD",
    ]
    yield f"{pad}{_STEP}verdict: {', '.join(filter(None, verdicts))}"
    steps = [f"+{step} {scope}" for name, scope in _COUNTS.items() if (step := get(name)) is not None]
    if steps:
        yield f"{pad}{_STEP}frame count step: {', '.join(steps)}"
    if isinstance(of, Packet) and of.numbers and not get("decided"):
        yield f"{pad}{_STEP}byte order: undecided, read as little-endian"
    elif isinstance(of, Packet) and of.numbers and get("big_endian"):
        yield f"{pad}{_STEP}byte order: big-endian, as this node's other messages show"
        found = replace(found, payload=_turned(found.payload, start // 8, of.numbers))
    yield from found.draw(of, where, pad + _STEP)


def _turned(payload: bytes, first: int, numbers: Sequence[tuple[int, int]]) -> bytes:
    """Return the payload with the bytes of each number of the packet at `first` the other way round."""
    out = bytearray(payload)
    for at, size in numbers:
        part = slice(first + at, first + at + size)
        out[part] = out[part][::-1]
    return bytes(out)


def _lines(branch: Branch, pad: str) -> Iterator[str]:
    text = pad + branch.text
    yield f"{text}{' ' * max(2, 60 - len(text))}{branch.where}".rstrip()
    for below in branch.below:
        yield from _lines(below, pad + _STEP)


def _warnings(row: _Row) -> Iterator[str]:
    left = row.get("bits_left")
    if left < 0:
        yield f"{_STEP * 2}! {-left} bits are missing behind {len(row.payload)} bytes"
    elif left >= 8:
        yield f"{_STEP * 2}! {left // 8} byte{'s' * (left >= 16)} left over"
    if row.get("bad_tag"):
        yield _STEP * 2 + "! a union names a member that it does not have"
    if row.get("pad_nonzero"):
        yield _STEP * 2 + "! padding is not zero"


def _indented(lines: Iterator[str]) -> list[str]:
    return [_STEP + line for line in lines]


def _clause(clause: str) -> str:
    return f"clause {clause}" if clause else ""


def _aside(*texts: str) -> str:
    said = ", ".join(filter(None, texts))
    return f" ({said})" if said else ""
