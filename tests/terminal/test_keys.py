"""The monitor as a person uses it: keys, a display that stands still, a session that ends."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from kit.monitor import SMALL, WIDE, Script, board_of, look, of_device, seen, session, text, until, use
from kit.simulated import faulted
from textual.events import Key

from analyzer.board.snapshot import RecordingState
from analyzer.terminal.app import PANES, Monitor
from analyzer.terminal.pane import TablePane, TextLines

if TYPE_CHECKING:
    from textual.pilot import Pilot

    from analyzer.board.snapshot import Snapshot


@pytest.mark.slow
def test_space_stops_the_display_but_not_what_is_lost() -> None:
    state = session("hover-4.log")
    later = replace(
        state, nodes=(), recording=RecordingState("b.mcap", 1, 2), buses=(replace(state.buses[0], dropped=5),)
    )  # fmt: skip
    feed = Script([state])

    async def does(app: Monitor, pilot: Pilot[None]) -> None:
        await pilot.press("space")
        feed.states = [later]
        await until(pilot, lambda: "b.mcap" in seen(app)[0])
        assert "PAUSED" in seen(app)[0]
        assert "LOST 5" in seen(app)[0]
        assert "org.example" in text(app)
        await pilot.press("space")
        await until(pilot, lambda: "org.example" not in text(app))
        assert "PAUSED" not in seen(app)[0]

    use(feed, does)
    assert feed.asked == []


@pytest.mark.slow
def test_s_sorts_by_the_next_column_and_capital_s_turns_it_round() -> None:
    state = session("mission-8-faults.log")
    volts = ["s", "s", "s"]  # label, V, A

    def currents(*keys: str) -> list[float]:
        lines = look(state, SMALL, *keys)
        start = next(k for k, line in enumerate(lines) if line.startswith("ESC"))
        return [float(line.split()[2]) for line in lines[start + 1 : start + 9]]

    own = currents()
    assert own != sorted(own)
    assert currents(*volts) == sorted(own)
    assert currents(*volts, "S") == sorted(own, reverse=True)


@pytest.mark.slow
def test_x_shows_the_lowest_and_the_highest() -> None:
    state = session("hover-4.log")
    row = state.devices[0].rows[0]
    reading = row.readings["voltage", ""]
    for keys, value in (
        ((), reading.last),
        (("x",), reading.low),
        (("x", "x"), reading.high),
        (("x",) * 3, reading.last),
    ):
        assert of_device(look(state, SMALL, *keys), "1")[1] == f"{value:.1f}"


def test_actions_reach_the_feed_and_what_it_says_is_shown() -> None:
    feed = Script([session("hover-4.log")])

    async def does(app: Monitor, pilot: Pilot[None]) -> None:
        await pilot.press("m")
        assert "mark 1" in seen(app)[-1]
        await pilot.press("c", "w")
        await pilot.pause()
        assert "saved as report.html" in seen(app)[-1]

    use(feed, does)
    assert feed.asked == ["mark", "clear", "save"]


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("key", "pane"), [("b", "buses"), ("n", "nodes"), ("f", "findings"), ("l", "latched"), ("e", "devices")]
)
def test_keys_choose_the_pane_in_use(key: str, pane: str) -> None:
    async def does(app: Monitor, pilot: Pilot[None]) -> None:
        await pilot.press("n" if key == "e" else "e", key)
        await pilot.pause()
        assert app.focused is not None
        assert app.focused.id == pane
        used = app.query_one(f"#{pane}", TablePane)
        assert used.size.height >= min(used.rows + 1, 10)

    use(Script([session("mission-8-faults.log")]), does)


@pytest.mark.slow
def test_tab_goes_round() -> None:
    async def does(app: Monitor, pilot: Pilot[None]) -> None:
        order = []
        for _ in PANES:
            await pilot.press("tab")
            assert app.focused is not None
            order.append(app.focused.id)
        assert order == ["nodes", "findings", "latched", "buses", "devices"]

    use(Script([session("mission-8-faults.log")]), does)


@pytest.mark.slow
def test_e_again_shows_the_next_kind_of_device() -> None:
    state = session("hover-4.log")
    assert any(line.startswith("unit") for line in look(state, SMALL, "e"))
    assert any(line.startswith("ESC") for line in look(state, SMALL, "e", "e"))


@pytest.mark.slow
def test_a_pane_is_scrolled_and_says_where_it_is() -> None:
    board, now = board_of(faulted(escs=20, seconds=1.5).text.encode())
    state = board.snapshot(now)
    top = look(state)
    assert of_device(top, "1")
    down = look(state, SMALL, "down", "down")
    assert of_device(down, "3")
    assert not any(line.startswith(("1 ", "2 ")) for line in down)
    assert look(state, SMALL, "pagedown", "pagedown", "home") == top
    assert any(line.endswith("1-13/22") for line in look(state, SMALL, "n"))
    assert any(line.endswith("10-22/22") for line in look(state, SMALL, "n", "end"))


def test_help_opens_and_any_key_closes_it() -> None:
    feed = Script([session("hover-4.log")])

    async def does(app: Monitor, pilot: Pilot[None]) -> None:
        await pilot.press("question_mark")
        await pilot.pause()
        assert "pause the display" in text(app)
        looks = feed.looks
        await until(pilot, lambda: feed.looks > looks)
        await pilot.press("m")
        await pilot.pause()
        assert "pause the display" not in text(app)
        assert "ESC" in text(app)

    use(feed, does)
    assert feed.asked == []


@pytest.mark.sampled(2)
@pytest.mark.parametrize("key", ["q", "ctrl+c", "ctrl+q"])
def test_q_ends_the_session_without_a_question(key: str) -> None:
    feed = Script([session("hover-4.log")])

    async def does(app: Monitor, pilot: Pilot[None]) -> None:
        await pilot.press(key)
        await until(pilot, lambda: not app.is_running)

    use(feed, does)
    assert feed.asked == ["stop"]


def test_it_leaves_when_the_session_ends() -> None:
    feed = Script([session("hover-4.log")])

    async def does(app: Monitor, pilot: Pilot[None]) -> None:
        feed.ended = True
        await until(pilot, lambda: not app.is_running)

    use(feed, does)
    assert feed.asked == []


def test_what_goes_wrong_in_the_feed_is_not_hidden() -> None:
    class Broken(Script):
        def snapshot(self) -> Snapshot | None:
            super().snapshot()
            raise OSError("gone")

    app = Monitor(Broken([None]))

    async def run() -> None:
        async with app.run_test() as pilot:
            await until(pilot, lambda: not app.is_running)

    asyncio.run(run())
    assert isinstance(app.problem, OSError)


@pytest.mark.slow
def test_only_what_changed_is_drawn() -> None:
    state = session("hover-4.log")
    (table, *others) = state.devices
    first, second, *rest = table.rows
    reading = replace(second.readings["voltage", ""], last=12.3)
    second = replace(second, readings={**second.readings, ("voltage", ""): reading})
    changed = replace(state, devices=(replace(table, rows=(first, second, *rest)), *others))
    feed = Script([state])

    async def does(app: Monitor, pilot: Pilot[None]) -> None:
        drawn: list[tuple[str | None, object]] = []
        for widget in app.query(TextLines):
            widget.refresh = lambda *regions, of=widget.id, **_: drawn.append((of, regions))  # type: ignore[method-assign]
        looks = feed.looks
        await until(pilot, lambda: feed.looks > looks + 1)
        assert drawn == []
        feed.states = [changed]
        looks = feed.looks
        await until(pilot, lambda: feed.looks > looks + 1)
        ((pane, (region,)),) = drawn
        assert pane == "devices"
        assert (region.y, region.height) == (2, 1)
        assert region.width <= 7

    use(feed, does)


def test_the_display_follows_the_size_of_the_terminal() -> None:
    async def does(app: Monitor, pilot: Pilot[None]) -> None:
        await pilot.resize_terminal(*WIDE)
        await until(pilot, lambda: "47.8..50.2" in text(app))
        assert {len(line) for line in seen(app)} == {200}
        await pilot.resize_terminal(60, 20)
        await until(pilot, lambda: {len(line) for line in seen(app)} == {60} and "? help" in seen(app)[-1])
        await until(pilot, lambda: "47.8..50.2" not in text(app))  # drawn anew once it is laid out

    use(Script([session("hover-4.log")]), does)


def test_keys_that_come_at_once_leave_the_page_of_help_once() -> None:
    async def does(app: Monitor, pilot: Pilot[None]) -> None:
        await pilot.press("question_mark")
        await until(pilot, lambda: len(app.screen_stack) == 2)
        for key in ("escape", "escape", "escape"):
            app.post_message(Key(key, None))
        await until(pilot, lambda: len(app.screen_stack) == 1)
        await pilot.press("b")
        assert app._panes["buses"].has_focus

    use(Script([session("hover-4.log")]), does)
