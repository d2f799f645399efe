"""Captures made by hand: transfers at their times, and the one that every node sends."""

from __future__ import annotations

from operator import itemgetter
from typing import Any

from encode import Transfer, log_line, transfer
from sequences import MS, START

ALIVE = "uavcan.protocol.NodeStatus"
Sent = tuple[float, Transfer]  # ms from the start


def log(*sent: Sent) -> str:
    """The frames of transfers, in the order of their first ones."""
    order = sorted(sent, key=itemgetter(0))
    return "".join(log_line(frame) + "\n" for t, one in order for frame in one.frames(START + round(t * MS)))


def alive(uptime: int, src: int = 11, transfer_id: int = 0, **more: Any) -> Transfer:
    """A NodeStatus: all is well unless `more` says otherwise; uptime in s."""
    well = dict.fromkeys(("health", "mode", "sub_mode", "vendor_specific_status_code"), 0)
    return transfer(ALIVE, well | {"uptime_sec": uptime} | more, src, transfer_id)
