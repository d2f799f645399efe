"""Settings of devices: which columns of a table are such, and how their values are written."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from analyzer.facts.meaning import meaning
from dissectors.kit.cells import text_of, valid

if TYPE_CHECKING:
    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.schema import Message, Packet

GET_SET = "uavcan.protocol.param.GetSet"
VALUES = ("integer_value", "real_value", "boolean_value", "string_value")  # of its union
MOST_TEXT = 80  # characters
_DIGITS = 7  # of a 32-bit float
_SOFTWARE = "software_version"  # is told as firmware


def commands(registry: Registry, table: str) -> bool:
    """Return whether a table is what somebody else sets: no report of a device."""
    message = registry.message_of(table) or registry.message_of(table.partition(".")[0])
    return message is not None and message.actuates


def is_setting(of: Message | Packet | None, table: pa.RecordBatch, name: str) -> bool:
    """Return whether a column is a value of its own: no list, nothing derived, no word whose parts are there."""
    kind = table.schema.field(name).type
    if pa.types.is_nested(kind) or name.startswith(("reading.", _SOFTWARE)):
        return False
    if any(other.startswith(f"{name}.") and not other.endswith(".text") for other in table.schema.names):
        return False
    return not meaning(of, name).source


def given(value: Any) -> Any:
    """Return what a value of the standard's `GetSet` holds; None if it is empty."""
    cells = [value.get(one) for one in VALUES] if isinstance(value, dict) else []
    told = next((one for one in cells if one is not None), None)
    return text_of(bytes(told)) if isinstance(told, list) else told


def holds_value(column: pa.Array) -> Array:
    """Return a mask of the rows of values of `GetSet` in which `given` finds one."""
    found = np.zeros(len(column), bool)
    if pa.types.is_struct(column.type):
        for k in range(column.type.num_fields):
            if column.type.field(k).name in VALUES:
                found |= valid(column.field(k))
        found &= valid(column)
    return found


def written(value: Any) -> str:
    """Write a value as people do."""
    if isinstance(value, float):
        return f"{value:.{_DIGITS}g}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value)[:MOST_TEXT]
