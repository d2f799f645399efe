"""Keys that come at once, as a slow line brings them: each is done before the next one."""

from __future__ import annotations

import asyncio

import pytest
from kit.browsing import Seen, browser, capture
from textual.events import Key, Paste
from textual.keys import _character_to_key

FAULTS = capture("mission-8-faults.log")
NAMED = {"\r": "enter", "\t": "tab", "\x1b": "escape", "\x7f": "backspace", "\x01": "down", "\x02": "right"}


async def at_once(seen: Seen, text: str) -> None:
    """Press the keys of a text without a pause between them."""
    for letter in text:
        seen.app.post_message(Key(NAMED.get(letter) or _character_to_key(letter), letter))
    await seen.pilot.pause()
    await seen.until(lambda: not seen.app._message_queue.qsize())


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("=ESCStatus && ch == 3\r", "ESCStatus && ch == 3"),
        ("=ESCStatus.volt\t > 46 V\r", "ESCStatus.voltage > 46 V"),
        ("=ESCStatuss\x7f\r", "ESCStatus"),
        ("=Raw\x1b=ESCStatus\r=\x7f\x7f\x7f\x7f\x7f\x7f\x7f\x7f\x7fRawCommand\r", "RawCommand"),
        ("fn", "node == 11"),
        ("\x01fn", "node == 11"),
        ("\x01\x01ft", "ESCStatus && dronecan.src == 12"),
        ("\x01\x01a", "ESCStatus"),
        ("?q=NodeStatus\r", "NodeStatus"),
        (" fn", "node == 11"),
        (" fxfe", "ch == 1"),  # there is no exchange
        ("\t\x01\x01a", "ESCStatus.voltage == 50.125"),
    ],
)
def test_a_filter(text: str, wanted: str) -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await at_once(seen, text)
            assert seen.app.view.filter == wanted
            assert seen.app.tab == "packets"

    asyncio.run(work())


def test_places_and_comments() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            app = seen.app
            await at_once(seen, "g5711\rm")
            assert list(app.view.marks.marks) == [5710]
            await at_once(seen, "g50%\r")
            assert app.view.number() == len(app.view.rows) // 2
            await at_once(seen, "g1\r Mit began 21 s before\r")
            assert app.view.marks.marks[0].text == "it began 21 s before"
            await at_once(seen, "\t\t\x02\x02\x02\x02\x02\x02a")  # bytes further, and the field there as a filter
            assert app.view.filter == "ESCStatus.voltage == 50.125"

    asyncio.run(work())


def test_letters_that_move_otherwise_end_an_entry_of_a_menu() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await at_once(seen, " yj")
            assert seen.said.startswith(' copied: {"')

    asyncio.run(work())


def test_what_is_pasted_comes_before_the_key_behind_it() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await at_once(seen, "=")
            seen.app.post_message(Paste("ESCStatus &&\n  ch == 3\n"))
            await at_once(seen, "\r")
            assert seen.app.view.filter == "ESCStatus && ch == 3"

    asyncio.run(work())
