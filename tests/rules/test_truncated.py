"""Whatever a sound CRC can carry: messages that end too early, or are nonsense from the first bit on. No rule fails."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from kit.encode import PACKETS, TYPES, Transfer, packet, transfer
from kit.judged import outcome
from kit.traffic import Timed, alive, log

MOST = 48


def nodes() -> list[Timed]:
    """Two nodes that are believed."""
    return [(1000.0 * k, alive(k, src, k)) for k in range(6) for src in (11, 12)]


def cut(seed: int) -> list[Timed]:
    """Every type that there is, with payloads of every length."""
    chance = random.Random(seed)
    found: list[Timed] = []
    for kind in TYPES.values():
        dst = 12 if kind.kind in ("request", "response") else None
        whole = Transfer(kind.kind, kind.type_id, 11, b"", kind.signature, dst=dst)
        for size in range(MOST):
            payload = bytes(size) if seed == 0 else chance.randbytes(size)
            found.append((6000 + 3.0 * len(found), replace(whole, payload=payload, transfer_id=size % 32)))
    return found


@pytest.mark.sampled(4)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_messages_of_every_length(seed: int) -> None:
    assert outcome(log(*nodes(), *cut(seed)), ["all"]).runs


def test_packets_of_every_length() -> None:
    sent: list[Timed] = []
    for name, (_, fields) in PACKETS.items():
        values = {one.split(":")[0]: b"V1" if one.endswith("s") else 0 for one in fields.split()}
        whole = packet(name, 1, 0xA1, **values)
        carrier = name.partition(".")[0]
        for size in range(len(whole) + 1):
            data = {"data_sequence": size, "data": list(whole[:size])}
            sent.append((6000 + 5.0 * len(sent), transfer(carrier, data, 11, size)))
    assert outcome(log(*nodes(), *sent), ["all"]).runs
