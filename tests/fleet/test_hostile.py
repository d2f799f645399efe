"""Folders of captures as somebody else may leave them: names, links, files that are none, and Python among them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from kit import CAPTURES

from analyzer.fleet.listing import listed
from analyzer.fleet.store import ResultStore

HOVER = (CAPTURES / "hover.log").read_bytes()
NAMES = (
    "two words.log",
    "100%41.log",
    "new\nline.log",
    "esc\x1b[31m.log",
    "[x].log",
    "q?.log",
    "<b>.log",
    "\udcff.log",
)
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def folder(tmp_path):
    place = tmp_path / "logs"
    (place / "folder.log").mkdir(parents=True)
    for name in NAMES:
        (place / name).write_bytes(HOVER)
    (place / "link.log").symlink_to("q?.log")
    for name, where in (("loop", "."), ("circle.log", "circle.log"), ("nowhere.log", "gone")):
        (place / name).symlink_to(where)
    os.mkfifo(place / "pipe.log")
    return place


@pytest.mark.parametrize("pattern", ["", "*.log", "**/*.log"])
def test_files_are_listed_once_whatever_lies_beside_them(folder, pattern):
    found = [Path(one.url).name for one in listed([str(folder / pattern)], "/nowhere")]
    assert sorted(found) == sorted((*NAMES, "link.log"))


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_itself_before_it_is_a_pattern(folder, name):
    assert [one.url for one in listed([str(folder / name)], "/nowhere")] == [str(folder / name)]


def test_any_name_can_be_stored(folder, tmp_path, command):
    status, _, said = command("fleet", "check", folder, "-o", tmp_path / "results", "--workers", "0")
    assert status == 0, said
    rows = ResultStore(str(tmp_path / "results")).connected().execute("select url, outcome, duplicate from latest")
    found = {url.removeprefix(f"{folder}/"): (outcome, duplicate) for url, outcome, duplicate in rows.fetchall()}
    assert set(found) == {*NAMES[:-1], "link.log", "\\xff.log"}
    assert {one[0] for one in found.values()} == {"judged"}
    assert sum(not duplicate for _, duplicate in found.values()) == 1
    _, shown, _ = command("fleet", "report", tmp_path / "results")
    assert "\x1b" not in shown


def test_a_store_beside_us_is_not_read_as_captures(folder, command, monkeypatch):
    inside = folder / "folder.log"
    monkeypatch.chdir(inside)
    for _ in range(2):
        command("fleet", "check", folder, "-o", "../results", "--workers", "0")
    status, _, said = command("fleet", "check", folder, "-o", "../results", "--workers", "0")
    assert (status, "captures: 0 read" in said) == (0, True), said


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of libraries, about sockets
def test_python_in_a_folder_of_captures_is_not_executed(tmp_path):
    """Workers are started from the folder they read, by the installed command."""
    folder, command = tmp_path / "logs", tmp_path / "tailbyte"
    folder.mkdir()
    (folder / "hover.log").write_bytes(HOVER)
    for name in ("multiprocessing", "random", "signal", "dask", "distributed", "analyzer", "sitecustomize"):
        (folder / f"{name}.py").write_text(f"open({str(tmp_path / 'executed')!r}, 'w')\n")
    command.write_text(f"import sys\nsys.path.append({str(ROOT)!r})\nfrom analyzer.cli import main\n"
                       "if __name__ == '__main__':\n    sys.exit(main())\n")  # fmt: skip
    done = subprocess.run(
        [sys.executable, str(command), "fleet", "check", "*.log", "-o", "results", "--workers", "1"],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, "captures: 1 read" in done.stderr) == (0, True), done.stderr
    assert not (tmp_path / "executed").exists()
