"""tailbyte check --extract: which files there are, what they show alone, and what cannot be."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import pytest
from kit.command import CAPTURES, run
from kit.reports import finding, report

from analyzer.app import extracting
from analyzer.app.check import check
from analyzer.app.criteria import Criteria
from analyzer.app.request import Request
from analyzer.cli import main

if TYPE_CHECKING:
    from pathlib import Path


HOVER, FAULTS = CAPTURES / "hover-4.log", CAPTURES / "mission-8-faults.log"


def findings(path: Path, *select: str) -> list[dict[str, Any]]:
    return [asdict(one) for one in check(path, select=select).findings]


def criteria(request: Request) -> Criteria:
    from kit.judged import registry  # noqa: PLC0415

    return Criteria(request.rules, registry())


@pytest.mark.slow
def test_every_file_shows_its_finding_alone(tmp_path: Path) -> None:
    done = run("check", FAULTS, "--extract", tmp_path / "out")
    assert done.returncode == 1
    wanted = findings(FAULTS)
    expected = {
        "-".join([one["rule"], *([f"node{one['node']}", one["type"]] if one["node"] else []), "1.log"]): one
        for one in wanted
    }
    assert len(expected) == len(wanted) > 5
    assert {one["severity"] for one in wanted} == {"error", "warning", "note"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == expected.keys()
    assert f"-- {len(wanted)} of {len(wanted)} findings written to {tmp_path / 'out'}".encode() in done.stderr
    lines = 0
    for name, one in expected.items():
        same = [
            other for other in findings(tmp_path / "out" / name, one["rule"])
            if (other["severity"], other["node"], other["type"]) == (one["severity"], one["node"], one["type"])
        ]  # fmt: skip
        assert same, name
        part = (tmp_path / "out" / name).read_bytes().splitlines()
        assert set(part) <= set(FAULTS.read_bytes().splitlines())
        lines += len(part)
    assert lines < 100 * len(expected)


@pytest.mark.slow
def test_of_a_window_the_parts_are_cut_from_it(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    window = ["--from", "2", "--to", "2.6"]
    assert main(["check", str(FAULTS), *window, "--extract", str(tmp_path)]) == 1
    err = capfd.readouterr().err
    count = len(list(tmp_path.iterdir()))
    assert f"-- {count} of {count} findings written" in err
    rows = FAULTS.read_text().splitlines()
    zero = float(rows[0][1:18])
    times = [float(row[1:18]) for path in tmp_path.iterdir() for row in path.read_text().splitlines()]
    assert round(min(times) - zero, 6) >= 2
    assert round(max(times) - zero, 6) <= 2.6


@pytest.mark.slow
def test_of_several_captures_each_has_its_own(tmp_path: Path) -> None:
    run("check", FAULTS, FAULTS, "--select", "TRF-010", "--extract", tmp_path)
    one, two = sorted(tmp_path.iterdir())
    assert (one.name[-6:], two.name[-6:]) == ("-1.log", "-2.log")
    assert one.read_bytes() == two.read_bytes()


@pytest.mark.slow
def test_nothing_found_nothing_written(tmp_path: Path) -> None:
    done = run("check", HOVER, "--select", "TRF", "--extract", tmp_path)
    assert (done.returncode, done.stderr) == (0, f"-- 0 of 0 findings written to {tmp_path}, 0 lines\n".encode())
    assert list(tmp_path.iterdir()) == []


def test_standard_input_exists_only_once(tmp_path: Path) -> None:
    with FAULTS.open("rb") as file:
        done = run("check", "-", "--extract", tmp_path / "out", stdin=file)
    assert (done.returncode, done.stdout) == (2, b"")
    assert done.stderr.count(b"\n") == 1
    assert b"standard input exists only once" in done.stderr
    assert not (tmp_path / "out").exists()


def test_what_cannot_be_a_folder(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("mine")
    assert main(["check", str(FAULTS), "--extract", str(tmp_path / "file")]) == 2
    assert "is not a folder" in capfd.readouterr().err
    assert main(["check", str(FAULTS), "--extract", ""]) == 2
    assert main(["check", str(HOVER), "--select", "TRF", "--extract", str(tmp_path / "file" / "below")]) == 3
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.slow
def test_a_capture_is_not_written_over(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    run("check", FAULTS, "--select", "TRF-010", "--extract", tmp_path)
    (path,) = tmp_path.iterdir()
    content = path.read_bytes()
    less = ["--fail-on", "never", "--least", "transfers=1,seconds=0"]
    assert main(["check", str(path), "--select", "TRF-010", *less, "--extract", str(tmp_path), "--force"]) == 3
    err = capfd.readouterr().err
    assert "is the capture" in err
    assert "-- 0 of 1 findings written" in err
    assert (path.read_bytes(), list(tmp_path.iterdir())) == (content, [path])


@pytest.mark.slow
def test_other_files_are_left_alone_without_force(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    args = ["check", str(FAULTS), "--select", "TRF-010", "--extract", str(folder)]
    for name in ("d", "b", "a", "c\x1b[2J"):
        (folder / name).write_text("mine")
    assert main(args) == 2
    out, err = capfd.readouterr()
    said = f"tailbyte check: {folder}: holds files already (a, b, c\\x1b[2J and 1 more): --force writes among them\n"
    assert (out, err) == ("", said)
    assert len(list(folder.iterdir())) == 4
    assert main([*args, "--force"]) == 1
    assert (folder / "a").read_text() == "mine"
    assert len(list(folder.iterdir())) > 4


def test_names_are_safe_and_differ() -> None:
    found = [finding("TRF-003", type=name, node=node) for name, node in [("../a/b", 5), ("../A\x1bb", 5), ("", None)]]
    names = list(extracting._names(found))
    assert names == ["TRF-003-node5-.._a_b-1.log", "TRF-003-node5-.._A_b-2.log", "TRF-003-1.log"]
    (long,) = extracting._names([finding("TRF-003", type="x" * 10_000)])
    assert len(long) < 120


@pytest.mark.slow
def test_what_is_not_written_is_told(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(extracting, "MOST_FILES", 3)
    assert main(["check", str(FAULTS), "--extract", str(tmp_path)]) == 1
    err = capfd.readouterr().err
    assert f"; {len(findings(FAULTS)) - 3} more findings have none" in err
    assert len(list(tmp_path.iterdir())) == 3


def test_a_finding_that_no_part_shows_is_named(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    request = Request((str(FAULTS),))
    made = report(finding("TRF-003", node=99, type="ESCStatus", capture=FAULTS.name))
    assert not extracting.extract(made, request, criteria(request), str(tmp_path))
    err = capfd.readouterr().err
    assert f"TRF-003-node99-ESCStatus-1.log: no part of {FAULTS.name} shows the finding" in err
    assert f"-- 0 of 1 findings written to {tmp_path}, 0 lines; 1 could not be written" in err
    assert list(tmp_path.iterdir()) == []


def test_one_that_cannot_be_written_does_not_stop_the_others(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    log = CAPTURES / "faults.log"
    (tmp_path / "CAN-004-1.log").mkdir()
    assert main(["check", str(log), "--select", "CAN-004,CAP-004", "--extract", str(tmp_path), "--force"]) == 3
    err = capfd.readouterr().err
    assert "CAN-004-1.log: is a directory" in err
    assert "-- 2 of 3 findings written" in err
    assert err.rstrip().endswith("; 1 could not be written")
    assert (tmp_path / "CAP-004-1.log").read_bytes().endswith(b"on 'can0' socket (total drops 3)\n")


@pytest.mark.slow
def test_of_an_unreadable_line_there_is_no_part(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    args = ["check", str(CAPTURES / "faults.log"), "--select", "CAP-003", "--fail-on", "capture:error"]
    assert main(args) == 1
    assert main([*args, "--extract", str(tmp_path)]) == 3
    assert "CAP-003-1.log: no part of faults.log shows the finding" in capfd.readouterr().err


# Whatever candump or our own writer puts into a log, with a finding of CAN-004 among it.
KINDS = [
    "(1700000000.000100) can0 05040601#A63500000000009C R",
    "(1700000000.000200) can0 7FF#",
    "(1700000000.000300) can0 123##1112233",
    "(1700000000.000400) can0 123#R8_F T",
    "(1700000000.000500) can0 123#1122334455667788_B",
    "(1700000000.000600) can0 20000004#0100000000000000 T",
    "DROPCOUNT: dropped 5 CAN frames on 'can0' socket (total drops 12)",
    "DROPCOUNT: dropped 7 CAN frames on 'any' socket (total drops 19) (1700000000.000700)",
    "DROPCOUNT: dropped 1 CAN frame on 'can0' socket (total drops 20)",
    "# a comment",
    "#",
    "; (1700000000.000800) one with a time",
    "",
]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("stamped", [True, False])
def test_every_kind_of_line_may_stand_near_a_finding(tmp_path: Path, *, stamped: bool) -> None:
    lines = [line if stamped or not line.startswith("(") else line.partition(") ")[2] for line in KINDS]
    log = tmp_path / "all.log"
    log.write_text("\n".join(lines) + "\n")
    found = findings(log, "CAN-004", "CAP-004")
    assert {one["rule"] for one in found} == {"CAN-004", "CAP-004"}
    out, request = tmp_path / "out", Request((str(log),))
    assert extracting.extract(check(log, select=["CAN-004", "CAP-004"]), request, criteria(request), str(out))
    parts = list(out.iterdir())
    assert len(parts) == len(found)
    for path in parts:
        assert set(path.read_text().splitlines()) <= set(lines)
        assert path.stat().st_size < log.stat().st_size / 2
