"""Packets inside packets: a file of its own says what all packets of a message have in common, then each of them.

Notes of fields and derived columns that stand at the top of the file hold for every packet; a packet's own replace
them. The layout of each packet is a DSDL file beside it.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dissectors.keys import PACKET_FILE
from dissectors.layout import ArrayType, CompoundType, PrimitiveType
from dissectors.namespace import Namespace
from dissectors.records import replace
from dissectors.remarks import RemarkReader
from dissectors.schema import Packet, PacketFamily
from dissectors.toml_table import read

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.layout import Type
    from dissectors.notes import NoteReader
    from dissectors.toml_table import TomlTable

MAX_PACKET = 255


def family(table: TomlTable, layout: CompoundType, folder: Path, reader: NoteReader) -> PacketFamily | None:
    """Return the packets of a message, from the file that its key `packets` names; None without that key."""
    file = table.string("packets")
    if not file:
        return None
    path = folder / file
    if not path.is_file():
        table.fail(f"no such file: {path}", "packets")
    head = read(path, PACKET_FILE)
    field = head.string("carrier")
    carrier = layout.member(field)
    if not isinstance(carrier, ArrayType) or (carrier.element.min_bits, carrier.element.max_bits) != (8, 8):
        head.fail(f"{field!r} is no byte array of {layout.name}", "carrier")
    header = bytes(head.integers("header"))
    at = [head.integer(key) for key in ("id_at", "count_at", "unit_at", "length_at")]
    bodies = list(head.tables("packet"))
    for key in ("field", "derived"):
        head.table(key)
    head.finish()
    if not header or None in at:
        head.fail("header, id_at, count_at, unit_at and length_at are all needed")
    id_at, count_at, unit_at, length_at = (place or 0 for place in at)
    packets = [_packet(body, head, table.path[-1], reader) for _, body in bodies]
    for number, packet in enumerate(packets):
        body = bodies[number][1]
        if packet.length <= max(id_at, count_at, unit_at, length_at, len(header)):
            body.fail("shorter than what every packet of the family starts with", "dsdl")
        if packet.id in {other.id for other in packets[:number]}:
            body.fail(f"a second packet with this id: {packet.id:#04x}", "id")
    return PacketFamily(field, header, id_at, count_at, unit_at, length_at, tuple(packets))


def _packet(table: TomlTable, head: TomlTable, carrier: str, reader: NoteReader) -> Packet:
    name = table.path[-1]
    path = Path(head.file).parent / table.string("dsdl")
    if not path.is_file():
        table.fail(f"no such file: {path}", "dsdl")
    files = Namespace()
    files.add(path, f"packets.{name}")
    compiled = files.compile(f"packets.{name}")
    layout = replace(compiled.layouts[0], name=f"{carrier}.{name}")
    length = layout.max_bits // 8
    if compiled.service or layout.min_bits != layout.max_bits or layout.max_bits % 8 or not 1 < length <= MAX_PACKET:
        table.fail(f"a packet is 2 to {MAX_PACKET} whole bytes of fixed size", "dsdl")
    identity = table.integer("id")
    if identity is None:
        table.fail("id is missing")
    clause = table.string("clause")
    notes = reader.notes(head, layout, clause) | reader.notes(table, layout, clause)
    derived = reader.derived(head, layout, clause) | reader.derived(table, layout, clause)
    packet = Packet(
        name=name,
        id=identity,
        length=length,
        layout=layout,
        notes=notes,
        derived=tuple(derived.values()),
        clause=clause,
        checksum_ends=table.integers("checksum_ends", high=length - 1) or (length - 1,),
        summary=reader.summary(table, layout, notes, derived),
        numbers=tuple(_numbers(layout)),
        remarks=RemarkReader(layout, notes, derived).remarks(table),
    )
    table.finish()
    return packet


def _numbers(kind: Type, start: int = 0) -> Iterator[tuple[int, int]]:
    """Yield (first byte, bytes) of the numbers of two or more whole bytes in a value of fixed size.

    The value begins at bit `start`. What is inside a union is left out: its places depend on the tag.
    """
    if isinstance(kind, PrimitiveType):
        if kind.kind != "void" and kind.bits > 8 and kind.bits % 8 == start % 8 == 0:
            yield start // 8, kind.bits // 8
    elif isinstance(kind, ArrayType):
        for index in range(kind.max):
            yield from _numbers(kind.element, start + index * kind.element.max_bits)
    elif not kind.union:
        for member in kind.fields:
            yield from _numbers(member.type, start)
            start += member.type.max_bits
