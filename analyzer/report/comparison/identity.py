"""The identity that nodes tell: software with its commit, hardware and unique ID, from the answers to `GetNodeInfo`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.devices.rows import usable
from analyzer.facts.node_status import NODE_INFO
from dissectors.kit.cells import pylist
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyarrow as pa

MOST_NODES = 4096
_COLUMNS = ("software_version", "hardware_version")
_COMMIT, _IMAGE = 1, 2  # bits of optional_field_flags


@dataclass(frozen=True, slots=True)
class NodeIdentity:
    """One node; empty texts for what it does not say. `build` is commit and checksum of its software."""

    version: str = ""
    build: str = ""
    hardware: str = ""
    unique_id: str = ""


class Identities:
    """Adds up batches: the last answer of each node, of at most `MOST_NODES`."""

    def __init__(self) -> None:
        self.all: dict[tuple[int, int], NodeIdentity] = {}

    def feed(self, tables: Mapping[str, pa.RecordBatch]) -> None:
        """Add the tables of a batch."""
        table = tables.get(NODE_INFO)
        if table is None or not {*_COLUMNS} <= {*table.schema.names}:
            return
        good = usable(table)
        for bus, src, software, hardware in zip(
            *(pylist(good.column(name)) for name in ("bus", "src", *_COLUMNS)), strict=True
        ):
            if isinstance(software, dict) and isinstance(hardware, dict) and len(self.all) < MOST_NODES:
                self.all[bus, src] = _identity(software, hardware)


def _identity(software: dict[str, Any], hardware: dict[str, Any]) -> NodeIdentity:
    flags = software.get("optional_field_flags") or 0
    build = [
        f"{software.get('vcs_commit') or 0:08x}" if flags & _COMMIT else "",
        f"image {software.get('image_crc') or 0:016x}" if flags & _IMAGE else "",
    ]
    unique = bytes(hardware.get("unique_id") or ())
    return NodeIdentity(
        version=_version(software),
        build=" ".join(filter(None, build)),
        hardware=_version(hardware),
        unique_id=unique.hex() if any(unique) else "",
    )


def _version(of: dict[str, Any]) -> str:
    parts = [of.get("major"), of.get("minor")]
    return ".".join(map(str, parts)) if None not in parts and any(parts) else ""
