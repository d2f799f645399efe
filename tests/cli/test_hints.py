"""What is said to somebody who types something that does not exist: one line, status 2, and what to type instead."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

import pytest

from analyzer.cli.commands import COMMANDS, every_command
from analyzer.cli.usage import habits, hints

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "flight.log").touch()
    (tmp_path / "my flight.log").touch()
    (tmp_path / "logs").mkdir()
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("decod flight.log", "tailbyte: no command decod; did you mean tailbyte decode?"),
        ("DECODE", "tailbyte: no command DECODE; did you mean tailbyte decode?"),
        ("exp flight.log", "tailbyte: no command exp; did you mean tailbyte explain or tailbyte export?"),
        ("xyzzy", "tailbyte: no command xyzzy (see tailbyte --help)"),
        ("''", "tailbyte: no command '' (see tailbyte --help)"),
        ("monitor can0", "tailbyte: no command monitor; did you mean tailbyte live?"),
        ("candump can0", "tailbyte: no command candump; did you mean tailbyte live?"),
        ("-help", "tailbyte: no option -help; did you mean tailbyte --help?"),
        ("live can0 --duration 5", "tailbyte live: no option --duration; did you mean -a duration:TIME?"),
        ("replay flight.log can0 -l i", "tailbyte replay: no option -l; did you mean --loop?"),
        ("version", "tailbyte: no command version; did you mean tailbyte --version?"),
        ("interfaces", "tailbyte: no command interfaces; did you mean tailbyte live -D?"),
        ("can0", "tailbyte: can0 is an interface: did you mean tailbyte live can0?"),
        ("vcan12 -V", "tailbyte: vcan12 is an interface: did you mean tailbyte live vcan12?"),
        (
            "slcan:/dev/ttyS0@500000",
            "tailbyte: slcan:/dev/ttyS0@500000 is an interface: did you mean tailbyte live slcan:/dev/ttyS0@500000?",
        ),
        ("flight.log decode -V", "tailbyte: the command comes first: did you mean tailbyte decode flight.log?"),
        ("'my flight.log' check", "tailbyte: the command comes first: did you mean tailbyte check 'my flight.log'?"),
        ("logs/", "tailbyte: logs/ is a folder: did you mean tailbyte info logs/*?"),
        ("missing.log", "tailbyte: missing.log: no such file, and no command (see tailbyte --help)"),
        ("-r flight.log", "tailbyte: -r of which command? did you mean tailbyte decode -r flight.log?"),
        ("-i can0", "tailbyte: -i of which command? did you mean tailbyte live -i can0?"),
        (
            "-r flight.log -Y 'can.id == 5' -c 3",
            "tailbyte: -r of which command? did you mean tailbyte decode -r flight.log -Y 'can.id == 5' -c 3?",
        ),
        (
            "flight.log -Y 'can.id == 5' -c 3",
            "tailbyte triage: -Y of which command? did you mean tailbyte decode flight.log -Y 'can.id == 5' -c 3?",
        ),
        ("flight.log -V", "tailbyte triage: -V of which command? did you mean tailbyte decode flight.log -V?"),
        ("-G fields", "tailbyte: no option -G; did you mean tailbyte fields?"),
        ("decode flight.log -w x.pcapng", "tailbyte decode: no option -w; did you mean tailbyte convert?"),
        ("decode flight.log -E header=y", "tailbyte decode: no option -E; did you mean -T csv?"),
        (
            "decode flight.log -T ek",
            "tailbyte decode: argument -T: ek is none of text, fields, json, jsonl, csv; did you mean jsonl?",
        ),
        ("decode flight.log -a duration:5", "tailbyte decode: no option -a; did you mean --to?"),
        ("decode flight.log -u s", "tailbyte decode: no option -u; did you mean -t?"),
        ("live can0 -L", "tailbyte live: no option -L; did you mean -w?"),
        (
            "live can0 -tz",
            "tailbyte live: argument -t: z is none of a, ad, d, dd, e, r, u, ud; did you mean r?",
        ),
        (
            "-r flight.log -T fields -e can.id",
            "tailbyte: -r of which command? did you mean tailbyte decode -r flight.log -T fields -e can.id?",
        ),
        (
            "decode flight.log -q -z conv,can",
            "tailbyte decode: argument -z: 'conv,can' is what others call it; did you mean talkers?",
        ),
        (
            "stats flight.log -z io,stat,1",
            "tailbyte stats: argument -z: 'io,stat,1' is what others call it; did you mean io,1?",
        ),
        ("-V", "tailbyte: no option -V; did you mean tailbyte --version?"),
        (
            "--color never decode flight.log",
            "tailbyte: --color: options stand behind the command: tailbyte decode --color ... (see tailbyte --help)",
        ),
        ("--verson", "tailbyte: no option --verson; did you mean tailbyte --version?"),
        ("--hlep decode", "tailbyte: no option --hlep; did you mean tailbyte --help?"),
        ("--nonsense", "tailbyte: no option --nonsense in front of the command (see tailbyte --help)"),
        ("decode --arround 4 flight.log", "tailbyte decode: no option --arround; did you mean --around?"),
        ("decode --arround=4 flight.log", "tailbyte decode: no option --arround; did you mean --around?"),
        ("decode flight.log --json", "tailbyte decode: no option --json; did you mean -T json?"),
        ("decode flight.log --no-color", "tailbyte decode: no option --no-color; did you mean --color never?"),
        (
            "live can0 --since 5",
            "tailbyte live: --since is an option of tailbyte fleet, not of this command (see tailbyte live --help)",
        ),
        ("replay flight.log vcan0 -b 500000", "tailbyte replay: no option -b; did you mean --bitrate?"),
        ("simulate -o x.log --fautl A", "tailbyte simulate: no option --fautl; did you mean --fault?"),
        (
            "export flight.log -o x --html y",
            (
                "tailbyte export: --html is an option of tailbyte triage, check, diff, fleet, live, not of this "
                "command (see tailbyte export --help)"
            ),
        ),
        ("help check decode", "tailbyte help: decode is one argument too many (see tailbyte help --help)"),
        (
            "live can0 -b 1000000",
            "tailbyte live: argument -b: begins new files, as in dumpcap; did you mean --bitrate 1000000?",
        ),
        (
            "live can0 -b 500k",
            "tailbyte live: argument -b: begins new files, as in dumpcap; did you mean --bitrate 500000?",
        ),
        ("decode", "tailbyte decode: which capture? give a file, or - for standard input (see tailbyte decode --help)"),
        ("decode ''", "tailbyte: a capture without a name (an empty variable of the shell?)"),
        (
            "decode flight.log --to",
            "tailbyte decode: argument --to: needs a value (TIME) (see tailbyte decode --help)",
        ),
        (
            "decode flight.log -t",
            "tailbyte decode: argument -t: needs a value (a|ad|d|dd|e|r|u|ud) (see tailbyte decode --help)",
        ),
        (
            "decode flight.log -T jsn",
            "tailbyte decode: argument -T: jsn is none of text, fields, json, jsonl, csv; did you mean json?",
        ),
    ],
)
def test_what_is_said(command: Command, line: str, said: str) -> None:
    assert command(*shlex.split(line)) == (2, "", f"{said}\n")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("decode flight.log -n 5", "no option -n: nothing here is looked up by name; the first N rows are -c N"),
        ("decode -n flight.log", "no option -n: nothing here is looked up by name; the first N rows are -c N"),
        ("decode -nr flight.log", "no option -n: nothing here is looked up by name; the first N rows are -c N"),
        ("decode flight.log -N m", "no option -N: nothing here is looked up by name; the first N rows are -c N"),
        ("info flight.log -n", "no option -n: nothing here is looked up by name"),
        (
            "decode flight.log -f 'can id 5'",
            "no option -f: a capture filter is for a bus that runs; rows are chosen by -Y FILTER (tail -f: --follow)",
        ),
        (
            "info flight.log -f 'can id 5'",
            "no option -f: a capture filter is for a bus that runs; rows are chosen by -Y FILTER",
        ),
        ("decode flight.log -l", "no option -l: each line is written at once with --follow"),
        ("decode flight.log -C mine", "no option -C: there are no configuration profiles; every setting is an option"),
        ("decode flight.log -2 -Y can.id", "no option -2: a filter looks back and ahead by itself"),
        ("decode flight.log -S ----", "no option -S: for programs there are -T jsonl, json, csv and fields"),
        (
            "decode flight.log -o gui.x:1",
            "no option -o: there are no preferences; files are written by tailbyte convert and tailbyte export",
        ),
        ("decode flight.log -X lua_script:x", "no option -X: types of your own are --dissector DIR"),
        ("live can0 -I", "no option -I: there is no such mode on CAN: a controller receives everything"),
        ("live can0 -8", "no option -8: bytes are shown by -x"),
    ],
)
def test_what_is_done_otherwise_here(command: Command, line: str, said: str) -> None:
    words = shlex.split(line)
    assert command(*words) == (2, "", f"tailbyte {words[0]}: {said} (see tailbyte {words[0]} --help)\n")


@pytest.mark.parametrize(
    "line", [["\x1b[31m\n"], ["decode", "a", "--\x1b[31m"], ["decode", "a", "-T", "\x1b" * 900], ["--\n"]]
)
def test_what_was_typed_is_harmless_and_short(command: Command, line: list[str]) -> None:
    status, out, err = command(*line)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "\x1b" not in err
    assert len(err) < 500


def test_every_habit_leads_to_something_that_exists() -> None:
    parsers = every_command()
    options = {option for parser in parsers.values() for option in hints.options_of(parser)}
    assert {meant.split()[0] for row in habits.OPTIONS.values() for meant in row} <= options
    assert {needed for row in habits.TOLD.values() for needed, _ in row} - {""} <= options
    meant = {name.split()[0] for row in habits.COMMANDS.values() for name in row}
    assert meant <= {*COMMANDS, "--version"}
    assert not set(habits.COMMANDS) & set(COMMANDS)
