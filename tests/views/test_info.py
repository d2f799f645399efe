"""The summary of a capture: its sums, its nodes, what it says of itself."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pytest
from kit import VECTORS, encode
from kit.traffic import MS, SECOND, START, at, lines, status, throttle

from analyzer.facts import traffic
from analyzer.facts.summary import Facts, Summary
from analyzer.views.info import duration, render, render_json
from analyzer.views.terminal import display_width

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors import Registry

INFO = "uavcan.protocol.GetNodeInfo.Response"


class Stored:
    def __init__(self, name: str = "crash.log", size: int = 1) -> None:
        self.name, self.size, self.form, self.digest = name, size, "candump text", "9f2c" * 16
        self.unit, self.notes = "line", list[str]()


def facts(got: Any, registry: Registry, name: str = "crash.log") -> Facts:
    summary = Summary(registry, traffic.ForeignIds())
    for batch in got.batches:
        summary.feed(batch)
    return summary.finish([Stored(name)], got.engine)


@pytest.mark.parametrize("name", ["tm_golden", "tm_golden_fd", "neighbours", "violations"])
def test_sums_and_widths(decode: Callable[..., Any], registry: Registry, name: str) -> None:
    got = decode((VECTORS / f"{name}.log").read_bytes())
    found = facts(got, registry)
    assert found.balanced
    assert found.transfers == len(got.transfers) == sum(node.count for node in found.nodes)
    assert found.broken == sum(row["status"] not in ("ok", "unchecked") for row in got.transfers)
    text = render(found, types=True)
    assert max(map(display_width, text.splitlines())) <= 80
    assert f"Lines      {len(got.frames)} = {len(got.frames)} frames    balanced" in text
    used = got.verdicts.count("used")
    assert f"Frames     {len(got.frames)} = {used} used" in text
    content = json.loads(render_json(found))
    assert content["verdicts"]["used"] == used
    assert content["nodes"][0]["sends"] == found.nodes[0].sends
    assert sum(one["count"] for one in content["senders"]) == found.transfers


def test_rates_and_last_seen(decode: Callable[..., Any], registry: Registry) -> None:
    step = 10 * MS
    sent = [[at(k * step, f) for f in throttle(k).frames()] for k in range(1001)]
    late = [at(5 * SECOND + k, f) for k, f in enumerate(status(0).frames())]
    text = lines(*sent[:501], late, *sent[501:])
    found = facts(decode(text), registry)
    by_type = {node.sends: node for node in found.nodes}
    assert by_type["RawCommand"].hz == pytest.approx(100)
    assert by_type["ESCStatus"].hz is None
    assert by_type["ESCStatus"].channels == (3,)
    (bus,) = found.buses
    assert (bus.frames, bus.peak) == (1004, 103)
    assert bus.mean == pytest.approx(100.3)
    bits = 1001 * (67 + 64) + 67 * 3 + 8 * sum(len(f.data) for f in late)
    assert bus.load == pytest.approx(100 * bits / 10 / 1e6)
    rows = [line.split() for line in render(found, types=True).splitlines() if line[:4] in ("   1", "  10")]
    assert [row[-1] for row in rows[:2]] == ["all", rows[3][-1]]
    assert [row[-2:] for row in rows[2:]] == [["start", "end"], [rows[3][-1]] * 2]


def test_peak_survives_the_end_of_a_batch(decode: Callable[..., Any], registry: Registry, flush: object) -> None:
    frames = [at(k * MS, f) for k in range(1500) for f in throttle(k).frames()]
    text = lines(frames).splitlines(keepends=True)
    pieces = [b"".join(text[:400]), flush, b"".join(text[400:])]
    assert facts(decode(*pieces), registry).buses[0].peak == 1000


def test_what_the_capture_can_show(decode: Callable[..., Any], registry: Registry) -> None:
    plain = lines(throttle(0).frames())
    assert facts(decode(plain), registry).judge == {
        "transfers": "yes", "timing": "yes", "drops": "unknown", "errors": "NO", "start": "unknown",
        "stamps": "absolute, nanoseconds",
    }  # fmt: skip
    drop = encode.drop_line("can0", 3, 3).encode() + b"\n"
    error = encode.log_line(encode.Frame(4, bytes(8), START, error=True)).encode() + b"\n"
    both = facts(decode(plain + drop + error), registry).judge
    assert (both["drops"], both["errors"]) == ("yes", "yes")
    overflow = encode.log_line(encode.Frame(4, bytes([0, 1, 0, 0, 0, 0, 0, 0]), START, error=True)).encode() + b"\n"
    assert facts(decode(plain + error), registry).judge["drops"] == "unknown"
    assert facts(decode(plain + overflow), registry).judge["drops"] == "yes"
    untimed = facts(decode(lines(throttle(0).frames(), timed=False)), registry)
    assert (untimed.judge["timing"], untimed.start) == ("NO", None)
    assert "Time       not recorded" in render(untimed)


def test_an_empty_capture(decode: Callable[..., Any], registry: Registry) -> None:
    found = facts(decode(b""), registry)
    assert render(found).endswith("No DroneCAN transfers.\n")
    content = json.loads(render_json(found))
    assert (content["nodes"], content["senders"]) == ([], [])
    assert found.judge["transfers"] == "NO"


def test_software_versions(decode: Callable[..., Any], registry: Registry) -> None:
    got = decode((VECTORS / "neighbours.log").read_bytes())
    assert {node.software for node in facts(got, registry).nodes if node.node == 10} == {"2.2"}
    foc = decode((VECTORS / "tm_golden.log").read_bytes())
    assert {node.software for node in facts(foc, registry).nodes if node.node == 10} == {"SW-V2.2.3"}


def test_foreign_frames_are_named(decode: Callable[..., Any], registry: Registry) -> None:
    foreign = [encode.Frame(0x123, bytes([k]), extended=False) for k in range(9)]
    found = facts(decode(lines(throttle(0).frames(), foreign, [encode.Frame(7, b"", extended=False)])), registry)
    assert found.foreign == (("123", 9), ("007", 1))
    assert "Foreign    10 frames, ids 123 9x, 007 1x" in render(found)


def test_foreign_follows_what_settles_later(decode: Callable[..., Any], registry: Registry, flush: object) -> None:
    """An unknown type is believed after some transfers; its first frames were reported as foreign."""
    sent = [
        lines([at(k * SECOND, f) for f in encode.Transfer("message", 64001, 10, b"ab", 0, k).frames()])
        for k in range(8)
    ]
    got = decode(*[piece for text in sent for piece in (text, flush)])
    assert any(len(batch.settled) for batch in got.batches)
    found = facts(got, registry)
    assert found.foreign == ()
    assert "Unknown    type 64001 8x" in render(found)


def test_the_dialect_of_each_node(decode: Callable[..., Any], registry: Registry) -> None:
    def esc(node: int, mode: int, kelvin: float) -> list[encode.Frame]:
        fields = {"error_count": mode << 12, "voltage": 1.0, "current": 1.0, "temperature": kelvin, "rpm": 0,
                  "power_rating_pct": 0, "esc_index": 0}  # fmt: skip
        return encode.transfer("ESCStatus", fields, node).frames()

    got = decode(lines(esc(20, 4, 40.0), esc(21, 0, 300.0), esc(22, 0, 600.0)))
    choices = {(s.node, s.reading): s.choice for s in facts(got, registry).readings}
    assert choices == {
        (20, "dialect"): "tm", (20, "temperature"): "degC",
        (21, "dialect"): "dronecan", (21, "temperature"): "K",
        (22, "dialect"): "dronecan", (22, "temperature"): "undecided",
    }  # fmt: skip
    assert "Reading    ESCStatus.temperature: degC, node 20" in render(facts(got, registry))


def test_types_that_share_an_id_are_counted_apart(decode: Callable[..., Any]) -> None:
    transfers = decode(lines(*(throttle(k).frames() for k in range(5)))).batches[0].transfers
    at = transfers.schema.get_field_index("variant")
    mixed = transfers.set_column(at, transfers.schema.field(at), pa.array([0, 1, 0, 1, 1], pa.uint8()))
    talks = traffic.Talks()
    assert talks.feed(mixed) == {(0, 1030, 0), (0, 1030, 1)}
    assert {key: talk.count for key, talk in talks.all.items()} == {(0, 1, (0, 1030, 0)): 2, (0, 1, (0, 1030, 1)): 3}


def test_memory_is_bounded(monkeypatch: pytest.MonkeyPatch, decode: Callable[..., Any], registry: Registry) -> None:
    monkeypatch.setattr(traffic, "MOST_TALKS", 3)
    monkeypatch.setattr(traffic, "MOST_IDS", 2)
    sent = [replace(f, id=f.id & ~0x7F | node) for node in range(1, 6) for f in throttle(0).frames()]
    foreign = [encode.Frame(number, b"\x01", extended=False) for number in range(5)]
    found = facts(decode(lines(sent, foreign)), registry)
    assert (len(found.nodes), found.not_listed, found.transfers) == (3, 2, 5)
    assert len(found.foreign) == 2
    assert "and 2 transfers of further nodes and types" in render(found)


def test_long_lists_are_cut_until_all_is_asked_for(decode: Callable[..., Any], registry: Registry) -> None:
    sent = [replace(f, id=f.id & ~0x7F | node, bus=f"can{node}") for node in range(1, 60) for f in throttle(0).frames()]
    found = facts(decode(lines(sent)), registry)
    short, whole = (render(found, everything=everything, types=True) for everything in (False, True))
    assert "and 19 more, none of them odd (--all)" in short
    assert "and 19 more (--all)" in short
    assert "and 51 more (--all)" in short
    assert "more (--all)" not in whole
    assert max(map(len, whole.splitlines())) <= 80
    assert sum(line.startswith("can") for line in whole.splitlines()) == 2 * 59


def test_hostile_names_are_harmless(decode: Callable[..., Any], registry: Registry) -> None:
    text = render(facts(decode(lines(throttle(0).frames())), registry, "a\x1b[2J\n" + "b" * 300))
    assert "\x1b" not in text
    assert max(map(len, text.splitlines())) <= 80


@pytest.mark.parametrize(
    ("ns", "text"),
    [(0, "0.000 s"), (59_999_999_999, "59.999 s"), (305 * SECOND, "5 min 5 s"), (17268 * SECOND, "4 h 47 min 48 s")],
)
def test_duration(ns: int, text: str) -> None:
    assert duration(ns) == text


def test_relative_captures_say_so(decode: Callable[..., Any], registry: Registry) -> None:
    frame = throttle(0).frames()[0]
    text = "".join(encode.log_line(replace(frame, t=k * SECOND)) + "\n" for k in range(3)).encode()
    assert "Time       0.000000 s to 2.000000 s (relative), 2.000 s" in render(facts(decode(text), registry))
    assert np.iinfo(np.int64).max > START


def test_a_forced_reading_stands_against_the_data(decode: Callable[..., Any], registry: Registry) -> None:
    data = (VECTORS.parent.parent / "captures" / "hover.log").read_bytes()
    got = facts(decode(data, forced={11: ["dronecan"], 12: ["K"]}), registry)
    stated = {(s.reading, s.node): s.choice for s in got.readings}
    assert stated["dialect", 11] == "dronecan (forced)"
    assert stated["dialect", 12] == "tm"
    assert stated["temperature", 12] == "K (forced)"
    assert stated["temperature", 11] == "degC"


def test_whether_the_start_was_seen(decode: Callable[..., Any], registry: Registry) -> None:
    def judged(*uptimes: int) -> str:
        rest = {"health": 0, "mode": 0, "sub_mode": 0, "vendor_specific_status_code": 0}
        kind = "uavcan.protocol.NodeStatus"
        sent = [encode.transfer(kind, {"uptime_sec": up, **rest}, 20 + k, 0) for k, up in enumerate(uptimes)]
        frames = [frame for k, one in enumerate(sent) for frame in one.frames(START + k * SECOND)]
        return str(facts(decode(lines(frames)), registry).judge["start"])

    assert [judged(0), judged(0, 1), judged(2), judged(3), judged(0, 90)] == ["yes", "yes", "yes", "NO", "NO"]


def test_times_of_several_kinds_say_nothing_together(decode: Callable[..., Any], registry: Registry) -> None:
    rows = lines(throttle(0).frames()) + b"(12.000000) can0 123#11\n" + lines(throttle(1).frames(), timed=False)
    mixed = facts(decode(rows), registry)
    assert mixed.judge["timing"] == "NO"
    assert mixed.judge["stamps"].startswith("mixed: absolute, ")
    assert [bus.mean for bus in mixed.buses] == [None]
    assert "cannot be compared" in render(mixed)
    assert " h " not in render(mixed)
