"""What was sent against what a table shows."""

from __future__ import annotations

import math
import struct
from typing import Any

import encode


def same(sent: Any, got: Any) -> bool:
    """Equal to the last bit of the number, NaN equals NaN; members of a union that are null were not sent."""
    if isinstance(sent, dict):
        if not isinstance(got, dict) or not sent.keys() <= got.keys():
            return False
        return all(got[name] is None for name in got.keys() - sent.keys()) and all(
            same(value, got[name]) for name, value in sent.items()
        )
    if isinstance(sent, (list, tuple)):
        return isinstance(got, list) and len(sent) == len(got) and all(map(same, sent, got))
    if isinstance(sent, encode.Code):
        sent = struct.unpack("<e", struct.pack("<H", sent))[0]
    if isinstance(sent, float) and math.isnan(sent):
        return isinstance(got, float) and math.isnan(got)
    if isinstance(sent, float):
        return isinstance(got, float) and sent == got and math.copysign(1, sent) == math.copysign(1, got)
    return got is not None and sent == got


def differing(sent: dict[str, Any], row: dict[str, Any]) -> dict[str, tuple[Any, Any]]:
    """The fields of a message whose column shows something else: name -> (sent, shown)."""
    return {name: (value, row.get(name)) for name, value in sent.items() if not same(value, row.get(name))}
