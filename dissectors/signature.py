"""The 64-bit data type signature of UAVCAN v0, which seeds every transfer CRC (4.3.1 prints six of them)."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

_MASK = 0xFFFF_FFFF_FFFF_FFFF
_POLY = 0x42F0_E1EB_A9EA_3693


def crc64(data: bytes, extend: int = 0) -> int:
    """Return CRC-64-WE of `data`, going on from `extend` (0 starts anew). The check value is 0x62EC59E3F1A4F00A."""
    table, crc = _table(), extend ^ _MASK
    for byte in data:
        crc = table[crc >> 56 ^ byte] ^ (crc << 8 & _MASK)
    return crc ^ _MASK


@cache
def _table() -> tuple[int, ...]:
    """Return what each byte at the top of the register does to it in eight steps."""
    table = []
    for byte in range(256):
        crc = byte << 56
        for _ in range(8):
            crc = ((crc << 1) ^ _POLY if crc >> 63 else crc << 1) & _MASK
        table.append(crc)
    return tuple(table)


def normalised(full_name: str, sections: Iterable[tuple[bool, Iterable[str]]]) -> str:
    """Return the text that is hashed: the name, then each section's `@union` and fields, `---` between sections.

    `sections` are (union, field lines); a field line is `saturated uint8 name`, `void3`, `full.Type name` or any of
    the first and last with `[N]` or `[<=N]` after the type. Comments, constants and layout of the source have no part
    in it.
    """
    bodies = ("\n".join([*(["@union"] if union else []), *lines]) for union, lines in sections)
    parts = [full_name]
    for number, body in enumerate(bodies):
        parts += ["---"] if number else []
        parts += [body] if body else []
    return "\n".join(parts)


def signature(text: str, nested: Iterable[int], override: int | None = None) -> int:
    """Return the data type signature: the CRC of the normalised text (or `override`), extended by nested signatures.

    `nested` holds the signature of each field of nested type (or array of it), in field order; both halves of a service
    share one signature.
    """
    value = crc64(text.encode("ascii")) if override is None else override
    for inner in nested:
        value = crc64(inner.to_bytes(8, "little") + value.to_bytes(8, "little"), value)
    return value
