"""Completion in real shells: each is given the script and asked what a line may go on with."""

from __future__ import annotations

import re
import shutil
import subprocess
from shlex import quote
from typing import TYPE_CHECKING

import pytest
from kit.command import LIMIT, environment

import dissectors
from analyzer.cli import decode
from analyzer.cli.commands import COMMANDS, every_command
from analyzer.cli.completion import SHELLS
from analyzer.cli.completion.names import names
from analyzer.cli.completion.script import _FILES_AND_FOLDERS, _kind, script
from analyzer.views.fields import find
from dissectors.keys.pages import SEVERITIES

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

# Programs of each shell that read lines and write what each may go on with, and then "=".
ASK = {
    "bash": """
        source $SCRIPT/_tailbyte
        while IFS= read -r line; do
            eval "COMP_WORDS=($line)"; COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _shtab_tailbyte 2> /dev/null
            printf '%s\n' "${COMPREPLY[@]}" =
        done
    """,
    "fish": """
        source $SCRIPT/_tailbyte
        while read line; complete -C "$line"; echo =; end
    """,
    # What would be shown is written between < and >, by a `compadd` of our own, in a shell at a terminal of its own.
    "zsh": r"""
        zmodload zsh/zpty
        zpty z zsh -f -i
        say() { zpty -w z $1 }
        say "unsetopt prompt_cr prompt_sp; setopt no_beep; cd ${(q)PWD}"
        say "fpath=(${(q)SCRIPT} \$fpath); autoload -Uz compinit; compinit -u -d dump; bindkey '^I' complete-word"
        say "zstyle ':completion:*' insert-tab false"
        say "compadd() { local -a got; [[ \${@[(I)-[OAD]]} -gt 0 ]] ||
            { builtin compadd -A got \"\$@\"; print -lr -- \"<\"\${^got}\">\" }; builtin compadd \"\$@\" }"
        say "PS1=REA''DY"  # and not before it is shown does the line editor take keys
        zpty -r z out "*READY*"
        while IFS= read -r line; do
            zpty -w -n z "$line"$'\t'
            zpty -w -n z $'\x15'"echo DO''NE"$'\n'
            zpty -r z out "*DONE*READY*"
            print -r -- "$out"
            print =
        done
    """,
}
OPTIONS = {"bash": ("--norc",), "fish": ("--no-config",), "zsh": ("-f",)}


@pytest.fixture(scope="module")
def scripts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for each shell, with its script; an interface is there, and a filter."""
    folder = tmp_path_factory.mktemp("scripts")
    usual = decode.add

    def add(parser: argparse.ArgumentParser) -> None:
        usual(parser)
        if "-Y" not in parser._option_string_actions:
            parser.add_argument("-Y", metavar="FILTER", help="rows that it is true of")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(decode, "add", add)
        for shell in SHELLS:
            (folder / shell).mkdir()
            text = script(shell, dissectors.load()).replace("/sys/class/net", str(folder / "net"))
            (folder / shell / "_tailbyte").write_text(text)
    for name, kind in (("can7", 280), ("lo", 772)):
        (folder / "net" / name).mkdir(parents=True)
        (folder / "net" / name / "type").write_text(f"{kind}\n")
    return folder


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("flight.log", "other.mcap", "old.log.gz", "notes.md"):
        (tmp_path / name).touch()
    (tmp_path / "logs").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def completed(shell: str, scripts: Path, *lines: str) -> list[set[str]]:
    """What a shell offers for each line; zsh only what is new of a word that consists of parts."""
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    asked = [f"{line}''" if shell == "bash" and line.endswith(" ") else line for line in lines]
    env = environment({"SCRIPT": str(scripts / shell), "TERM": "xterm"})
    done = subprocess.run(
        [shell, *OPTIONS[shell], "-c", ASK[shell]],
        input="".join(f"{line}\n" for line in asked),
        env=env, stdout=subprocess.PIPE, text=True, timeout=LIMIT, check=False,
    )  # fmt: skip
    answers = re.split(r"^=\n", done.stdout, flags=re.MULTILINE)[:-1]
    assert len(answers) == len(lines), done.stdout
    shown = re.compile(r"<([^<>\r\n]*)>" if shell == "zsh" else r"^([^\t\n]+)", re.MULTILINE)
    return [{one.rstrip("/") for one in shown.findall(answer)} for answer in answers]


OFFERED = {
    "tailbyte ": set(COMMANDS),
    "tailbyte de": {"decode"},
    "tailbyte decode --ar": {"--around"},
    "tailbyte decode flight.log --fo": {"--foreign", "--follow"},
    "tailbyte decode -T j": {"json", "jsonl"},
    "tailbyte decode flight.log -V -t u": {"u", "ud"},
    "tailbyte decode -e ESCStatus.vol": {"ESCStatus.voltage"},
    "tailbyte decode -Y ESCStatus.vol": {"ESCStatus.voltage"},
    "tailbyte decode -Y MotorStatus.sp": {"MotorStatus.speed"},
    "tailbyte decode -O ESC": {"ESCStatus"},
    "tailbyte decode -O ESCStatus,RawC": {"ESCStatus,RawCommand"},
    "tailbyte check --select CAN,TRF-01": {f"CAN,TRF-01{k}" for k in range(10)},
    "tailbyte help exi": {"exit-status"},
    "tailbyte info o": {"other.mcap", "old.log.gz"},
    "tailbyte info flight.log o": {"other.mcap", "old.log.gz"},
    "tailbyte info n": {"notes.md"},
    "tailbyte live ca": {"can7"},
    "tailbyte replay flight.log c": {"can7"},
    "tailbyte explain ESC": {"ESCStatus"},
    "tailbyte simulate --flight m": {"mission"},
    "tailbyte simulate --scenario esc-f": {"esc-failure"},
    "tailbyte simulate --fault TRF-003": {"TRF-003"},
    "tailbyte export --table PUSHCAN.M": {"PUSHCAN.MotorStatus"},
    "tailbyte decode --dissector l": {"logs"},
    "tailbyte completion z": {"zsh"},
    "tailbyte stats va": {"values"},
    "tailbyte stats values,ESCStatus.vol": {"values,ESCStatus.voltage"},
    "tailbyte decode -z io,1,ESCStatus.vol": {"io,1,ESCStatus.voltage"},
    "tailbyte decode -z talkers,ESC": set(),
    "tailbyte check --fail-on protocol:error,any": {f"protocol:error,any:{one}" for one in SEVERITIES},
    "tailbyte diff --fail-on any,par": {"any,parameter"},
}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("shell", SHELLS)
def test_what_a_line_goes_on_with(scripts: Path, shell: str) -> None:
    found = dict(zip(OFFERED, completed(shell, scripts, *OFFERED), strict=True))
    if shell == "zsh":  # of dots and commas, only the last part
        parts = re.compile(r" (-e|-Y|-O|-z|stats|--select|--fail-on) ")
        last = re.compile(r".*[.,](?=[^.,]+$)")
        expected = {k: {last.sub("", one) for one in v} if parts.search(k) else v for k, v in OFFERED.items()}
        found = {k: {last.sub("", one) for one in v} if parts.search(k) else v for k, v in found.items()}
        assert found == expected
    else:
        assert found == OFFERED


@pytest.mark.parametrize(
    ("word", "first"),
    [
        ("'dronecan.src == 11 && ESCStatus.vol", "dronecan.src == 11 && ESCStatus.voltage"),
        ("ESCStatus.cu", "ESCStatus.current"),
        ("'ESCStatus.mode == \"er", 'ESCStatus.mode == "error"'),
        ("'node == 12 and ESCStatus.status.mode != soft", 'node == 12 and ESCStatus.status.mode != "soft start"'),
        ("'MotorStatus.system_status==f", 'MotorStatus.system_status=="fault"'),
        ('\'dronecan.status in {"open", "bad', 'dronecan.status in {"open", "bad crc"'),
        ("'finding.rule == \"TRF-010", 'finding.rule == "TRF-010"'),
        ("'dronecan.type eq ESC", 'dronecan.type eq "ESCStatus"'),
        ('\'ESCStatus.mode == "error" && ESCStatus.vol', 'ESCStatus.mode == "error" && ESCStatus.voltage'),
    ],
)
def test_the_last_name_of_a_filter(scripts: Path, word: str, first: str) -> None:
    call = f"source {scripts / 'bash' / '_tailbyte'}; _tailbyte_filters {quote(word)}"
    assert subprocess.check_output(["bash", "--norc", "-c", call], text=True).splitlines() == [first]


VALUES = {
    "tailbyte decode -Y 'ESCStatus.mode == \"er": 'ESCStatus.mode == "error"',
    'tailbyte decode -Y \'dronecan.status in {"open", "bad': 'dronecan.status in {"open", "bad crc"',
    "tailbyte decode -Y 'node == 12 && ESCStatus.vol": "node == 12 && ESCStatus.voltage",
}


@pytest.mark.parametrize("shell", ["fish", "zsh"])
def test_values_inside_a_filter(scripts: Path, shell: str) -> None:
    """What bash does with them is asked of its function: quotes that are still open are none of its words here."""
    found = completed(shell, scripts, *VALUES)
    if shell == "zsh":  # only what is new
        assert found == [{'"error"'}, {'"bad crc"'}, {"voltage"}]
    else:
        assert [{one.lstrip("'") for one in some} for some in found] == [{one} for one in VALUES.values()]


def test_bash_goes_through_names_part_by_part(scripts: Path) -> None:
    every, inside = completed("bash", scripts, "tailbyte decode -e ", "tailbyte decode -e ESCS")
    assert {"dronecan.", "ESCStatus.", "can.", "frame."} <= every
    assert "ESCStatus.voltage" in inside - every


def test_every_name_is_one_that_the_commands_take() -> None:
    registry = dissectors.load()
    known = names(registry)
    for field in known["fields"]:
        if field.partition(".")[0] not in ("frame", "can", "dronecan", "payload"):
            find(registry, field)
    for one in known["types"]:
        registry.table(one)
    assert len(set(known["types"])) == len(registry.names())


def test_what_has_no_kind_is_a_number_a_time_or_a_text_of_ones_own() -> None:
    """A new option with another word for a file, a field or the like fails here: say in script.py what it takes."""
    shown = {
        action.metavar
        for command in every_command().values()
        for action in command._actions
        if action.metavar and action.nargs != 0 and not action.choices and not _kind(action, command)
    }
    assert shown <= {
        "10s", "A-B", "ADDRESS", "BITS", "CAPTURES", "CHANNEL", "CMD", "COND", "FRAME|TIME", "FRAME|TIME[+-1s]", "HZ",
        "ID:MASK", "K", "KEY=VALUE", "KIND=N", "N", "NAME", "NAMES", "NAME=WHAT", "NODE=CHOICE", "S", "SIZE", "TIME",
        "URL", "WHEN", "X",
    }  # fmt: skip
    assert set(_FILES_AND_FOLDERS) <= {_kind(a, c) for c in every_command().values() for a in c._actions}


def test_the_command(command: Command) -> None:
    status, out, err = command("completion", "bash")
    assert (status, err) == (0, "")
    assert out.rstrip().endswith("tailbyte")
    status, out, err = command("completion")
    assert (status, out) == (2, "")
    assert err == "tailbyte completion: which shell? tailbyte completion bash, zsh or fish\n"
    assert "did you mean zsh?" in command("completion", "zhs")[2]


def test_types_of_ones_own(tmp_path: Path, command: Command) -> None:
    (tmp_path / "20900.Pump.uavcan").write_text("uint16 pressure\n")
    out = command("completion", "fish", "--dissector", tmp_path)[1]
    assert "Pump.pressure" in out
