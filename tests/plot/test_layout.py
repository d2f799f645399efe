"""The layout: only what there is has a place, and everything in the recording has one; a real viewer takes it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import pytest
import rerun.blueprint as rrb
from bench.headless import NoViewerError, viewer
from kit.pictures import Drawn, draw
from kit.simulated import flown

from analyzer.plot.inventory import Inventory, Series
from analyzer.plot.layout.whole import layout
from analyzer.plot.moments import PlotClock
from dissectors.picture import Pictures

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from analyzer.plot.picture import Picture

ESCS = (0, 1, 4, 8, 20)
KINDS = {"TimeSeries": {"line", "points"}, "StateTimeline": {"state"}, "TextLog": {"text"}, "TextDocument": {"text"}}


@dataclass(frozen=True)
class Laid:
    """A picture and its layout. `views` are all views with the names of what they are in."""

    drawn: Drawn
    picture: Picture | None
    blueprint: rrb.Blueprint

    @property
    def views(self) -> list[tuple[tuple[str, ...], Any]]:
        return list(inside(self.blueprint.root_container))

    @property
    def tabs(self) -> list[str]:
        """The names of the uppermost ones."""
        tabs = self.blueprint.root_container
        while tabs.contents and not any(one.name for one in tabs.contents):
            tabs = tabs.contents[0]
        return [one.name for one in tabs.contents]

    def under(self, *names: str) -> dict[str, set[str]]:
        """The views of a tab by name, with the paths that they show."""
        return {view.name: set(view.contents) for way, view in self.views if way[: len(names)] == names}


def inside(one: Any, way: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    if isinstance(one, rrb.Container):
        for part in one.contents:
            yield from inside(part, (*way, one.name) if one.name else way)
    else:
        yield way, one


def text_of(escs: int) -> str:
    """A flight; without ESCs, what the others on its bus say."""
    text = flown(8, escs=escs or 2, flight="mission").text
    if escs:
        return text
    lines = [line for line in text.splitlines() if re.search(r" 1[0-9A-F]{5}(0A|7D)#", line)]
    return "\n".join(line for line in lines if " 1F0406" not in line) + "\n"


@lru_cache
def laid(escs: int, buses: int = 1) -> Laid:
    lines = text_of(escs).splitlines()
    if buses == 2:
        lines = [line.replace("can0", "can1") if k % 3000 >= 1500 else line for k, line in enumerate(lines)]
    drawn, picture = draw("\n".join(lines) + "\n")
    return Laid(drawn, picture, picture.layout())


CASES = [(escs, 1) for escs in ESCS] + [(4, 2)]


@pytest.mark.slow
@pytest.mark.parametrize(("escs", "buses"), CASES)
def test_everything_has_a_place_and_only_what_there_is(escs: int, buses: int) -> None:
    one = laid(escs, buses)
    series = one.picture.inventory.series
    shown = {path for _, view in one.views for path in view.contents}
    assert shown == set(series)
    assert shown <= set(one.drawn.rows) | set(one.drawn.static)
    for _, view in one.views:
        assert view.contents
        assert {series[path].kind for path in view.contents} <= KINDS[view.class_identifier]
        assert all(path.startswith(view.origin + "/") for path in view.contents)
        assert len(set(view.contents)) == len(view.contents)


@pytest.mark.slow
@pytest.mark.parametrize(("escs", "buses"), CASES)
def test_plots_are_named_with_their_units(escs: int, buses: int) -> None:
    one = laid(escs, buses)
    for _, view in one.views:
        assert view.name
        units = {one.picture.inventory.series[path].measure for path in view.contents} - {""}
        signs = {"degC": "°C", "deg": "°", "us": "µs"}
        assert len(units) <= 1, view.name
        for unit in units:
            assert f"[{signs.get(unit, unit)}]" in view.name


@pytest.mark.slow
@pytest.mark.parametrize("escs", [4, 8])
def test_tabs_of_a_few_escs(escs: int) -> None:
    one = laid(escs)
    each = [f"ESC {k}" for k in range(1, escs + 1)]
    assert one.tabs == ["Overview", *each, "Units", "Bus", "Commands and parameters", "Messages"]
    for name in each:
        parts = one.under(name)
        assert {path.rsplit("/", 1)[1] for paths in parts.values() for path in paths} == {name.lower().replace(" ", "")}
        assert {"Voltage [V]", "Encoder angle [°]", "States", "Status bits"} <= parts.keys()
        assert len(parts["Status bits"]) == 12


@pytest.mark.slow
def test_tabs_of_many_escs_are_in_one() -> None:
    one = laid(20)
    assert one.tabs == ["Overview", "ESCs", "Units", "Bus", "Commands and parameters", "Messages"]
    assert one.under("ESCs", "ESC 20").keys() == one.under("ESCs", "ESC 1").keys() != set()


def test_one_esc_needs_no_overview() -> None:
    one = laid(1)
    assert one.tabs == ["ESC 1", "Unit 1", "Bus", "Commands and parameters", "Messages"]


def test_without_escs_there_are_no_plots_of_them() -> None:
    one = laid(0)
    assert one.tabs == ["Bus", "Parameters", "Messages"]
    assert {"Bus load [%]", "Frame rate [frames/s]", "Uptime [s]", "States"} == one.under("Bus").keys()


@pytest.mark.sampled(3)
@pytest.mark.parametrize("escs", [4, 8, 20])
def test_the_overview_has_a_plot_a_quantity_with_all_escs(escs: int) -> None:
    parts = laid(escs).under("Overview")
    numbers = range(1, escs + 1)
    for quantity, name in (("voltage", "Voltage [V]"), ("current", "Current [A]"), ("energy", "Energy [Wh]")):
        assert parts[name] == {f"/{quantity}/esc{k}" for k in numbers}
    throttle = {f"/throttle/{role}/esc{k}" for k in numbers for role in ("commanded", "reported")}
    assert parts["Throttle [%] (commanded: faint)"] == throttle
    assert parts["States"] == {f"/states/mode/esc{k}" for k in numbers}
    assert "Encoder angle [°]" not in parts
    assert "Status bits" not in parts


@pytest.mark.slow
def test_bits_that_were_set_are_in_the_overview() -> None:
    _, picture = draw(flown(12, escs=2, scenario="pack-sag").text)
    one = Laid(_, picture, picture.layout())
    assert "/states/under_voltage/esc1" in one.under("Overview")["Status bits"]
    assert "/states/stall/esc1" not in one.under("Overview")["Status bits"]


@pytest.mark.slow
def test_an_esc_has_one_colour() -> None:
    """What is commanded has the same one, only less of it."""
    static = laid(8).drawn.static
    for k in range(1, 9):
        own = {path: parts["SeriesLines:colors"] for path, parts in static.items() if path.endswith(f"/esc{k}")
               and "SeriesLines:colors" in parts}  # fmt: skip
        faint = own.pop(f"/throttle/commanded/esc{k}")
        (colour,) = {tuple(found) for found in own.values()}
        assert faint[0] >> 8 == colour[0] >> 8
        assert faint[0] & 0xFF < colour[0] & 0xFF


def test_the_bus_tab_has_limits_and_what_is_broken() -> None:
    one = laid(4)
    assert one.under("Bus")["Frame rate [frames/s]"] == {"/frame_rate/can0", "/frame_rate/limit/4000"}
    drawn, picture = draw("".join(flown(4, escs=2).text.splitlines(keepends=True)[1000::2]))
    broken = Laid(drawn, picture, picture.layout()).under("Bus")["Broken transfers, by sender [node]"]
    assert broken == set(drawn.under("/broken/"))


def test_commands_and_parameters() -> None:
    one = laid(4)
    commands = one.under("Commands and parameters", "Commands")
    assert commands.keys() == {"Throttle commanded [%]", "Command period [ms]", "Command jitter [ms]"}
    assert commands["Throttle commanded [%]"] == {f"/throttle/commanded/esc{k}" for k in range(1, 5)}
    assert "esc_timing [°]" in one.under("Commands and parameters", "ParamGet")
    assert one.under("Messages", "GetNodeInfo.Response")


@pytest.mark.slow
def test_two_buses_share_plots() -> None:
    one = laid(4, 2)
    assert one.under("Bus")["Bus load [%]"] == {"/bus_load/can0", "/bus_load/can1"}
    assert {"/voltage/esc1", "/voltage/can1/esc1"} <= one.under("Overview")["Voltage [V]"]
    assert {"ESC 1", "can1 ESC 1"} <= {name for way, _ in one.views for name in way}


def of_messages(*quantities: str) -> Laid:
    """A layout of nothing but fields of messages of one node."""
    inventory = Inventory()
    for quantity in quantities:
        inventory.add(
            Series(f"/messages/{quantity}/node5", "line", quantity, "node 5", unit="node 5", owner="messages")
        )
    return Laid(Drawn(), None, layout(inventory, Pictures(), PlotClock()))


def test_elements_of_a_list_share_a_plot() -> None:
    one = of_messages("Pump/parts/0/value", "Pump/parts/1/value", "Pump/pressure")
    assert one.under("Messages", "Pump").keys() == {"parts value", "pressure"}
    assert len(one.under("Messages", "Pump")["parts value"]) == 2


def test_tables_lose_their_namespace_unless_they_are_mixed_up() -> None:
    one = of_messages("uavcan.a.Status/x", "uavcan.b.Status/x", "uavcan.b.Fix/x", "PUSHCAN.Motor/x", "Pump/x")
    names = [way[1] for way, _ in one.views]
    assert sorted(names) == ["Fix", "PUSHCAN.Motor", "Pump", "uavcan.a.Status", "uavcan.b.Status"]


@pytest.mark.slow
def test_devices_that_are_only_commanded_have_no_tabs() -> None:
    lines = [line for line in flown(6, escs=4).text.splitlines(keepends=True) if " 1F0406" in line]
    drawn, picture = draw("".join(lines))
    one = Laid(drawn, picture, picture.layout())
    assert one.tabs == ["Overview", "Bus", "Commands"]
    assert one.under("Overview").keys() == {"Throttle [%]"}


def test_the_time_panel_begins_with_a_timeline_that_is_there() -> None:
    assert laid(4).blueprint.time_panel.timeline == "since_start"
    empty = layout(Inventory(), Pictures(), PlotClock())
    assert empty.time_panel.timeline == "frame"


@pytest.mark.slow
def test_a_viewer_shows_every_tab_without_complaint(command, tmp_path: Path) -> None:
    log = tmp_path / "flight.log"
    assert command("simulate", "-o", log, "--esc", "2", "--duration", "6", "--fault", "TRF-010@3")[0] == 0
    assert command("plot", log)[0] == 0
    try:
        with viewer(tmp_path / "viewer.txt", "1200x800") as shown:
            shown.open(tmp_path / "flight.rrd")
            tabs = shown.tabs()
            for tab in tabs:
                shown.show(tab)
                shown.picture()
                assert shown.complaints() == []
    except NoViewerError as error:
        pytest.skip(f"no viewer can start here: {error}")
    assert ("Overview",) in tabs
    assert ("Summary",) in tabs
    assert ("Units", "Unit 2") in tabs
