"""The packet list: what stands in its columns, and that it fits them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from kit import VECTORS, encode
from kit.strategies import Capture, captures, examples
from kit.traffic import SECOND, START, at, lines, push, retail, status, throttle

from analyzer.facts.summary import Summary
from analyzer.tables import STATUSES
from analyzer.views.details.hexdump import HexDumps
from analyzer.views.details.tree import Tree
from analyzer.views.frames.window import FrameWindow
from analyzer.views.info import render, render_json
from analyzer.views.listing import Listing
from analyzer.views.records import Csv, JsonLines
from analyzer.views.terminal import Palette, display_width
from analyzer.views.times import TimeFormat
from analyzer.views.troubles import broken_words
from analyzer.window.listed import ListedRows

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from dissectors import Registry


def listed(got: Any, registry: Registry, width: int | None = None, **more: Any) -> list[str]:
    view = Listing(registry, TimeFormat(more.pop("mode", "r"), more.pop("zero", None)), width=width, **more)
    return [line for batch in got.batches for line in view.lines(batch)]


def test_the_columns_are_those_of_the_design(decode: Callable[..., Any], registry: Registry) -> None:
    fields = {"error_count": 4 << 12, "voltage": 46.1, "current": 31.2, "temperature": 64.0, "rpm": 4788,
              "power_rating_pct": 71, "esc_index": 3}  # fmt: skip
    channels = [round(p * 81.91) for p in (71, 70, 72, 71, 94, 70, 71, 70)]
    sent = encode.transfer("RawCommand", {"cmd": channels}, 1, 17)
    got = decode(lines(sent.frames(START), encode.transfer("ESCStatus", fields, 23, 4).frames(START + 1_969_000)))
    assert listed(got, registry, zero=START + 3_791_000) == [
        "    Frame  Time [s]    Src>Dst Type         ID  Info",
        "        1  -0.003791     1>*   RawCommand   17  71 70 72 71 94 70 71 70 %",
        "        4  -0.001822    23>*   ESCStatus     4  ch4 46.1V 31.2A 64C 4788rpm 71%",
    ]


@pytest.mark.parametrize("width", [40, 80, 200])
@pytest.mark.parametrize("name", ["tm_golden", "violations", "neighbours"])
def test_lines_fit_a_terminal(decode: Callable[..., Any], registry: Registry, name: str, width: int) -> None:
    got = decode((VECTORS / f"{name}.log").read_bytes())
    cut, whole = listed(got, registry, width), listed(got, registry)
    assert len(cut) == len(whole)
    assert max(map(display_width, cut)) <= width
    assert max(map(len, whole)) > 80
    assert not any("…" in line for line in whole)


def test_a_broken_transfer_says_how_far_it_came(decode: Callable[..., Any], registry: Registry) -> None:
    lost = status(1).frames()
    got = decode(lines(status(0).frames(), lost[:1], status(2).frames()[:0], status(2).frames(), lost[2:]))
    (line,) = [line for line in listed(got, registry) if line.startswith("x")]
    assert line.split()[:2] == ["x", "4"]
    assert line.endswith("2 of 3 frames")
    end = decode(lines(status(0).frames(), status(1).frames()[:2]))
    assert listed(end, registry)[-1].endswith("capture ends after 2 of 3 frames")
    whole = broken_words(STATUSES.index("interrupted"), 3, 1, registry.resolve("ESCStatus"), gap=True)
    assert whole == "broken, 3 frames, 1 byte"
    open_end = decode(lines(push(0).frames(), push(1).frames()[:2]))
    assert listed(open_end, registry)[-1].endswith("capture ends after 2 frames, 12 bytes")


def test_a_bad_crc_shows_values_and_both_sums(decode: Callable[..., Any], registry: Registry) -> None:
    frames = status(0).frames()
    wrong = replace(frames[1], data=frames[1].data[:2] + bytes([frames[1].data[2] ^ 1]) + frames[1].data[3:])
    found = decode(lines([frames[0], wrong, frames[2]]))
    (line,) = [line for line in listed(found, registry) if line.startswith("x")]
    (row,) = found.transfers
    assert line.endswith(f"rpm 3% bad CRC {row['crc_wire']:04X}, computed {row['crc_here']:04X}")


def test_anomalies_stand_below_in_words(decode: Callable[..., Any], registry: Registry) -> None:
    got = decode(lines(throttle(0).frames(), throttle(5).frames(), [retail(f, 0x20) for f in throttle(6).frames()]))
    found = listed(got, registry)
    assert found[3] == "           ! transfer ID skips (+5 instead of +1)"
    assert found[5].startswith("           ! single frame with toggle 1")
    assert len(found) == 6


def test_packets_come_with_their_names(decode: Callable[..., Any], registry: Registry) -> None:
    good = encode.packet("PUSHCAN.MotorStatus", 1, 0xA2, voltage=5000)
    bad = good[:-1] + bytes([good[-1] ^ 1])
    sent = encode.transfer("PUSHCAN", {"data_sequence": 7, "data": list(good + bad + b"\x01")}, 10)
    (line,) = listed(decode(lines(sent.frames())), registry)[1:]
    first, second, rest, carrier = line.split(" | ")
    assert "MotorStatus unit 2 50.0V" in first
    assert second.endswith("(packet damaged)")
    assert (rest, carrier) == ("no header: 01", "sequence 7")


def test_unknown_types_show_bounded_bytes(decode: Callable[..., Any], registry: Registry) -> None:
    payload = bytes(range(200))
    sent = [encode.Transfer("message", 64001, 10, payload, 0x1122334455667788, k).frames() for k in range(4)]
    found = listed(decode(lines(*sent)), registry)[1:]
    assert len(found) == 4
    assert "type 64001" in found[0]
    assert found[0].endswith("3D 3E 3F ... 200 bytes")


def test_the_bus_column_comes_with_a_second_bus(decode: Callable[..., Any], registry: Registry) -> None:
    one, two = throttle(0).frames()[0], replace(throttle(0, 200).frames()[0], bus="slcan12")
    assert " Bus" not in listed(decode(lines([one])), registry)[0]
    found = listed(decode(lines([one, two])), registry)
    assert found[0] == "    Frame  Time [s]    Src>Dst Bus     Type         ID  Info"
    assert [line[31:39] for line in found[1:]] == ["can0    ", "slcan12 "]


def test_the_header_comes_again_when_the_bus_column_appears(
    decode: Callable[..., Any], registry: Registry, flush: object
) -> None:
    one, two = throttle(0).frames()[0], replace(throttle(1).frames()[0], bus="can1")
    found = listed(decode(lines([one]), flush, lines([two])), registry)
    assert [line.startswith("    Frame") for line in found] == [True, False, True, False]


def test_services_say_which_half_they_are(decode: Callable[..., Any], registry: Registry) -> None:
    found = listed(decode((VECTORS / "neighbours.log").read_bytes()), registry)
    assert any("    10>1   " in line and "  response: " in line for line in found)
    assert any(line.endswith("  request") for line in found)


def test_missing_times_are_blank(decode: Callable[..., Any], registry: Registry) -> None:
    found = listed(decode(lines(throttle(0).frames(), timed=False)), registry)
    assert found[1].split()[:2] == ["1", "1>*"]


def test_large_times_keep_the_columns(decode: Callable[..., Any], registry: Registry) -> None:
    got = decode(lines(throttle(0).frames(), [at(40_000 * SECOND, f) for f in throttle(1).frames()]))
    for mode in ("r", "ad"):
        first, silence, second = listed(got, registry, mode=mode)[1:]
        assert first.index("RawCommand") == second.index("RawCommand") == silence.index("gap")


def test_an_entry_of_a_far_time_keeps_its_numbers(tmp_path: Path, command: Callable[..., tuple[int, str, str]]) -> None:
    """A frame of no transfer whose time needs more room than those of the header did."""
    path = tmp_path / "far.log"
    far = replace(status(1).frames()[1], t=9_000_000_000 * SECOND)
    path.write_bytes(lines(status(0).frames(), [far]))
    for way in ("r", "a", "ad", "e"):
        _, out, _ = command("decode", "-t", way, str(path))
        assert " 10>*   ESCStatus" in out.splitlines()[-1]


def test_colour_marks_only_what_is_wrong(decode: Callable[..., Any], registry: Registry) -> None:
    got = decode(lines(throttle(0).frames(), status(0).frames()[:2]))
    head, good, broken = listed(got, registry, palette=Palette(True))
    assert head.startswith("\x1b[1m")
    assert "\x1b" not in good
    assert broken.startswith("\x1b[31mx")


def dumped(batch: Any, registry: Registry, window: FrameWindow, **more: Any) -> list[str]:
    dumps = HexDumps(registry, window, **more)
    return [line for text in dumps.texts(batch, np.arange(len(batch.transfers))) for line in text.split("\n")[:-1]]


def test_the_bytes_are_told_apart(decode: Callable[..., Any], registry: Registry) -> None:
    got = decode(lines(encode.transfer("RawCommand", {"cmd": [8191, 0, 8191, 0, -8192, 1, -1, 4095]}, 1, 7).frames()))
    window = FrameWindow()
    window.feed(got.batches[0])
    assert dumped(got.batches[0], registry, window) == [
        "    frame 1  1F040601  crc 02 6B | FF 7C 00 0F F7 | tail 87  start toggle 0 ID 7",
        "    frame 2  1F040601  C0 00 00 80 04 0F FF | tail 27  toggle 1 ID 7",
        "    frame 3  1F040601  FF CF | tail 47  end toggle 0 ID 7",
    ]
    assert dumped(got.batches[0], registry, FrameWindow())[1] == "    frame 2: its bytes are no longer kept"
    coloured = dumped(got.batches[0], registry, window, palette=Palette(True))[1]
    assert coloured.startswith(
        "    frame 2  1F040601  \x1b[36mC0 00 00 80 04 0F FF\x1b[0m | tail \x1b[33m27\x1b[0m  tog"
    )


def test_padding_of_can_fd_is_told_apart(decode: Callable[..., Any], registry: Registry) -> None:
    got = decode(lines(throttle(0, fd=True).frames()))
    window = FrameWindow()
    window.feed(got.batches[0])
    (line,) = dumped(got.batches[0], registry, window)
    assert line.endswith(" | padding 00 00 00 | tail C0  start end toggle 0 ID 0")


def test_frames_are_found_across_batches_and_forgotten_in_time(decode: Callable[..., Any], flush: object) -> None:
    chunks = [piece for k in range(6) for piece in (lines(throttle(k).frames()), flush)]
    got = decode(*chunks)
    window = FrameWindow(3)
    for batch in got.batches:
        window.feed(batch)
    assert [window(k) is None for k in range(7)] == [True] * 3 + [False] * 3 + [True]
    assert window(5).data[-1] == 0xC5


def test_bytes_of_a_transfer_that_takes_many_batches_are_there(
    decode: Callable[..., Any], registry: Registry, flush: object
) -> None:
    """A session looks several times a second, and a transfer may take 2 s."""
    slow = encode.transfer("RawCommand", {"cmd": [8191] * 8}, 1, 7).frames()
    other = lines(encode.transfer("RawCommand", {"cmd": [1, 2]}, 2, 0).frames())
    got = decode(*(piece for frame in slow for piece in (lines([frame]), flush, other, flush)))
    window = FrameWindow()
    shown = []
    for batch in got.batches:
        window.feed(batch)
        shown += dumped(batch, registry, window)
    assert len([line for line in shown if "1F040601" in line]) == len(slow) == 3
    assert not [line for line in shown if "no longer kept" in line]


@examples(60)
@given(capture=captures())
def test_no_view_fails_or_lets_control_characters_out(
    decode: Callable[..., Any], registry: Registry, capture: Capture
) -> None:
    got = decode(capture.data)
    window, summary = FrameWindow(), Summary(registry)
    tree, listing = Tree(registry, TimeFormat()), Listing(registry, TimeFormat(), width=80)
    total = 0
    for batch in got.batches:
        window.feed(batch)
        summary.feed(batch)
        count = len(batch.transfers)
        listing.feed(batch)
        entries = list(listing.entries())
        assert len(entries) == len(list(JsonLines(registry).rows(batch))) == count
        backward = ListedRows.all_of(batch)._replace(transfers=np.arange(count)[::-1])
        assert len(list(Csv(registry).rows(batch, backward))) == count
        texts = [line for details in tree.texts(batch) for line in details.split("\n")[:-1]]
        texts += "".join([*entries, listing.before(None), listing.end()]).splitlines()
        texts += dumped(batch, registry, window)
        assert all(text.isprintable() for text in texts)
        total += count
    facts = summary.finish([Stored()], got.engine)
    assert facts.transfers == total
    assert all(line.isprintable() for line in render(facts).splitlines())
    assert render_json(facts).isascii()


class Stored:
    name = "cap\x1bture.log"
    size = 1
    form = "candump text"
    unit = "line"
    digest = "00"
    notes = ("esc\x1baped",)
