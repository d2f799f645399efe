"""Colour rules: the first that holds paints a row; files with mistakes; nothing changes where there are no colours."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

from analyzer.filter.language.errors import FilterError
from analyzer.views.colours.rules import MOST_RULES, colour_rules
from analyzer.views.colours.styles import codes_of
from dissectors import ProfileError, load

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

CAPTURE = "captures/mission-8-faults.log"
_PAINTED = re.compile(r"^\x1b\[([0-9;]+)m(.*)\x1b\[0m$")


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path / "config" / "tailbyte"


def painted(text: str) -> list[tuple[str, str]]:
    """The codes and text of each line, of rows with a number; no codes for plain ones."""
    found = []
    for line in text.splitlines():
        colours = _PAINTED.fullmatch(line)
        codes, plain = (colours[1], colours[2]) if colours else ("", line)
        if re.match(r"[!x~ ] +\d+ ", plain):
            found.append((codes, plain))
    return found


@pytest.mark.parametrize(
    ("style", "codes"),
    [
        ("red", "31"), ("bold red", "1;31"), ("Bright Green", "92"), ("white on red", "37;41"), ("plain", ""),
        ("dim black on bright yellow", "2;30;103"), ("underline italic reverse", "4;3;7"), ("on blue", "44"),
    ],
)  # fmt: skip
def test_styles(style: str, codes: str) -> None:
    assert codes_of(style) == codes


@pytest.mark.parametrize(
    ("style", "reason", "start"),
    [
        ("bold rde", "no colour or effect is called 'rde'; did you mean red?", 5),
        ("red blue", "blue is one too many", 4),
        ("red on", "a colour is missing behind on", 4),
        ("bright", "a colour is missing behind bright", 0),
        ("plain red", "", 0),
        ("on on red", "", 3),
        ("  ", "a style is missing, such as bold red", 0),
        ("\x1b[31m", "", 0),
    ],
)
def test_wrong_styles(style: str, reason: str, start: int) -> None:
    with pytest.raises(FilterError) as wrong:
        codes_of(style)
    assert wrong.value.reason.startswith(reason)
    assert wrong.value.start == start


def test_without_colours_nothing_changes(command: Command, home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = command("decode", CAPTURE)[1]
    home.mkdir(parents=True)
    (home / "colours.toml").write_text("no TOML at all [")
    assert command("decode", CAPTURE)[1] == plain
    assert "\x1b" not in plain
    assert command("decode", CAPTURE, "--color", "never")[1] == plain
    monkeypatch.setenv("NO_COLOR", "1")
    assert command("decode", CAPTURE)[1] == plain
    coloured = command("decode", CAPTURE, "--color", "always", "--colours", "off")[1]
    assert re.sub("\x1b\\[[0-9;]+m", "", coloured) == plain


def test_the_default_set(command: Command) -> None:
    plain = command("decode", CAPTURE)[1]
    coloured = command("decode", CAPTURE, "--color", "always")[1]
    assert re.sub("\x1b\\[[0-9;]+m", "", coloured) == plain
    rows = painted(coloured)
    assert {codes for codes, text in rows if text.startswith("x")} == {"31"}
    assert {text.split()[3] for codes, text in rows if codes == "35"} <= {"ParamCfg", "ParamGet"}
    assert sum(not codes for codes, _ in rows) > 0.9 * len(rows)  # calm as long as nothing is wrong
    failure = painted(command("decode", "captures/esc-failure.mcap", "--color", "always")[1])
    assert {codes for codes, text in failure if "ERROR MODE" in text} == {"1;31"}


def test_the_first_rule_that_holds_wins_and_ones_own_go_first(command: Command, home: Path) -> None:
    home.mkdir(parents=True)
    own = home / "colours.toml"
    own.write_text("""
[[colour]]
when = "RawCommand && dronecan.transfer_id < 8"
style = "blue"
[[colour]]
when = "RawCommand"
style = "green"
[[colour]]
name = "broken ones as they are"
when = '!(dronecan.status == "ok")'
style = "plain"
[[colour]]
when = "NodeStatus"
style = "yellow"
enabled = false
""")
    rows = painted(command("decode", CAPTURE, "--color", "always")[1])
    assert {codes for codes, text in rows if " RawCommand " in text and text[0] == " "} == {"34", "32"}
    for codes, text in rows:
        if " RawCommand " in text and text[0] == " ":
            number = int(text.split("RawCommand")[1].split()[0])
            assert codes == ("34" if number < 8 else "32")
    assert {codes for codes, text in rows if text[0] == "x" and "RawCommand" not in text} == {""}
    assert "33" not in {codes for codes, text in rows if " NodeStatus " in text}
    own.write_text("defaults = false\n")
    rows = painted(command("decode", CAPTURE, "--color", "always")[1])
    assert {codes for codes, text in rows if text[0] == "x"} == {"31"}  # as without rules
    assert {codes for codes, text in rows if text[0] == " "} == {""}


def test_frames_without_a_transfer_and_error_frames(command: Command, tmp_path: Path) -> None:
    file = tmp_path / "c.toml"
    file.write_text('defaults = false\n[[colour]]\nwhen = "can.flags.err"\nstyle = "magenta"\n')
    text = command("decode", "captures/bus-break.log", "--color", "always", "--colours", file)[1]
    errors = [line for line in text.splitlines() if "error frame" in line]
    assert errors
    assert all(line.startswith("\x1b[35m") for line in errors)


GOOD = '[[colour]]\nwhen = "ESCStatus"\nstyle = "red"\n'
WRONG = [
    ('[[colour]]\nwhen = "ESCStatus.foo"\nstyle = "red"', 2, "ESCStatus has no field 'foo'", "when"),
    ('[[colour]]\nwhen = "ESCStatus"\nstyle = "red"\n\n[[colour]]\nwhen = "ch =="\nstyle = "red"', 6, "", "when"),
    ('[[colour]]\nwhen = "ESCStatus"\nstyle = "rde"', 3, "no colour or effect is called 'rde'", "style"),
    ('[[colour]]\nwhen = "ESCStatus"\nstile = "red"', 3, "did you mean style?", ""),
    ('[[colour]]\nstyle = "red"', 1, "when is missing", ""),
    ('[[colour]]\nwhen = "finding.rule"\nstyle = "red"', 2, "a colour cannot ask for findings", ""),
    ('colours = "red"', 1, "unknown key", ""),
    ('[[colour]]\nwhen = "ESCStatus"\nstyle = "red"\n[[color]]\nwhen = "x"', 4, "did you mean colour?", ""),
    (f"{GOOD}[[colour]]\nwhenn = 'ESCStatus'", 5, "whenn: unknown key; did you mean when?", ""),
    (f"{GOOD}[[ colour ]]  # when\nwhen = 5\nstyle = 'red'", 5, "a text is expected", ""),
    (f"{GOOD}[[colour]]\nstyle = 'red'\n[[colour]]\nstyle = 'red'", 4, "when is missing", ""),
    (GOOD + '[[colour]]\nwhen = """\nESCStatus\n&& ESCStatus.foo"""\nstyle = "red"', 7, "no field 'foo'", "when"),
    (GOOD + "[[colour]]\nwhen = '''ch ==\n [[colour]]'''\nstyle = 'rde'", 6, "expected", "when"),
    (GOOD + "[[colour]]\nwhen = '''\nch == 1 ||\nwhen = 5'''\nstyle = 'red'", 7, "write ==", "when"),
    ("[[colour]]\nwhen = 3\nstyle = 'red'", 2, "a text is expected", ""),
    ('[[colour]]\nwhen = "ESCStatus"\nstyle = "red"\n' * (MOST_RULES + 1), 1, f"more than {MOST_RULES}", ""),
]


@pytest.mark.parametrize(("text", "line", "reason", "key"), WRONG)
def test_wrong_files(text: str, line: int, reason: str, key: str, tmp_path: Path, command: Command) -> None:
    path = tmp_path / "c.toml"
    path.write_text(text)
    with pytest.raises(ProfileError) as wrong:
        colour_rules(str(path), load())
    assert wrong.value.line == line
    assert reason in wrong.value.reason
    status, out, complaints = command("decode", CAPTURE, "--colours", path)
    assert (status, out) == (2, "")
    assert complaints.count("\n") == (3 if key else 1)
    assert ("^" in complaints) == bool(key)


def test_a_file_that_is_not_there(command: Command, tmp_path: Path) -> None:
    assert command("decode", CAPTURE, "--colours", tmp_path / "none")[0] == 2


def test_a_file_that_is_not_there_has_no_lines(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "none.toml"
    status, out, complaints = command("decode", CAPTURE, "--colours", path)
    assert (status, out, complaints) == (2, "", f"tailbyte decode: {path}: No such file or directory\n")


@pytest.mark.parametrize("capture", ["captures/faults.log", "captures/bus-break.log"])
def test_frames_of_a_list_have_the_colours_of_what_holds_for_them(command: Command, home: Path, capture: str) -> None:
    home.mkdir(parents=True)
    rules = {
        "95": "can.id == 0x123 || can.flags.err",
        "36": "ESCStatus",
        "4": "can.len < 4",
        "": "NodeStatus",
        "7": "frame.time_delta > 1 ms",
    }
    styles = {"95": "bright magenta", "36": "cyan", "4": "underline", "": "plain", "7": "reverse"}
    (home / "colours.toml").write_text(
        "defaults = false\n"
        + "".join(f"[[colour]]\nwhen = '{when}'\nstyle = '{styles[code]}'\n" for code, when in rules.items())
    )
    _, plain, _ = command("decode", capture, "--frame-list", "--color", "never", "-t", "e")
    _, coloured, _ = command("decode", capture, "--frame-list", "--color", "always", "-t", "e")
    assert re.sub(r"\x1b\[[0-9;]*m", "", coloured) == plain
    rest = plain.splitlines()[1:]
    for code, when in rules.items():
        _, out, _ = command("decode", capture, "--frame-list", "-t", "e", "-Y", when)
        mine = set(out.splitlines()[1:]) & set(rest)
        rest = [line for line in rest if line not in mine]
        assert mine
        if code:
            rows = [found for line in coloured.splitlines() if (found := _PAINTED.fullmatch(line))]
            assert {found[2] for found in rows if found[1] == code} == mine
