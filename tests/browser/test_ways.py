"""Ways from row to row, what stands in front of rows, names or numbers, parts of a capture."""

from __future__ import annotations

import asyncio
import shutil
from pathlib import Path

from kit.browsing import Seen, browser, capture

from analyzer.app.browse.capture import CaptureSupply
from analyzer.app.browse.session import BrowseOptions, made
from analyzer.app.request import Request
from analyzer.browser.store.folder import StoreFolder
from analyzer.window.limits import Window

FAULTS, SERVICES = capture("mission-8-faults.log"), capture("services.log")


def number(row: str) -> int:
    return int(row[:11].strip("x*! "))


def test_same_type_frames_of_a_transfer_and_the_way_back() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await seen.press("greater_than_sign")
            assert number(seen.row) == 9  # the next ESCStatus, of another node
            await seen.press("less_than_sign")
            assert number(seen.row) == 1
            await seen.press("plus", "plus")
            assert "frame 3 is 3 of 3 of this transfer" in seen.said
            await seen.press("plus")
            assert "no frame behind" in seen.said
            await seen.press("g")
            await seen.type("5711")
            await seen.press("b")
            assert number(seen.row) == 1
            await seen.press("B")
            assert number(seen.row) == 5711
            await seen.press("ctrl+right")
            assert number(seen.row) > 5711

    asyncio.run(work())


def test_what_is_not_there_is_said() -> None:
    async def work() -> None:
        async with browser(SERVICES, judged=False) as seen:
            await seen.press("r")
            assert "only requests and responses" in seen.said
            await seen.press("end", "greater_than_sign")
            await seen.until(lambda: seen.app.walk is None)
            assert "no other transfer of this type" in seen.said
            await seen.press("home", "b", "b", "b")
            assert "where it began" in seen.said

    asyncio.run(work())


def test_events_flights_and_comments_stand_in_list_and_details(tmp_path: Path) -> None:
    path = tmp_path / "flight.log"
    shutil.copy(FAULTS, path)

    async def work() -> None:
        async with browser(path, options=BrowseOptions()) as seen:
            places = seen.app.view.supply.places
            assert any("flight 1 begins" in one for one in places.values())
            await seen.press("right_curly_bracket")
            at = min(places)
            assert at in seen.app.view.places_of(seen.app.view.current())
            assert seen.app.details.line.text.startswith("Event: ")
            assert any(line.startswith("e") for line in seen.app.list.text.splitlines())
            await seen.press("M")
            await seen.type("look here")
            assert seen.app.shown.lines[0].text == "Comment: look here"
            assert "1" in seen.app.strip.text

    asyncio.run(work())


def test_names_or_numbers_and_conversations() -> None:
    async def work() -> None:
        async with browser(capture("hover.log"), (120, 30), judged=False) as seen:
            await seen.press("number_sign")
            assert seen.row.split()[3] in ("1030", "1034")
            assert "cmd=" in seen.row or "error_count=" in seen.row
            await seen.press("number_sign")
            assert "RawCommand" in seen.row or "ESCStatus" in seen.row
            await seen.press("c")
            assert "1" in [line[0] for line in seen.app.list.text.splitlines()[1:]]
            await seen.press("down", "c")
            assert seen.app.list.conversations == [frozenset({1}), frozenset({11})]
            await seen.press("c")
            assert "not coloured any more: node 11" in seen.said

    asyncio.run(work())


def test_six_ways_to_make_a_filter() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            app = seen.app
            app.details.select(next(k for k, line in enumerate(app.shown.lines) if line.name == "dronecan.src"))
            await seen.press("A", "n")
            assert app.view.filter == "!(dronecan.src == 11)"
            await seen.press("escape")
            app.details.select(next(k for k, line in enumerate(app.shown.lines) if line.name == "dronecan.src"))
            await seen.press("P", "c")
            assert app.bar.value == "!(dronecan.src == 11)"

    asyncio.run(work())


def test_a_part_keeps_its_numbers_and_times() -> None:
    async def work() -> None:
        window = Window(frames=(5700, 6000))
        async with browser(FAULTS, judged=False, window=window) as seen:
            assert "301 frames" in seen.screen
            assert number(seen.row) >= 5700
            assert float(seen.row[11:20]) > 2.0  # since the first frame of the whole capture
            await seen.press("g")
            await seen.type("5711")
            assert number(seen.row) == 5711
            await seen.press("g")
            await seen.type("17")
            assert "frames are 5,700 to 6,000" in seen.said

    asyncio.run(work())


def test_a_capture_that_grows_is_read_anew(tmp_path: Path) -> None:
    path = tmp_path / "flight.log"
    lines = Path(FAULTS).read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:3000]))

    async def work() -> None:
        async with browser(path, judged=False) as seen:
            path.write_bytes(b"".join(lines))
            assert "has grown since it was read: ctrl+r reads it anew" in seen.app.view.supply.changed()
            assert seen.app.view.supply.changed() == ""
            kept = path.rename(path.with_suffix(".gone"))
            await seen.press("ctrl+r")
            assert f"{path.name} is gone: what was read of it stays here until the end" in seen.said
            assert not seen.app.reload
            kept.rename(path)
            await seen.press("ctrl+r")
            assert seen.app.reload

    asyncio.run(work())


def test_where_no_row_matches_nothing_is_left_of_the_row_before() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            app = seen.app
            await seen.press("equals_sign")
            await seen.type("ESCStatus.voltage > 50 kV")
            await seen.until(lambda: app.view.rows.done)
            app.look()
            await seen.pilot.pause()
            assert app.list.text.splitlines()[1].strip() == "no row matches ESCStatus.voltage > 50 kV"
            assert app.details.text.strip() == "Details"
            assert app.bytes.text.strip() == "Bytes  no frame"

    asyncio.run(work())


def test_a_capture_that_grows_is_followed(tmp_path: Path) -> None:
    path = tmp_path / "flight.log"
    lines = Path(FAULTS).read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:3000]))

    async def work() -> None:
        with StoreFolder() as folder:
            supply = CaptureSupply(Request((str(path),), follow=True), folder.path)
            app = made(supply, BrowseOptions(marks=False), [])
            supply.start()
            async with app.run_test(size=(80, 24)) as pilot:
                seen = Seen(app, pilot)
                await seen.until(lambda: supply.store.count == 3000)
                await seen.press("end")
                with path.open("ab") as file:
                    file.write(b"".join(lines[3000:]))
                await seen.until(lambda: supply.store.count == len(lines))
                await seen.until(lambda: app.view.number() == len(app.view.rows) - 1)
                assert "10,220 frames  following" in seen.screen
                await seen.press("q")
            supply.join()
            assert not supply._thread.is_alive()

    asyncio.run(work())


def test_what_is_followed_tells_how_it_is_judged() -> None:
    async def work() -> None:
        async with browser(capture("hover.log")) as seen:
            supply = seen.app.view.supply
            supply._tabs.clear()
            supply.doing = "following"
            for key in ("2", "3", "4", "5"):
                await seen.press(key)
                assert "not known while it is followed: ctrl+r reads and judges what there is by now" in seen.screen
            supply.paths = ("-",)
            await seen.press("2")
            assert seen.screen.splitlines()[4].strip() == "not known while it is followed"
            supply.doing = ""

    asyncio.run(work())
