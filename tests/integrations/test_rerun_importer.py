"""`rerun capture.log`: the program that the viewer asks, and the viewer that asks it."""

from __future__ import annotations

import gzip
import os
import subprocess
import sys
from pathlib import Path

import pytest
from kit.command import HOVER, LIMIT, environment
from kit.pictures import draw, read_back
from rerun.chunk import RrdReader

from analyzer.integrations import rerun_importer as importer
from analyzer.plot import viewer_program as plot_viewer

CODE = "import sys; from analyzer.integrations.rerun_importer import main; sys.exit(main())"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("flight.log").write_bytes(HOVER.read_bytes())
    return tmp_path


def ask(*args: str, code: str = CODE) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [sys.executable, "-c", code, *args], capture_output=True, env=environment(), timeout=LIMIT, check=False
    )


def stores() -> set[tuple[str, str]]:
    """What the recording holds: kinds and applications."""
    reader = RrdReader("got.rrd")
    return {(one.kind, one.application_id) for one in (*reader.recordings(), *reader.blueprints())}


@pytest.mark.slow
def test_a_capture_becomes_the_recording_that_was_asked_for() -> None:
    done = ask(
        "flight.log", "--application-id", "A", "--recording-id", "R", "--opened-recording-id", "S", "--static",
        "--time_sequence", "step=4", "--time_timestamp_nanos", "log=5", "--something-new=6",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    Path("got.rrd").write_bytes(done.stdout)
    assert stores() == {("recording", "A"), ("blueprint", "A")}
    assert [one.recording_id for one in RrdReader("got.rrd").recordings()] == ["R"]
    got, (wanted, _) = read_back(Path("got.rrd")), draw(HOVER.read_bytes())
    assert got.points("/voltage/esc1") == wanted.points("/voltage/esc1")
    assert {name for times, _ in got.points("/voltage/esc1") for name in times} == {"time", "since_start", "frame"}
    assert "/summary" in got.static


@pytest.mark.slow
def test_a_prefix_stands_in_front_of_every_path_and_the_layout_is_left_alone() -> None:
    done = ask("flight.log", "--entity-path-prefix", "/one/two")
    Path("got.rrd").write_bytes(done.stdout)
    got, (wanted, _) = read_back(Path("got.rrd")), draw(HOVER.read_bytes())
    assert got.points("/one/two/voltage/esc1") == wanted.points("/voltage/esc1")
    assert {path.split("/")[1] for path in {**got.rows, **got.static}} == {"one", "__properties"}
    assert {kind for kind, _ in stores()} == {"recording"}


@pytest.mark.slow
def test_a_recording_that_is_open_keeps_its_layout() -> None:
    done = ask("flight.log", "--recording-id", "R", "--opened-recording-id", "R")
    Path("got.rrd").write_bytes(done.stdout)
    assert {kind for kind, _ in stores()} == {"recording"}


OTHERS = {
    "notes.txt": b"Thrust stand, 14 March.\nESC 3 gets warm; see (1.5) below.\n" * 40,
    "capture.log": b"(1773475330.000000) can0 nothing\n" * 30,
    "empty.log": b"",
    "picture.png": b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(range(256)) * 9,
    "random.bin": bytes(os.urandom(3000)),
    "lib.rs": b"// base of it all\n// date of nothing\nfn main() {}\n" * 20,
    "table.csv": b"timestamp,value\n1,2\n" * 20,
    "table.CSV": b"timestamp,arbitration_id\n1,2\n" * 20,
    "flight.rrd": b"RRF2\0\0\0\0" * 300,
    "line.json": b"[" + b"1, " * 40_000 + b"]",
    "flight.mcap": b"\x89MCAP0\r\n" + bytes(100),
    "text.xz": b"\xfd7zXZ\0" + bytes(100),
    "text.gz": gzip.compress(b"nothing to see\n" * 100),
    "cut.gz": gzip.compress(b"nothing to see\n" * 100)[:20],
}


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_not_ours(name: str, capfd: pytest.CaptureFixture[str]) -> None:
    Path(name).write_bytes(OTHERS[name])
    assert importer.main([name, "--application-id", "A"]) == importer.NOT_OURS
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["nothing.log", ".", "a\0b"])
def test_what_is_no_file(name: str) -> None:
    assert importer.main([name]) == importer.NOT_OURS


def test_that_it_is_not_ours_is_found_out_without_heavy_packages() -> None:
    Path("notes.txt").write_bytes(OTHERS["notes.txt"])
    heavy = (
        "import sys; from analyzer.integrations.rerun_importer import main; "
        "print(main(), {'numpy', 'rerun', 'can'} & set(sys.modules))"
    )
    assert ask("notes.txt", code=heavy).stdout == b"66 set()\n"


def test_captures_of_every_kind_are_ours() -> None:
    Path("packed.gz").write_bytes(gzip.compress(HOVER.read_bytes()))
    Path("-x.log").write_bytes(b"# comment\n\n" + HOVER.read_bytes())
    Path("half.log").write_bytes(HOVER.read_bytes() + b"torn\n" * 3)
    for name in ("packed.gz", "-x.log", "half.log", "flight.log"):
        assert importer.is_capture(name), name


@pytest.mark.slow
def test_a_name_like_an_option_and_a_damaged_capture() -> None:
    Path("-x.log").write_bytes(HOVER.read_bytes() + b"torn\n")
    done = ask("--", "-x.log")
    assert done.returncode == 0, done.stderr
    assert b"unreadable" in done.stderr or b"torn" in done.stderr
    Path("got.rrd").write_bytes(done.stdout)
    assert read_back(Path("got.rrd")).points("/voltage/esc1")


@pytest.mark.slow
def test_the_viewer_finds_and_asks_it(tmp_path: Path) -> None:
    folder = tmp_path / "bin"
    folder.mkdir()
    program = folder / "rerun-importer-tailbyte"
    program.write_text(f"#!{sys.executable}\n{CODE}\n")
    program.chmod(0o755)
    viewer = plot_viewer.binary()
    assert viewer is not None
    port = plot_viewer.free_port("127.0.0.1")
    done = subprocess.run(
        [viewer, "flight.log", "--save", "got.rrd", "--bind", "127.0.0.1", "--port", str(port)],
        env=environment({"PATH": f"{folder}{os.pathsep}{os.environ['PATH']}"}),
        capture_output=True,
        timeout=LIMIT,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    got, (wanted, _) = read_back(Path("got.rrd")), draw(HOVER.read_bytes())
    plots = wanted.under("/voltage/") + wanted.under("/throttle/")
    assert plots
    for path in plots:
        assert sorted(map(str, got.points(path))) == sorted(map(str, wanted.points(path))), path
