"""Elements of arrays: lines of their own, folded at first, each with its bits and its filter."""

from __future__ import annotations

import asyncio

from kit.browsing import Seen, browser, capture

from analyzer.browser.details import DetailLine
from analyzer.browser.elements import with_elements

FAULTS = capture("mission-8-faults.log")


def names(*lines: DetailLine) -> list[str]:
    return [line.name for line in with_elements(lines)]


def test_only_arrays_of_numbers_have_elements() -> None:
    assert names(DetailLine(2, "a: 1 2", (0, 27), name="T.a", value="1 2")) == ["T.a", "T.a[0]", "T.a[1]"]
    for line in (
        DetailLine(2, "a: 10 20 30", (0, 23), name="T.a", value="10 20 30"),  # bytes
        DetailLine(2, "a: 46.1 V", (0, 15), name="T.a", value="46.1 V"),
        DetailLine(2, "a: 1 2", (0, 26), name="T.a", value="1 2"),  # they do not share the bits
        DetailLine(2, "a: 4 (operating)", (0, 7), name="T.a", value="4 (operating)"),
        DetailLine(2, "a: 1 2", None, name="T.a", value="1 2"),
        DetailLine(2, "a: 1 2", (0, 27), value="1 2"),
    ):
        assert len(with_elements([line])) == 1, line


def test_units_and_bits_of_elements() -> None:
    line = DetailLine(2, "[part: -0.5 1e-05 %, from a]", (8, 35), name="T.part", value="-0.5 1e-05 %")
    assert with_elements([line])[1:] == [
        DetailLine(3, "[part[0]: -0.5 %]", (8, 21), name="T.part[0]", value="-0.5 %"),
        DetailLine(3, "[part[1]: 1e-05 %]", (22, 35), name="T.part[1]", value="1e-05 %"),
    ]


def test_an_element_lights_its_bits_and_is_filtered_by() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            app = seen.app
            await seen.filtered("RawCommand.cmd[2] > 1000")
            await seen.press("home")
            assert "cmd[2]" not in app.details.text  # folded at first
            await byte(seen, 0, 3)
            assert app.details.line.name == "RawCommand.cmd[0]"
            await byte(seen, 0, 6)
            assert app.details.line.name == "RawCommand.cmd[2]"
            assert app.bytes._lit.bits == frozenset(range(28, 42))
            value = app.details.line.value
            assert int(value) > 1000
            await seen.press("a")
            assert app.view.filter == f"RawCommand.cmd[2] == {value}"
            await seen.until(lambda: app.view.rows.done and len(app.view.rows) > 0)
            await seen.press("y", "d")
            assert "cmd[2]" not in app.copied("details")
            assert "cmd: " in app.copied("details")

    async def byte(seen: Seen, frame: int, at: int) -> None:
        seen.app.bytes.to((frame, at))
        await seen.pilot.pause()

    asyncio.run(work())
