"""Events of recordings, whole stories against their keys, and laws."""

from __future__ import annotations

import json
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import CAPTURES
from kit.simulated import key_of
from kit.strategies import examples
from kit.traffic import ALIVE, START, WELL
from kit.traffic import commanded as command
from kit.traffic import in_order as text
from kit.traffic import of_kinds as kinds
from kit.traffic import turning as status

from analyzer.app.request import Request
from analyzer.app.run import Run
from analyzer.flight.finder import EventFinder

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors import Registry

    Told = Callable[..., tuple[list[dict[str, Any]], list[dict[str, Any]]]]

# ---- recording


def flight_text(stop: int = 12_000) -> str:
    rows = [status(t) for t in range(0, stop, 40)] + [command(t + 3, 3000) for t in range(0, stop, 11)]
    rows += [(t + 5, 10, ALIVE, WELL | {"uptime_sec": 60 + t // 1000}) for t in range(0, stop, 500)]
    return text(rows).decode()


def moved(said: str, since: int, by: float = 0, *, without: float = 0) -> bytes:
    """Move times from `since` ms on by `by` s, or leave out `without` seconds from there."""
    start, lines = START / 1e9 + since / 1000, []
    for line in said.splitlines():
        t = float(line[1:18])
        if not start <= t < start + without:
            lines.append(f"({t + by * (t >= start):.6f}{line[18:]}\n")
    return "".join(lines).encode()


@pytest.mark.parametrize("by", [-7213.0, -0.5, 7213.0])
def test_a_clock_that_steps(by: float, told: Told) -> None:
    events = told(moved(flight_text(), 6000, by))[1]
    (one,) = kinds(events, "clock", "gap", "silence", "commands stop", "rate", "restart")
    assert one["kind"] == "clock"
    assert one["text"].startswith(f"the clock steps {'back by ' if by < 0 else 'by +'}")
    assert json.loads(one["values"])["length_s"] == pytest.approx(by, abs=0.02)
    assert (one["bus"], one["node"]) == (None, None)


def test_frames_that_the_recorder_lost(told: Told) -> None:
    (one,) = kinds(told(moved(flight_text(), 6000, without=4.5))[1], "clock", "gap", "silence", "commands stop")
    assert one["kind"] == "gap"
    assert one["text"].endswith("senders jump, frames are missing")


def test_nobody_sent(told: Told) -> None:
    """IDs run on, and uptimes have grown: time has passed."""
    rows = [status(t) for t in (*range(0, 6000, 40), *range(11_000, 14_000, 40))]
    rows += [command(t + 3, 3000) for t in (*range(0, 6000, 10), *range(11_000, 14_000, 10))]
    times = (*range(0, 6000, 500), *range(11_000, 14_000, 500))
    rows += [(t + 5, 10, ALIVE, WELL | {"uptime_sec": 60 + t // 1000}) for t in times]
    (one,) = kinds(told(text(rows))[1], "clock", "gap", "silence", "commands stop")
    assert (one["kind"], one["text"].partition(": ")[2]) == ("gap", "transfer IDs run on, nobody sent")


def test_error_frames_and_losses(told: Told) -> None:
    said = flight_text(2000).splitlines(keepends=True)
    at = START / 1e9 + 1
    said.insert(
        len(said) // 2, f"({at:.6f}) can0 20000040#0000000000000000\n({at + 0.1:.6f}) can0 20000080#0000000000000000\n"
    )
    said.insert(
        len(said) // 2 + 1, f"({at + 0.2:.6f}) DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)\n"
    )
    events = told("".join(said).encode())[1]
    (errors,) = kinds(events, "errors")
    assert json.loads(errors["values"]) == {"count": 2}
    assert errors["text"].startswith("2 error frames: bus-off")
    assert [one["text"] for one in kinds(events, "bus state")] == ["the controller is bus-off"]


# ---- captures


def test_the_story_of_an_esc_that_fails(registry: Registry) -> None:
    """Against the key: hot at 4.495 s, error mode at 4.675 s, each within the report before and the one behind."""
    path = CAPTURES / "esc-failure.mcap"
    finder = EventFinder(registry)
    for batch in Run(Request((str(path),))).batches():
        finder.feed(batch)
    events = [
        one | {"t": one["t"].value if one["t"] else None, "t_end": one["t_end"].value}
        for one in finder.finish().to_pylist()
    ]
    key = json.loads(key_of(path).read_text())["scenario"]["events"]
    (fault,) = kinds(events, "fault")
    mode = next(one for one in kinds(events, "mode") if one["text"] == "operating -> error")
    assert (fault["ch"], fault["text"]) == (1, "MOS over temperature")
    for one, said in zip((fault, mode), key[1:], strict=True):
        assert one["t"] <= said["t_ns"] <= one["t_end"]
    assert fault["until"] is None
    assert [one["text"] for one in kinds(events, "health")] == ["ok -> error"]
    assert {one["node"] for one in events if one["t_end"] > key[0]["t_ns"] and one["kind"] != "parameter"} == {11}


@pytest.mark.parametrize("name", ["hover-4", "hover", "fd", "recording-ends", "reordering"])
def test_nothing_befalls_a_healthy_flight(name: str, told: Told) -> None:
    assert {one["kind"] for one in told((CAPTURES / f"{name}.log").read_bytes())[1]} <= {"mode", "parameter"}


def test_stories(told: Told) -> None:
    """By what their keys say was done."""
    found = {
        name: [
            one for one in told((CAPTURES / f"{name}.log").read_bytes())[1] if one["kind"] not in {"mode", "parameter"}
        ]
        for name in ("command-loss", "bus-break", "pack-sag", "startup")
    }
    stop = json.loads((CAPTURES / "command-loss.key.json").read_text())["scenario"]["events"][0]["t_ns"]
    first, *others = found["command-loss"]
    assert (first["kind"], first["node"]) == ("commands stop", 10)
    assert first["t"] <= stop <= first["t_end"]
    assert [(one["kind"], one["text"], one["ch"]) for one in others] == [
        ("fault", "throttle loss", ch) for ch in (1, 2, 3)
    ]
    assert [one["kind"] for one in found["bus-break"]] == ["errors", "bus state", "bus state", "fault", "gap"]
    assert [one["kind"] for one in found["pack-sag"]] == ["sag"] * 3 + ["fault"] * 3
    assert {one["text"] for one in kinds(found["pack-sag"], "fault")} == {"under voltage"}
    assert [(one["kind"], one["node"]) for one in found["startup"]] == [("join", 13), ("join", 12), ("join", 14)]


SAID = [
    (CAPTURES / f"{name}.log").read_bytes() for name in ("bus-break", "command-loss", "pack-sag", "faults", "startup")
]


SILENT = text(
    [status(t) for t in (*range(0, 1000, 20), *range(1200, 2000, 20))] + [command(t, 90) for t in range(3, 2000, 10)]
)


@examples(25)
@given(data=st.data())
def test_law_any_cut_gives_the_same(told: Told, flush: object, data: st.DataObject) -> None:
    said = data.draw(st.sampled_from([*SAID, moved(flight_text(4000), 2000, -3.0), SILENT]))
    cuts = data.draw(st.lists(st.integers(0, len(said)), max_size=5))
    pieces = [part for a, b in pairwise(sorted({0, *cuts, len(said)})) for part in (said[a:b], flush)]
    assert told(*pieces) == told(said)


def test_a_cut_just_before_a_hole_counts_nobody_twice(told: Told, flush: object) -> None:
    said = moved(flight_text(), 6000, without=4.5)
    cut = said.index(f"({START / 1e9 + 10.5:.1f}".encode())
    assert told(said[:cut], flush, said[cut:]) == told(said)


@examples(25)
@given(said=st.binary(max_size=200))
def test_law_nothing_raises(told: Told, said: bytes) -> None:
    flights, _ = told(said)
    assert flights == []
