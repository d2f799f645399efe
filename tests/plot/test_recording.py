"""`tailbyte plot`: the recording read back, findings and summary, windows, outputs that fail, and captures that do."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from kit.command import run, run_in_room
from kit.judged import registry
from kit.pictures import batches, cells, draw, read_back
from kit.simulated import flown
from rerun.chunk import RrdReader

from analyzer.plot import chunks
from analyzer.plot import viewer_program as plot_viewer
from analyzer.plot.moments import Moments, PlotClock
from analyzer.plot.output import FileOutput

if TYPE_CHECKING:
    from collections.abc import Callable

    Command = Callable[..., tuple[int, str, str]]

SHORT = {"escs": 2, "seed": 5}


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plot_viewer, "display", lambda: False)
    Path("flight.log").write_text(flown(4, **SHORT).text)
    return tmp_path


def files() -> list[str]:
    return sorted(path.name for path in Path().iterdir())


@pytest.mark.slow
def test_the_recording_has_every_point_and_stands_beside_the_capture(command: Command) -> None:
    status, out, err = command("plot", "flight.log")
    assert (status, out) == (0, "")
    assert "written to flight.rrd" in err
    assert files() == ["flight.log", "flight.rrd"]
    got = read_back(Path("flight.rrd"))
    wanted, _ = draw(Path("flight.log").read_text())
    plots = {path for path in wanted.rows if "limit" not in path}
    assert plots
    for path in plots:
        assert got.rows[path] == wanted.rows[path], path
    looks = [path for path in wanted.static if "limit" not in path and path != "/__properties"]
    assert looks
    assert [got.static[path] for path in looks] == [wanted.static[path] for path in looks]
    assert RrdReader("flight.rrd").store().summary()  # has its index


@pytest.mark.slow
def test_the_recording_begins_when_the_capture_does(command: Command) -> None:
    """Not when it was made."""
    command("plot", "flight.log")
    about = read_back(Path("flight.rrd")).static["/__properties"]
    assert about["RecordingInfo:start_time"] == [first_time()]
    assert about["RecordingInfo:name"] == ["flight"]


def first_time() -> int:
    """Of the first frame, in ns."""
    seconds, _, digits = Path("flight.log").read_text()[1:].partition(")")[0].partition(".")
    return int(seconds) * 10**9 + int(digits.ljust(9, "0"))


@pytest.mark.slow
def test_limits_come_from_the_rules(command: Command) -> None:
    command("plot", "flight.log")
    got = read_back(Path("flight.rrd"))
    assert {path.rpartition("/")[2] for path in got.under("/frame_rate/limit/")} == {"2400", "4000"}


@pytest.mark.slow
def test_findings_stand_at_their_frames_by_severity(command: Command) -> None:
    lines = flown(4, **SHORT).text.splitlines(keepends=True)
    del lines[len(lines) // 2]
    Path("broken.log").write_text("".join(lines))
    status, _, _ = command("plot", "broken.log", "-o", "b.rrd")
    assert status == 0
    command("check", "broken.log", "--json", "b.json")
    report = json.loads(Path("b.json").read_text())
    got = read_back(Path("b.rrd"))
    shown = [
        (path.rpartition("/")[2], times, parts)
        for path in got.under("/findings/")
        for times, parts in got.rows[path]
    ]  # fmt: skip
    assert len(shown) == len(report["findings"]) > 0
    for one in report["findings"]:
        level = {"error": "ERROR", "warning": "WARN", "note": "INFO"}[one["severity"]]
        found = [
            (times, parts) for severity, times, parts in shown
            if severity == one["severity"]
            and parts["TextLog:text"][0].split()[1] == one["rule"]  # behind the time
            and times.get("time") == one["first"]["t_ns"]
            and times.get("frame") == one["first"]["frame"]
        ]  # fmt: skip
        assert found, one["rule"]
        assert found[0][1]["TextLog:level"] == [level]
        assert all(str(frame) in found[0][1]["TextLog:text"][0] for frame in one["frames"][:10])


@pytest.mark.slow
def test_the_summary_says_what_info_and_check_say(command: Command) -> None:
    command("plot", "flight.log", "--max-points", "20")
    (text,) = read_back(Path("flight.rrd")).static["/summary"]["TextDocument:text"]
    assert "tailbyte check: " in text
    assert "<" not in text.replace("<=", "")
    info = command("info", "flight.log")[1]
    assert info in text
    assert "Fewer points than the capture has" in text
    assert "/throttle/commanded/esc1" in text


@pytest.mark.slow
def test_fewer_points_are_asked_for_by_number(command: Command) -> None:
    _, _, err = command("plot", "flight.log", "--max-points", "20")
    assert re.search(r"lines with \d+ of \d+ points", err)
    assert "--max-points all shows all" in err
    got = read_back(Path("flight.rrd"))
    whole, _ = draw(Path("flight.log").read_text())
    values = got.values("/throttle/commanded/esc1")
    assert len(values) <= 20
    wanted = whole.values("/throttle/commanded/esc1")
    assert (min(values), max(values)) == (min(wanted), max(wanted))


@pytest.mark.slow
def test_a_line_has_so_many_points_unless_somebody_asks_for_all(
    command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("analyzer.app.drawing.MOST_POINTS", 20)
    few = command("plot", "flight.log", "-o", "few.rrd")[2]
    every = command("plot", "flight.log", "-o", "all.rrd", "--max-points", "all")[2]
    assert len(read_back(Path("few.rrd")).values("/throttle/commanded/esc1")) <= 20
    points = re.search(r"lines with (\d+) of (\d+) points", few)
    assert points is not None
    assert int(points[1]) < int(points[2])
    assert f"with {points[2]} points" in every
    assert "thinned" not in every


@pytest.mark.slow
def test_a_window_shows_a_part_and_counts_time_from_the_start(command: Command) -> None:
    assert command("plot", "flight.log", "--from", "1", "--to", "2", "-o", "w.rrd")[0] == 0
    got = read_back(Path("w.rrd"))
    whole, _ = draw(Path("flight.log").read_text())
    points = whole.points("/voltage/esc1")
    part = got.points("/voltage/esc1")
    assert part == [one for one in points if ends()[one[0]["frame"]] >= 10**9 and one[0]["since_start"] <= 2 * 10**9]
    assert 0 < len(part) < len(points)
    (text,) = got.static["/summary"]["TextDocument:text"]
    assert "--from 1, --to 2" in text
    assert command("plot", "flight.log", "--last", "1s", "-o", "l.rrd")[0] == 0
    last = max(ends().values()) - 10**9
    assert read_back(Path("l.rrd")).points("/voltage/esc1") == [
        one for one in points if ends()[one[0]["frame"]] >= last
    ]


def ends() -> dict[int, int]:
    """When transfers end, since the start, by the number of their first frames."""
    out: dict[int, int] = {}
    start = None
    for batch in batches(Path("flight.log").read_bytes(), 1 << 22, registry()):
        frames = cells(batch.frames.column("t"))
        start = frames[0] if start is None else start
        first = [numbers[0] + 1 for numbers in batch.transfers.column("frame").to_pylist()]
        out |= {number: t - start for number, t in zip(first, cells(batch.transfers.column("t_end")), strict=True)}
    return out


@pytest.mark.slow
def test_findings_outside_the_window_are_left_to_the_summary(command: Command) -> None:
    lines = flown(4, **SHORT).text.splitlines(keepends=True)
    del lines[len(lines) * 3 // 4]
    Path("late.log").write_text("".join(lines))
    command("plot", "late.log", "-o", "all.rrd")
    assert read_back(Path("all.rrd")).under("/findings/error")
    command("plot", "late.log", "--to", "2", "-o", "part.rrd")
    part = read_back(Path("part.rrd"))
    assert part.under("/findings/error") == part.under("/broken/") == []
    (text,) = part.static["/summary"]["TextDocument:text"]
    assert "FAIL" in text
    command("plot", "late.log", "--from", "2", "-o", "end.rrd")
    end = read_back(Path("end.rrd"))
    assert end.rows["/findings/error"] == read_back(Path("all.rrd")).rows["/findings/error"]


def test_nothing_inside_the_window_writes_nothing(command: Command) -> None:
    status, _, err = command("plot", "flight.log", "--from", "100", "-o", "w.rrd")
    assert status == 2
    assert "nothing is inside the window" in err
    assert not Path("w.rrd").exists()


@pytest.mark.parametrize(
    ("args", "text"),
    [
        (("-o", "flight.log"), "is the capture flight.log itself"),
        (("--max-points", "0"), "not a number of at least 1"),
        (("--from", "x"), "--from"),
        (("--dialect", "200=tm"), "NODE=CHOICE"),
    ],
)
def test_wrong_usage(command: Command, args: tuple[str, ...], text: str) -> None:
    status, _, err = command("plot", "flight.log", *args)
    assert status == 2
    assert text in err
    assert files() == ["flight.log"]


def test_standard_input_needs_a_name_for_the_output(command: Command) -> None:
    status, _, err = command("plot", "-")
    assert status == 2
    assert "-o FILE.rrd" in err


def test_a_missing_capture_and_a_missing_folder(command: Command) -> None:
    assert command("plot", "nothing.log")[0] == 3
    status, _, err = command("plot", "flight.log", "-o", "no/where.rrd")
    assert status == 3
    assert "no folder" in err
    assert files() == ["flight.log"]


@pytest.mark.slow
def test_a_damaged_capture_is_shown_as_far_as_it_goes(command: Command) -> None:
    Path("bad.log").write_text(Path("flight.log").read_text() + "nonsense\n")
    status, _, err = command("plot", "bad.log")
    assert status == 3
    assert "unreadable" in err or "nonsense" in err
    got = read_back(Path("bad.rrd"))
    assert got.points("/voltage/esc1") == draw(Path("flight.log").read_text())[0].points("/voltage/esc1")
    (text,) = got.static["/summary"]["TextDocument:text"]
    assert "damaged" in text


def test_an_empty_capture_gives_a_recording_that_says_so(command: Command) -> None:
    Path("empty.log").write_text("")
    status, _, _ = command("plot", "empty.log")
    assert status == 3
    got = read_back(Path("empty.rrd"))
    assert got.rows == {}
    assert "/summary" in got.static


class Full:
    """A file with room for a little."""

    def __init__(self, room: int) -> None:
        self.room = room

    def write(self, data: bytes) -> int:
        self.room -= len(data)
        if self.room < 0:
            raise OSError(28, "No space left on device")
        return len(data)


def points(count: int) -> list[chunks.Chunk]:
    steps = np.arange(count, dtype=np.int64)
    return chunks.scalars([("/a", np.random.default_rng(0).random(count))], Moments(steps, steps + 1), PlotClock(0))


def test_a_full_disk_ends_the_writing_with_its_error() -> None:
    def fill() -> None:
        with FileOutput(Full(100_000), "x") as output:  # type: ignore[arg-type]
            for _ in range(40):
                output.send(points(10_000))

    with pytest.raises(OSError, match="No space left"):
        fill()


def test_a_failure_inside_is_not_replaced_by_one_of_the_disk() -> None:
    def fail() -> None:
        with FileOutput(Full(0), "x") as output:  # type: ignore[arg-type]
            assert output is not None
            raise KeyError("inside")

    with pytest.raises(KeyError, match="inside"):
        fail()


@pytest.mark.slow
def test_no_room_leaves_what_was_there(tmp_path: Path) -> None:
    """The recording of an earlier run stays, and the exit status says that this one could not be written."""
    Path("flight.rrd").write_bytes(b"earlier")

    done = run_in_room(1 << 14, "plot", tmp_path / "flight.log")
    assert done.returncode == 3
    assert b"File too large" in done.stderr
    assert Path("flight.rrd").read_bytes() == b"earlier"
    assert files() == ["flight.log", "flight.rrd"]


@pytest.mark.slow
def test_the_recording_can_go_to_standard_output(tmp_path: Path) -> None:
    done = run("plot", tmp_path / "flight.log", "-o", "-")
    assert done.returncode == 0
    Path("piped.rrd").write_bytes(done.stdout)
    got = read_back(Path("piped.rrd"))
    assert got.points("/voltage/esc1") == draw(Path("flight.log").read_text())[0].points("/voltage/esc1")
