"""The messages of a FileDescriptorSet, as far as a reader of CAN frames needs them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

# No schema of a CAN frame is larger, or nested deeper.
_LARGEST, _DEEPEST = 8 << 20, 16
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_REPEATED = 3
# By the type number of `FieldDescriptorProto.Type`: what stands on the wire.
_WIRE = {
    **dict.fromkeys((3, 4, 5, 8, 13, 14), "varint"),
    1: "double",
    2: "float",
    6: "fixed64",
    7: "fixed32",
    9: "string",
    11: "message",
    12: "bytes",
    15: "sfixed32",
    16: "sfixed64",
    17: "zigzag",
    18: "zigzag",
}


@dataclass(slots=True)
class Field:
    """One field of a message; `wire` is empty for what cannot be read, `kind` is the full name of a message's type."""

    name: str = ""
    number: int = 0
    repeated: bool = False
    wire: str = ""
    kind: str = ""
    enum: bool = False
    boolean: bool = False


@dataclass(slots=True)
class Messages:
    """Fields of every message by its full name."""

    found: dict[str, list[Field]] = field(default_factory=dict)

    def add(self, data: bytes, prefix: str, depth: int = 0) -> None:
        """Takes a `DescriptorProto`."""
        if depth == _DEEPEST:
            raise ValueError("nested too deep")
        name, fields, nested = "", list[Field](), list[bytes]()
        for number, value in _fields(data):
            if isinstance(value, bytes):
                if number == 1:
                    name = value.decode()
                elif number == 2:
                    fields.append(_field(value))
                elif number == 3:
                    nested.append(value)
        full = f"{prefix}.{name}" if prefix else name
        self.found[full] = fields
        for inner in nested:
            self.add(inner, full, depth + 1)


def messages(data: bytes) -> dict[str, list[Field]]:
    """Raises `ValueError` if the bytes are no set of descriptors."""
    if len(data) > _LARGEST:
        raise ValueError("too large")
    out = Messages()
    for number, file in _fields(data):
        if number != 1 or not isinstance(file, bytes):
            continue
        package, types = "", list[bytes]()
        for inner, value in _fields(file):
            if inner == 2 and isinstance(value, bytes):
                package = value.decode()
            elif inner == 4 and isinstance(value, bytes):
                types.append(value)
        for one in types:
            out.add(one, package)
    return out.found


def _field(data: bytes) -> Field:
    out = Field()
    for number, value in _fields(data):
        if isinstance(value, bytes):
            if number == 1:
                out.name = value.decode()
            elif number == 6:
                out.kind = value.decode().removeprefix(".")
        elif number == 3:
            out.number = value
        elif number == 4:
            out.repeated = value == _REPEATED
        elif number == 5:
            out.wire, out.enum, out.boolean = _WIRE.get(value, ""), value == 14, value == 8
    return out


def _fields(data: bytes) -> Iterator[tuple[int, int | bytes]]:
    """Numbers and values of one message; numbers of 4 or 8 bytes come as bytes."""
    at = 0
    while at < len(data):
        tag, at = _varint(data, at)
        kind = tag & 7
        if kind == _VARINT:
            value, at = _varint(data, at)
            yield tag >> 3, value
            continue
        if kind == _BYTES:
            size, at = _varint(data, at)
        elif kind in {_FIXED32, _FIXED64}:
            size = 4 if kind == _FIXED32 else 8
        else:
            raise ValueError("wire type not known")
        if at + size > len(data):
            raise ValueError("ends early")
        yield tag >> 3, data[at : at + size]
        at += size


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        if at == len(data):
            raise ValueError("ends early")
        byte = data[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, at
    raise ValueError("number too long")
