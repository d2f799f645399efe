"""Protocol Buffers descriptors of decoded tables, made at run time: what a viewer needs to read the messages."""

from __future__ import annotations

import re
from functools import cache

import pyarrow as pa
from google.protobuf import timestamp_pb2
from google.protobuf.descriptor_pb2 import (
    DescriptorProto,
    FieldDescriptorProto,
    FileDescriptorProto,
    FileDescriptorSet,
)

from dissectors.records import dataclass

PACKAGE = "tailbyte"
LOG = "foxglove.Log"
# Of the table, not of the message: time and sender are in the record around it and in the topic.
_OUTSIDE = ("t", "bus", "src")
_TYPES = {
    pa.uint8(): FieldDescriptorProto.TYPE_UINT32,
    pa.uint16(): FieldDescriptorProto.TYPE_UINT32,
    pa.uint32(): FieldDescriptorProto.TYPE_UINT32,
    pa.uint64(): FieldDescriptorProto.TYPE_UINT64,
    pa.int8(): FieldDescriptorProto.TYPE_SINT32,
    pa.int16(): FieldDescriptorProto.TYPE_SINT32,
    pa.int32(): FieldDescriptorProto.TYPE_SINT32,
    pa.int64(): FieldDescriptorProto.TYPE_SINT64,
    pa.float32(): FieldDescriptorProto.TYPE_FLOAT,
    pa.float64(): FieldDescriptorProto.TYPE_DOUBLE,
    pa.bool_(): FieldDescriptorProto.TYPE_BOOL,
    pa.string(): FieldDescriptorProto.TYPE_STRING,
    pa.binary(): FieldDescriptorProto.TYPE_BYTES,
}


@dataclass(frozen=True, slots=True)
class Schema:
    """A message type: its full name, its serialised `FileDescriptorSet`, and the columns of its fields 1, 2, ..."""

    name: str
    descriptors: bytes
    columns: tuple[str, ...]


def schema(table: str, columns: pa.Schema) -> Schema:
    """Return the message type of a table in its portable shape.

    Every field is `optional`: an absent one is null. Dots of names become underscores. Lists are repeated, bytes that
    hold text or digits for people are bytes. Units, enumerations and clauses stand as comments in the descriptor.
    """
    name = identifier(table)
    file = FileDescriptorProto(name=f"{PACKAGE}/{name}.proto", package=PACKAGE, syntax="proto3")
    message = file.message_type.add(name=name)
    fields = [field for field in columns if field.name not in _OUTSIDE]
    _fill(message, f".{PACKAGE}.{name}", fields)
    for number, field in enumerate(fields):
        text = comment(field)
        if text:
            file.source_code_info.location.add(path=[4, 0, 2, number], span=[0, 0, 0], leading_comments=f" {text}\n")
    descriptors = FileDescriptorSet(file=[file]).SerializeToString(deterministic=True)
    return Schema(f"{PACKAGE}.{name}", descriptors, tuple(field.name for field in fields))


def identifier(name: str) -> str:
    """Return a name that Protocol Buffers allows."""
    text = re.sub(r"[^A-Za-z0-9_]", "_", name) or "_"
    return f"_{text}" if text[0].isdigit() else text


def comment(field: pa.Field) -> str:
    """Say what the metadata of a column tells, in one line."""
    about = {key.decode(): value.decode() for key, value in (field.metadata or {}).items()}
    return "; ".join(f"{key} {about[key]}" for key in ("unit", "enum", "clause", "about") if about.get(key))


def as_bytes(field: pa.Field) -> bool:
    """Return True if a list of bytes is one value, and not a list of numbers."""
    about = field.metadata or {}
    whole = b"text" in about or b"hex" in about
    return bool(whole and pa.types.is_list(field.type) and field.type.value_type == pa.uint8())


def _fill(message: DescriptorProto, path: str, fields: list[pa.Field]) -> None:
    names, types = set[str](), set[str]()
    for number, column in enumerate(fields, 1):
        name = _unique(identifier(column.name), names)
        field = message.field.add(name=name, number=number, label=FieldDescriptorProto.LABEL_OPTIONAL)
        kind = column.type
        if as_bytes(column):
            kind = pa.binary()
        elif pa.types.is_list(kind):
            field.label, kind = FieldDescriptorProto.LABEL_REPEATED, kind.value_type
        elif pa.types.is_dictionary(kind):
            kind = kind.value_type
        if pa.types.is_struct(kind):
            inner = _unique(name.title().replace("_", ""), types)
            field.type, field.type_name = FieldDescriptorProto.TYPE_MESSAGE, f"{path}.{inner}"
            _fill(message.nested_type.add(name=inner), field.type_name, [kind.field(k) for k in range(kind.num_fields)])
        else:
            field.type = _TYPES[kind]
            if field.label != FieldDescriptorProto.LABEL_REPEATED:
                field.proto3_optional, field.oneof_index = True, len(message.oneof_decl)
                message.oneof_decl.add(name=f"_{name}")


def _unique(name: str, taken: set[str]) -> str:
    """Return a free name; `a_b` and `aB` are one name in JSON, so they are taken for alike."""
    found, number = name, 1
    while found.replace("_", "").lower() in taken:
        number += 1
        found = f"{name}_{number}"
    taken.add(found.replace("_", "").lower())
    return found


@cache
def log_schema() -> Schema:
    """Return `foxglove.Log`, as viewers know it; columns `timestamp`, `level`, `message`, `name` and `file`."""
    file = FileDescriptorProto(
        name="foxglove/Log.proto", package="foxglove", syntax="proto3", dependency=[timestamp_pb2.DESCRIPTOR.name]
    )
    message = file.message_type.add(name="Log")
    levels = message.enum_type.add(name="Level")
    for number, name in enumerate(("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL")):
        levels.value.add(name=name, number=number)
    columns = (
        ("timestamp", FieldDescriptorProto.TYPE_MESSAGE, ".google.protobuf.Timestamp"),
        ("level", FieldDescriptorProto.TYPE_ENUM, ".foxglove.Log.Level"),
        ("message", FieldDescriptorProto.TYPE_STRING, None),
        ("name", FieldDescriptorProto.TYPE_STRING, None),
        ("file", FieldDescriptorProto.TYPE_STRING, None),
        ("line", FieldDescriptorProto.TYPE_FIXED32, None),
    )
    for number, (name, kind, of) in enumerate(columns, 1):
        field = message.field.add(name=name, number=number, type=kind, label=FieldDescriptorProto.LABEL_OPTIONAL)
        if of is not None:
            field.type_name = of
    stamp = FileDescriptorProto.FromString(timestamp_pb2.DESCRIPTOR.serialized_pb)
    descriptors = FileDescriptorSet(file=[stamp, file]).SerializeToString(deterministic=True)
    return Schema(LOG, descriptors, tuple(name for name, *_ in columns[:-1]))
