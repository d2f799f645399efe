"""Requests and responses: which belong together, and what is counted of those that stand alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from kit import encode
from kit.traffic import MS, SECOND, START, lines

if TYPE_CHECKING:
    from collections.abc import Callable

INFO = "uavcan.protocol.GetNodeInfo"
ANSWER = {
    "status": {"uptime_sec": 1, "health": 0, "mode": 0, "sub_mode": 0, "vendor_specific_status_code": 0},
    "software_version": {"major": 1, "minor": 0, "optional_field_flags": 0, "vcs_commit": 0, "image_crc": 0},
    "hardware_version": {"major": 1, "minor": 0, "unique_id": [0] * 16, "certificate_of_authenticity": []},
    "name": list(b"x"),
}


def asks(t: int, number: int, client: int = 1, server: int = 20) -> list[Any]:
    return encode.transfer(f"{INFO}.Request", {}, client, number, dst=server).frames(START + t)


def answers(t: int, number: int, client: int = 1, server: int = 20) -> list[Any]:
    return encode.transfer(f"{INFO}.Response", ANSWER, server, number, dst=client).frames(START + t, gap=MS)


def rows(tables: Callable[..., Any], *parts: list[Any], **how: Any) -> dict[tuple[str, str], tuple[Any, ...]]:
    frames = sorted((frame for part in parts for frame in part), key=lambda frame: frame.t)
    found = tables(lines(frames, **how), names=["services"])["services"].records()
    names = ("requests", "answered", "unanswered", "unasked")
    return {(row["client"], row["server"]): (*(row[name] for name in names), row["max_ms"]) for row in found}


def test_an_answer_belongs_to_the_last_request_of_its_number(tables: Callable[..., Any]) -> None:
    last = len(answers(0, 0)) - 1
    found = rows(tables, asks(0, 3), asks(500 * MS, 3), answers(510 * MS, 3), asks(SECOND, 4), answers(1020 * MS, 4))
    assert found == {("1", "20"): (3, 2, 1, 0, pytest.approx(20 + last))}


def test_what_comes_late_twice_or_unasked_is_no_answer(tables: Callable[..., Any]) -> None:
    late = rows(tables, asks(0, 1), answers(2001 * MS, 1), asks(5 * SECOND, 2), answers(5010 * MS, 2))
    assert late["1", "20"][:4] == (2, 1, 1, 1)
    twice = rows(tables, asks(0, 1), answers(10 * MS, 1), answers(200 * MS, 1))
    assert twice["1", "20"][:4] == (1, 1, 0, 1)
    other = rows(tables, asks(0, 1), answers(10 * MS, 2), asks(SECOND, 2), answers(1010 * MS, 2))
    assert other["1", "20"][:4] == (2, 1, 1, 1)


def test_just_in_time_is_in_time(tables: Callable[..., Any]) -> None:
    found = rows(tables, asks(0, 1), answers(2000 * MS, 1))
    assert found["1", "20"][:4] == (1, 1, 0, 0)


def test_links_are_apart(tables: Callable[..., Any]) -> None:
    found = rows(tables, asks(0, 1), asks(MS, 1, server=21), answers(20 * MS, 1, server=21), asks(2 * MS, 1, client=2))
    assert {link: counts[:3] for link, counts in found.items()} == {
        ("1", "20"): (1, 0, 1), ("1", "21"): (1, 1, 0), ("2", "20"): (1, 0, 1),
    }  # fmt: skip


def test_without_times_they_are_counted_but_not_timed(tables: Callable[..., Any]) -> None:
    parts = [part for n in range(3) for part in (asks(n * SECOND, n), answers(n * SECOND + MS, n))]
    found = rows(tables, *parts, asks(9 * SECOND, 9), timed=False)
    assert found == {("1", "20"): (4, 3, 1, 0, None)}


@pytest.mark.parametrize("cut", [1, 3, 40])
def test_an_answer_in_another_batch(cut: int, tables: Callable[..., Any], flush: object) -> None:
    parts = [part for n in range(6) for part in (asks(n * SECOND, n), answers(n * SECOND + 900 * MS, n))]
    text = lines(*parts).splitlines(keepends=True)
    chunks = [one for at in range(0, len(text), cut) for one in (b"".join(text[at : at + cut]), flush)]
    (row,) = tables(*chunks, names=["services"])["services"].records()
    assert (row["requests"], row["answered"], row["unasked"]) == (6, 6, 0)
