"""Vehicle files with rules of their own: every mistake has its line and place, and what means harm is bounded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit.flight import Vehicle
from kit.judged import judge, registry

from analyzer.cli import main
from analyzer.rules.catalogue import load as load_pages
from analyzer.rules.vehicle.at_hand import device_name
from analyzer.rules.vehicle.expected import load
from analyzer.rules.vehicle.lasting import MOST_OPEN, MOST_STREAMS, Demands, Event, Streaks
from analyzer.rules.vehicle.own import MOST_RULES
from dissectors import ProfileError

if TYPE_CHECKING:
    from pathlib import Path

SECOND = 10**9
HEAD = '[rule.ACME-001]\ntitle = "t"\n'
WRONG = [
    (HEAD + 'when = "ESCStatus.temprature > 4"', 3, "ESCStatus has no field 'temprature'", 10),
    (HEAD + 'when = "ESCStatus >"', 3, "", None),
    (HEAD + 'when = "ESCStatus.voltage > 4 A"', 3, "A does not fit: the field is in V", 20),
    (HEAD + "when = 'ESCStatus.mode == \"broken\"'", 3, "", 18),
    (HEAD + "when = 'finding.rule == \"TRF-001\"'", 3, "a rule cannot ask what rules find", 0),
    (HEAD + "when = 'node.label == \"front\" && ESCStatus'", 3, "no node in this file is called 'front'", 14),
    (
        "[node.12]\nlabel = 'front left'\n" + HEAD + "when = 'ESCStatus && node.label == \"front lift\"'",
        5,
        "did you mean front left?",
        27,
    ),
    (HEAD + 'when = "ESCStatus && can.flags.err"', 3, "no transfer has an error frame or remote frame", 13),
    (HEAD + 'when = "can.flags.rtr && dronecan.priority > 3"', 3, "no transfer has an error frame", 0),
    (HEAD + 'when = "can.id == 3"\nthen = "NodeStatus"\nwithin = "1 s"', 3, "a demand is of transfers", 0),
    (HEAD + 'when = "ESCStatus"\nthen = "1 < can.id"\nwithin = "1 s"', 4, "a demand is of transfers", 4),
    (HEAD + 'when = "can.id == 3"\ntext = "a {ESCStatus.rpm}"', 4, "its text shows fields of frames", 3),
    (HEAD + 'when = "ESCStatus"\nfor = "2 sec"', 4, "unknown unit of time 'sec': one of us, ms, s, min", 2),
    (HEAD + 'when = "ESCStatus"\nfor = "2"', 4, "a unit is missing", 1),
    (HEAD + 'when = "ESCStatus"\nfor = "soon"', 4, "no time", 0),
    (HEAD + 'when = "ESCStatus"\nfor = "0 s"', 4, "a time above 0, up to 600 s", 0),
    (HEAD + 'when = "ESCStatus"\nfor = "999999999999 min"', 4, "a time above 0, up to 600 s", 0),
    (HEAD + 'when = "ESCStatus"\nfor = 2', 4, 'a time with its unit in quotes is expected, such as "2 s"', None),
    (HEAD + 'when = "ESCStatus"\nwithin = "2 s"', 1, "then is missing", None),
    (HEAD + 'when = "ESCStatus"\nthen = "NodeStatus"', 1, "within is missing", None),
    (HEAD + 'when = "ESCStatus"\nthen = "NodStatus"\nwithin = "1 s"', 4, "no field or type is called 'NodStatus'", 0),
    (HEAD + 'when = "ESCStatus"\ntext = "at {ESCStatus.rpn} rpm"', 4, "ESCStatus has no field 'rpn'", 14),
    (HEAD + 'when = "ESCStatus"\nseverty = "note"', 4, "did you mean severity?", None),
    (HEAD + 'when = "ESCStatus"\nseverity = "bad"', 4, "'bad' is unknown (allowed: error, warning, note)", None),
    (HEAD + 'when = "ESCStatus"\ncategory = "esc"', 4, "'esc' is unknown", None),
    ('[rule.ACME-001]\nwhen = "ESCStatus"', 1, "title is missing", None),
    ('[rule.ACME-001]\ntitle = "t"', 1, "one of your own needs `when`", None),
    ('[rule.TRF-003]\ntitle = "t"\nwhen = "ESCStatus"', 1, "TRF-003 is built in", None),
    ('[rule.TRF-999]\ntitle = "t"\nwhen = "ESCStatus"', 1, "rules of TRF are built in", None),
    ('[rule.acme]\ntitle = "t"\nwhen = "ESCStatus"', 1, "'acme' is no name of a rule", None),
    (HEAD + 'whenn = "ESCStatus"', 3, "whenn: unknown key; did you mean when?", None),
    (HEAD + 'when = "RawCommand"\ntext = "{RawCommand.cmd[0]}"', 4, "whole fields: write {RawCommand.cmd}", 1),
    (HEAD + 'when = "RawCommand"\ntext = "a { alone"', 4, "a { without its other half", 2),
    (HEAD + 'when = "RawCommand"\ntext = "{RawCommand} alone }"', 4, "a text shows fields of rows only", 1),
    (HEAD + 'when = "RawCommand"\ntext = "{RawCommand.cmd} alone }"', 4, "a } without its other half", 23),
    (HEAD + 'text = "when = 1"\nwhen = """\n ch == 1\n  && ESCStatus.volatge > 3"""', 6, "no field 'volatge'", 15),
    (
        HEAD + "when = '''ESCStatus\nfor = 1'''\nfor = '2 parsec'",
        4,
        "an operator such as && or == (or the dot of a name) is expected",
        0,
    ),
    (HEAD + "when = '''ESCStatus\n# for'''\nfor = '2 parsec'", 4, "# is no operator", 0),
    (HEAD + "when = '''ESCStatus\n||ch==1'''\nfor = '2 parsec'", 5, "unknown unit of time 'parsec'", 2),
    (HEAD + 'when = "' + "(" * 5000 + '"', 3, "", None),
]


@pytest.mark.parametrize(("text", "line", "reason", "caret"), WRONG)
def test_what_is_wrong_is_told_before_a_capture_is_read(
    text: str, line: int, reason: str, caret: int | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "vehicle.toml"
    path.write_text(text)
    assert main(["check", "no-such-capture.log", "--vehicle", str(path)]) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[0].startswith(f"tailbyte check: {path}:{line}: ")
    assert reason in said[0]
    if caret is not None:
        assert len(said) == 3
        assert said[2].index("^") == caret + 2


def test_thousands_of_rules(tmp_path: Path) -> None:
    path = tmp_path / "vehicle.toml"
    path.write_text("".join(f'[rule.A-{k}]\ntitle = "t"\nwhen = "ESCStatus"\n' for k in range(5000)))
    with pytest.raises(ProfileError, match=f"5000 rules of its own, more than {MOST_RULES}"):
        load(path, load_pages(registry()), registry())


def test_text_of_a_capture_stays_text(tmp_path: Path) -> None:
    """Braces in what a capture says are no places for values."""
    path = tmp_path / "vehicle.toml"
    vehicle = Vehicle()
    vehicle.send(0, "uavcan.protocol.debug.LogMessage", 11, {"level": {"value": 0}, "source": b"s", "text": b"{said}"})
    path.write_text(HEAD + 'when = "LogMessage"\ntext = "says {LogMessage.text}"')
    own = load(path, load_pages(registry()), registry()).own
    texts = [one.text for one in judge(vehicle.finish(), None, own=own) if one.rule == "ACME-001"]
    assert texts == ["says {said}"]


def test_what_is_remembered_of_senders_is_bounded() -> None:
    streaks = Streaks(SECOND)
    many = 3 * MOST_STREAMS
    assert streaks.feed(range(many), range(many), [True] * many) == []
    assert len(streaks._open) == MOST_STREAMS
    assert streaks.feed([many - 1, 0], [2 * SECOND, 2 * SECOND], [True, True]) == [0]
    demands = Demands(SECOND, same=False)
    events = [Event(k, 0, k, 0, True, False, False, None, k) for k in range(3 * MOST_OPEN)]
    assert list(demands.feed(events)) == []
    assert len(demands._open) == MOST_OPEN
    assert len(list(demands.overdue(60 * SECOND))) == MOST_OPEN


def test_a_clock_that_is_set_back_begins_anew() -> None:
    streaks = Streaks(2 * SECOND)
    times = [10, 11, 5, 6, 7]
    assert streaks.feed([1] * 5, [t * SECOND for t in times], [True] * 5) == [4]
    demands = Demands(SECOND, same=False)
    opens = Event(10 * SECOND, 0, 1, 0, True, False, False, None, 0)
    back = Event(5 * SECOND, 0, 2, 0, False, False, True, None, -1)
    assert list(demands.feed([opens, back])) == []
    assert demands.idle


def test_devices_have_names() -> None:
    assert [device_name(one) for one in (0, 2, 256)] == ["", "unit 2", "ch1"]
