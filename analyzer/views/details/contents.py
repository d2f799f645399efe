"""Contents of a transfer, for `-V`: templates of a message and of the packets in it, with their verdicts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.views.details.branches import STEP, Branches, line, text
from analyzer.views.members import NOTHING
from analyzer.views.members import PLAIN as AS_IT_IS
from dissectors.kit.cells import numbers
from dissectors.schema import Message

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.views.sheets import SheetColumns, Template
    from dissectors.kit import Array
    from dissectors.schema import Packet

PAYLOAD = ("bus", "payload")  # the first columns of transfers: where templates find the payload
_PAYLOAD = PAYLOAD.index("payload")
_PACKETS = 1  # the place of the template of packets; that of messages is 0
_BYTES_SHOWN = 255
_COUNTS = {"count_step": "for its unit", "count_step_id": "for its unit and type"}
_NUMBER: Template = ("number", AS_IT_IS, ("plain",))


def part_templates(_: str, of: Message | Packet | None, columns: SheetColumns) -> Sequence[Template | None]:
    """Return the templates of a message, and of a packet or of bytes that none claims."""
    if isinstance(of, Message):
        return [_message(of, columns)]
    return [None, _unclaimed(columns) if of is None else _packet(of, columns)]


def _message(of: Message, columns: SheetColumns) -> Template:
    branches = Branches(of, columns, _PAYLOAD, STEP * 2)
    full = of.full_name if of.full_name != of.name else ""
    head = line(text(f"{STEP}Message {of.name}{_aside(full, _clause(of.clause))}"))
    made = [head, *_warnings(columns), *branches.templates()]
    if of.packets is not None:
        made.append(branches.inside(of.packets.field, ("inside", _PACKETS)))
    return ("all", made)


def _packet(of: Packet, columns: SheetColumns) -> Template:
    pad = STEP * 3
    head = line(text(f"{STEP * 2}Packet {of.name} (from byte "), ("byte",), text(f"{_also(_clause(of.clause))})"))
    sums: Template = ("all", [text("checksum good (bytes 1 to "), columns.of("checksum_end", _NUMBER), text(")")])
    verdicts = [
        _either(columns, "header_ok", text("header of this direction"), text("header of the OTHER direction")),
        _either(columns, "complete", NOTHING, text("cut off")),
        _either(columns, "length_ok", text("length good"), text("length BAD")),
        _either(columns, "checksum_ok", sums, text("checksum BAD")),
    ]
    steps = [
        ("given", columns.place(name), ("all", [text("+"), columns.of(name, _NUMBER), text(f" {scope}")]), NOTHING)
        for name, scope in _COUNTS.items()
    ]
    counted, told = line(text(f"{pad}frame count step: "), ("joined", ", ", steps)), NOTHING
    for name in _COUNTS:
        told = ("given", columns.place(name), counted, told)
    branches: Template = ("all", Branches(of, columns, _PAYLOAD, pad).templates())
    order = NOTHING
    if of.numbers:
        big = line(text(f"{pad}byte order: big-endian, as this node's other messages show"))
        open_ = line(text(f"{pad}byte order: undecided, read as little-endian"))
        order = _either(columns, "decided", _either(columns, "big_endian", big, NOTHING), open_)
        branches = ("turned", columns.place("big_endian"), columns.place("decided"), branches)
    return ("all", [head, line(text(f"{pad}verdict: "), ("joined", ", ", verdicts)), told, order, branches])


def _unclaimed(columns: SheetColumns) -> Template:
    data = columns.of("data", ("hex", " ", _BYTES_SHOWN, "no data", " ... ", " bytes"))
    where = [text(f"{STEP * 2}Unrecognised data from byte "), ("byte",), text(", ")]
    return line(*where, columns.of("reason", ("copy",)), text(": "), data)


def _warnings(columns: SheetColumns) -> list[Template]:
    def number(name: str, of: Callable[[Array], Array]) -> int:
        def make(table: pa.RecordBatch) -> pa.Array:
            return pa.array(of(numbers(table.column("bits_left")).astype(np.int64)))

        return columns.computed(name, make)

    pad = f"{STEP * 2}! "
    lacking = number("bits missing", lambda left: np.maximum(-left, 0))
    over = number("bytes left over", lambda left: np.maximum(left, 0) // 8)
    size: Template = ("transfer", ("of", _PAYLOAD, ("count",)))
    lacks = line(text(pad), ("of", lacking, _NUMBER), text(" bits are missing behind "), size, text(" bytes"))
    plural: Template = ("by", over, [(1, NOTHING)], text("s"))
    has_more = line(text(pad), ("of", over, _NUMBER), text(" byte"), plural, text(" left over"))
    return [
        ("by", lacking, [(0, NOTHING)], lacks), ("by", over, [(0, NOTHING)], has_more),
        _either(columns, "bad_tag", line(text(f"{pad}a union names a member that it does not have")), NOTHING),
        _either(columns, "pad_nonzero", line(text(f"{pad}padding is not zero")), NOTHING),
    ]  # fmt: skip


def _either(columns: SheetColumns, flag: str, yes: Template, no: Template) -> Template:
    return ("by", columns.place(flag), [(1, yes)], no)


def _clause(clause: str) -> str:
    return f"clause {clause}" if clause else ""


def _also(words: str) -> str:
    return f", {words}" if words else ""


def _aside(*texts: str) -> str:
    said = ", ".join(filter(None, texts))
    return f" ({said})" if said else ""
