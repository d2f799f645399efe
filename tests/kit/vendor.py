"""A vendor of pumps: a type of its own, with a profile, and a capture of it."""

from __future__ import annotations

import struct

from kit import encode

ACME = 20777
PROFILE = """\
name = "Acme"
version = "1"
tree = "."

[enum.State]
0 = "idle"
2 = "spinning"

[message.Pump]
type = "acme.pump.Pump"
clause = "7"

[message.Pump.field.state]
enum = "State"

[message.Pump.field.pressure]
unit = "bar"
scale = 0.01
"""
PUMP = "uint3 state\nvoid5\nuint16 pressure\nfloat16 temperature\nPart[<=4] parts\n"
PART = "uint8 number\nint16 value\n"


def capture(signature: int) -> bytes:
    """Three transfers of the new type between those of an old one."""
    out = []
    for k in range(3):
        body = struct.pack("<BHe", 2 << 5, 150 + k, 21.5) + b"".join(struct.pack("<Bh", n, -n * k) for n in range(3))
        one = encode.Transfer("message", ACME, 42, body, signature, k)
        t = (1_700_000_000 + k) * 10**9
        out += one.frames(t)
        out += encode.transfer("RawCommand", {"cmd": [k] * 4}, 1, k).frames(t + 10**6)
    return "".join(encode.log_line(frame) + "\n" for frame in out).encode()
