"""Marks beside a capture, where other commands show them: lists, copies, the report."""

from __future__ import annotations

import shutil
import struct
from errno import ENOSPC
from pathlib import Path

import pytest
from kit.browsing import capture

from analyzer.cli import main
from analyzer.facts.frame_marks import MarkBook


@pytest.fixture
def marked(tmp_path: Path) -> Path:
    path = tmp_path / "flight.log"
    shutil.copy(capture("mission-8-faults.log"), path)
    (tmp_path / "flight.log.marks.toml").write_text(
        '[[mark]]\nframe = 5711\ntext = "it <b>began</b> \\u001b[31mhere"\n\n[[mark]]\nframe = 9000\ntext = ""\n'
    )
    return path


def packets(data: bytes) -> list[str | None]:
    """Return the comment of every packet of a pcapng file, None for none."""
    found: list[str | None] = []
    at = 0
    while at < len(data):
        kind, length = struct.unpack_from("<II", data, at)
        if kind == 6:
            (captured,) = struct.unpack_from("<I", data, at + 20)
            options, said = data[at + 28 + captured + -captured % 4 : at + length - 4], None
            while options:
                code, size = struct.unpack_from("<HH", options)
                said = options[4 : 4 + size].decode() if code == 1 else said
                options = options[4 + size + -size % 4 :]
            found.append(said)
        at += length
    return found


def test_a_copy_as_pcapng_has_them_as_comments_of_packets(marked: Path, tmp_path: Path) -> None:
    out = tmp_path / "flight.pcapng"
    assert main(["convert", str(marked), str(out)]) == 0
    said = packets(out.read_bytes())
    assert len(said) == 10220
    assert {at: text for at, text in enumerate(said, 1) if text is not None} == {
        5711: "it <b>began</b> \x1b[31mhere",
        9000: "marked",
    }
    assert main(["decode", "-q", str(out)]) == 0


def test_a_part_has_those_of_its_frames(marked: Path, tmp_path: Path) -> None:
    out = tmp_path / "part.pcapng"
    assert main(["convert", str(marked), str(out), "--frames", "5700-8000"]) == 0
    said = packets(out.read_bytes())
    assert len(said) == 2301
    assert [at for at, text in enumerate(said) if text] == [11]
    assert main(["convert", str(marked), str(tmp_path / "none.pcapng"), "-Y", "NodeStatus"]) == 0
    assert not any(packets((tmp_path / "none.pcapng").read_bytes()))


@pytest.mark.parametrize("name", ["copy.log", "copy.mcap"])
def test_what_cannot_hold_them_says_so(
    name: str, marked: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["convert", str(marked), str(tmp_path / name)]) == 0
    assert "cannot hold: comments on frames (2)" in capsys.readouterr().err


def test_lists_show_them(marked: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words, above in (((), "5711"), (("--frame-list",), "5711")):
        assert main(["decode", str(marked), "--no-pager", *words]) == 0
        lines = capsys.readouterr().out.splitlines()
        at = lines.index(" " * 11 + "# it <b>began</b> \\x1b[31mhere")
        assert above in "".join(lines[at - 2 : at])
        assert lines.count(" " * 11 + "# marked") == 1


def test_the_html_report_shows_them(marked: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    assert main(["check", str(marked), "--html", str(out)]) in (0, 1)
    page = out.read_text()
    assert "it &lt;b&gt;began&lt;/b&gt; \\x1b[31mhere" in page
    assert "<b>began" not in page


def test_a_wrong_file_of_marks(marked: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "flight.log.marks.toml").write_text("[[mark]]\nframe = 0\n")
    for words in (("decode",), ("convert", "-o", str(tmp_path / "x.pcapng"))):
        assert main([words[0], str(marked), *words[1:]]) == 2
        assert "mark 1: frame is a number from 1" in capsys.readouterr().err
    assert main(["check", str(marked)]) == 1  # the verdict does not hang on them
    assert "mark 1: frame is a number from 1" in capsys.readouterr().err


def test_a_full_disk_leaves_nothing_of_marks_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, _: str, **__: str) -> int:
        path.touch()
        raise OSError(ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    book = MarkBook(tmp_path / "flight.log.marks.toml")
    book.toggle(0, None)
    with pytest.raises(OSError, match="No space"):
        book.save()
    assert book.changed
    assert list(tmp_path.iterdir()) == []
