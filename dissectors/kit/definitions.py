"""The definitions of types, as far as a transfer's framing goes: signatures, and lengths that never change."""

from __future__ import annotations

from binascii import crc_hqx
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dissectors import Registry

_SERVICE = 2  # this kind and those above it
CRC_BEGIN = 0xFFFF
_MOST_CODES = 4096  # of which something is remembered


@lru_cache(maxsize=4096)
def crc_start(signature: int) -> int:
    """Return the transfer CRC before any payload: that of the signature, low byte first (5.1)."""
    return crc_hqx(signature.to_bytes(8, "little"), CRC_BEGIN)


class Types:
    """The definitions of types, asked by the code of a transfer."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._mistaken: dict[tuple[int, int], Mapping[int, str]] = {}
        self._undefined: dict[int, Mapping[int, str]] = {}
        self._framing: dict[int, tuple[Sequence[int], int | None]] = {}

    def starts(self, code: int) -> Sequence[int]:
        """Return the values from which the CRC of a transfer may start: `crc_start` of the signatures."""
        return self.framing(code)[0]

    def signatures(self, code: int) -> Sequence[int]:
        """Return those of the known types with this ID, the preferred one first; none for an unknown type."""
        return self._registry.signatures(*_identity(code))

    def mistaken(self, code: int) -> Mapping[int, str]:
        """Return signatures that a sender may take by mistake, each with the type name that gives it."""
        key = _identity(code)
        if key not in self._mistaken:
            self._mistaken[key] = self._registry.mistaken(*key)
        return self._mistaken[key]

    def undefined(self, code: int) -> Mapping[int, str]:
        """Return signatures of further types with this ID, which are known by name only."""
        if code not in self._undefined:
            self._undefined[code] = self._registry.undefined(*_identity(code))
        return self._undefined[code]

    def fixed_bytes(self, code: int) -> int | None:
        """Return the payload bytes of a type whose transfers all have the same length."""
        message = self._registry.message(code >> 16 & 0xFF, code & 0xFFFF, code >> 24 & 0xFF)
        if message is None or message.layout.min_bits != message.layout.max_bits:
            return None
        return (message.layout.max_bits + 7) // 8

    def framing(self, code: int) -> tuple[Sequence[int], int | None]:
        """Return its `starts` and its `fixed_bytes`."""
        known = self._framing.get(code)
        if known is None:
            if len(self._framing) >= _MOST_CODES:
                self._framing.clear()
            starts = [crc_start(signature) for signature in self.signatures(code)]
            known = self._framing[code] = (starts, self.fixed_bytes(code))
        return known

    def starting_from(self, value: int) -> Sequence[str]:
        """Return full names of the types whose transfer CRCs start from this value."""
        return self._by_start.get(value, ())

    @cached_property
    def _by_start(self) -> Mapping[int, Sequence[str]]:
        found: dict[int, list[str]] = {}
        for signature, name in self._registry.all_signatures().items():
            found.setdefault(crc_start(signature), []).append(name)
        return found


def _identity(code: int) -> tuple[int, int]:
    """Return (is a service, type ID), whichever of its kinds or variants the code names."""
    return int(code >> 16 & 0xFF >= _SERVICE), code & 0xFFFF
