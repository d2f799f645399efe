"""The messages of a FileDescriptorSet, as far as a reader of CAN frames needs them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

# No schema of a CAN frame is larger, or nested deeper, or has more fields in its own messages altogether.
_LARGEST, _DEEPEST, _MOST = 8 << 20, 16, 1 << 17
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_REPEATED = 3
_NUMBERS = range(1, 1 << 29)
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
    boolean: bool = False


def messages(data: bytes) -> dict[str, list[Field]]:
    """Return the fields of every message by its full name. Raises `ValueError` for no set of descriptors."""
    if len(data) > _LARGEST:
        raise ValueError("too large")
    return _Parser().set(data)


class _Parser:
    """Goes through the messages of a set of descriptors, which are Protocol Buffers messages themselves."""

    def __init__(self) -> None:
        self._found: dict[str, list[Field]] = {}
        self._left = _MOST

    def set(self, data: bytes) -> dict[str, list[Field]]:
        """Take a `FileDescriptorSet`."""
        for number, file in self._fields(data):
            if number != 1 or not isinstance(file, bytes):
                continue
            package, types = "", list[bytes]()
            for inner, value in self._fields(file):
                if inner == 2 and isinstance(value, bytes):
                    package = value.decode()
                elif inner == 4 and isinstance(value, bytes):
                    types.append(value)
            for one in types:
                self._message(one, package, 0)
        return self._found

    def _message(self, data: bytes, prefix: str, depth: int) -> None:
        """Take a `DescriptorProto`; of fields with the same number, which must not be, the first counts."""
        if depth == _DEEPEST:
            raise ValueError("nested too deep")
        name, fields, nested = "", dict[int, Field](), list[bytes]()
        for number, value in self._fields(data):
            if isinstance(value, bytes):
                if number == 1:
                    name = value.decode()
                elif number == 2:
                    field = self._field(value)
                    if field.number in _NUMBERS:
                        fields.setdefault(field.number, field)
                elif number == 3:
                    nested.append(value)
        full = f"{prefix}.{name}" if prefix else name
        self._found[full] = list(fields.values())
        for inner in nested:
            self._message(inner, full, depth + 1)

    def _field(self, data: bytes) -> Field:
        """Take a `FieldDescriptorProto`."""
        out = Field()
        for number, value in self._fields(data):
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
                out.wire, out.boolean = _WIRE.get(value, ""), value == 8
        return out

    def _fields(self, data: bytes) -> Iterator[tuple[int, int | bytes]]:
        """Numbers and values of one message; numbers of 4 or 8 bytes come as bytes."""
        at = 0
        while at < len(data):
            self._left -= 1
            if self._left < 0:
                raise ValueError("too many fields")
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
