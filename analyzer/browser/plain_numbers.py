"""Rows in numbers in place of names: the ID of the type, and the fields as they are, without words and units."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.tables import KINDS
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from dissectors import Registry

_SHORT = {"request": "req", "response": "resp"}
_MOST = 64  # elements of an array


def plain_numbers(batch: Batch, registry: Registry) -> Iterator[tuple[str, str]]:
    """Yield what stands in place of the type and of its summary for each transfer of a batch; "" keeps a summary."""
    transfers = batch.transfers
    kinds, types, variants = (transfers.column(name).to_pylist() for name in ("kind", "type_id", "variant"))
    for row, (kind, type_id, variant) in enumerate(zip(kinds, types, variants, strict=True)):
        message = registry.message(kind, type_id, variant)
        called = f"{type_id} {_SHORT.get(KINDS[kind], '')}".rstrip()
        table = None if message is None else batch.messages.get(message.table)
        if message is None or table is None:
            yield called, ""
            continue
        at = next(iter((numbers(table.column("transfer")) == row).nonzero()[0].tolist()), None)
        names = [field.name for field in message.layout.fields if field.name in table.schema.names]
        yield called, "" if at is None else " ".join(f"{name}={_value(table.column(name)[at])}" for name in names)


def _value(cell: pa.Scalar) -> str:
    return _shown(cell.as_py())


def _shown(value: object) -> str:
    if isinstance(value, dict):
        return "{" + " ".join(f"{name}={_shown(one)}" for name, one in value.items()) + "}"
    if isinstance(value, list):
        return ",".join(map(_shown, value[:_MOST])) + ("..." if len(value) > _MOST else "")
    if isinstance(value, bool):
        return str(int(value))
    return f"{value:.7g}" if isinstance(value, float) else "-" if value is None else str(value)
