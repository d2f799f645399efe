"""BLF as Vector's programs write it: files, containers and objects."""

from __future__ import annotations

import struct
import zlib

from kit.rows import RX, Frame

START = 1_600_000_000_000_000_000
CLASSIC, CONTAINER, ERROR_EXT, FD_MESSAGE, FD_64 = 1, 10, 73, 100, 101


def file(*containers: bytes, size: int = 0) -> bytes:
    """As CANoe writes one; the start is 2020-09-13 12:26:40."""
    times = struct.pack("<8H", 2020, 9, 0, 13, 12, 26, 40, 0) * 2
    body = b"".join(containers)
    return struct.pack("<4sL8B2Q2L", b"LOGG", 144, 2, 12, 0, 3, 2, 6, 8, 1, size, 0, 0, 0) + times + bytes(72) + body


def container(data: bytes, method: int = 2, packed: bytes | None = None) -> bytes:
    packed = (zlib.compress(data) if method == 2 else data) if packed is None else packed
    size = 32 + len(packed)
    head = struct.pack("<4sHHLL", b"LOBJ", 16, 1, size, CONTAINER) + struct.pack("<H6xL4x", method, len(data))
    return head + packed + bytes(size % 4)


def thing(kind: int, body: bytes, t: int = 0, flags: int = 2, version: int = 1) -> bytes:
    times = struct.pack("<LHHQ", flags, 0, 0, t) if version == 1 else struct.pack("<LBxHQ8x", flags, 0, 0, t)
    head = 16 + len(times)
    return struct.pack("<4sHHLL", b"LOBJ", head, version, head + len(body), kind) + times + body


def classic(t: int, number: int = 1, *, way: int = 0, channel: int = 1, code: int = 8, **how: int) -> bytes:
    return thing(CLASSIC, struct.pack("<HBBL8s", channel, way, code, number, bytes(range(8))), t, **how)


def frame(t: int, number: int = 1, flags: int = RX, bus: str = "can0") -> Frame:
    return Frame(START + t, bus, number, flags, bytes(range(8)))
