"""pydronecan as a peer: random values of every standard type, made and packed with its own objects."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import dronecan
from dronecan import dsdl, transport

from kit.encode import Frame

if TYPE_CHECKING:
    import random

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


def frames(sent: transport.Transfer) -> list[Frame]:
    return [Frame(f.message_id, bytes(f.bytes), fd=f.canfd) for f in sent.to_frames()]


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
