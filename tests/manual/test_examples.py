"""Every block of code in what people read is run as it stands there, or at least read by what would run it.

Commands that need a bus, a viewer or an end that does not come by itself are only parsed; `PARSED` says which and why.
What other programs do is not run, `FOREIGN` says which. Blocks of the kind `text` show a screen and are not compared.
Blocks that begin with the path of a file are recipes, which test_recipes.py follows, or the files of the vendor that
dissectors/README.md adds.
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import time
import tomllib
from collections import Counter
from dataclasses import asdict
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can.logconvert
import pytest
from can.io import logger, player
from kit.pages import PAGES, ROOT, Block, blocks, name_of, spans

import dissectors
from analyzer.cli import main
from analyzer.cli.commands import COMMANDS, parser
from analyzer.cli.usage.examples import EXAMPLES
from analyzer.rules.catalogue import load as rule_pages
from analyzer.rules.vehicle.expected import load as load_vehicle
from analyzer.views.colours.rules import colour_rules
from dissectors import picture

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from dissectors import Registry

PARSED = {
    r"\b(can|vcan)\d|slcan:|--interface pcan": "needs a SocketCAN interface or an adapter",
    r"udp_multicast:|\$BUS": "goes on until somebody ends it; test_terminals.py does",
    r"--follow": "waits for more",
    r"tailbyte view ": "needs a terminal; tests/browser has one",
    r"--with (0+42\.BIN|flight\.bin)": "needs the autopilot's log of the flight; tests/cli/test_events_with.py has one",
    r"completion bash --dissector": "the examples of the help do it",
    r"plot (captures/|flight\.log$)": "the page on plot draws it",
    r"tailbyte fleet (check|export|report|status)": "needs a store and a cluster; tests/fleet/test_check.py has them",
    r"live -D": "asks every driver there is; tests/live/test_listing.py does",
    r"plot .*--(serve|connect)": "needs a viewer or a browser; tests/plot/test_viewer.py has them",
}
FOREIGN = {
    "python3": "makes an environment: .ci/run does what the README says on a bare machine",
    ".venv/bin/pip": "as above",
    "sudo": "changes the machine",
    "ssh": "needs another machine",
    "candump": "needs a bus",
    "rerun": "opens a window; tests/integrations/test_rerun_importer.py asks its importer",
    "your-program": "is yours",
}
SHELL = ("mkdir", "echo")
HOVER = "captures/hover-4.log"
# The names that pages give to captures of somebody's own, and what they are here.
SAMPLES = {
    "healthy.log": HOVER,
    "flight.mcap": "captures/esc-failure.mcap",
    "right.mcap": "captures/esc-failure.mcap",
    "left.log": HOVER,
    "logs/monday.log": "captures/startup.log",
    "logs/tuesday.log": "captures/hover.log",
    "both.log": HOVER,
    "right.log": HOVER,
    "good.log": "captures/hover-4.log",
    "bad.log": "captures/pack-sag.log",
}
MADE = {"flight.log": ["captures/mission-8-faults.log", "--from", "2.0", "--to", "3.1"], "left.mcap": [HOVER]}


def test_every_page_is_there() -> None:
    assert len(PAGES) > 20
    assert {kind for page in PAGES for kind in (block.kind for block in blocks(page))} <= set(RUN) | {"text"}


class Reader:
    """Does what a page says, in an empty folder with the captures."""

    def __init__(self, capture: pytest.CaptureFixture[str], patch: pytest.MonkeyPatch) -> None:
        self._capture, self._patch = capture, patch
        self._names: dict[str, Any] = {}
        self.seen: Counter[str] = Counter()
        self.shown = ""

    def write(self, block: Block) -> None:
        """A file of the example: what follows on its name."""
        assert block.place is not None
        path = Path(block.place[0])
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(block.text.partition("\n")[2])

    def sh(self, block: Block) -> None:
        for line in block.lines():
            if "=" not in line.split()[0]:  # a name for what follows
                self.line(line)

    def line(self, line: str) -> None:
        parts = re.split(r""" (?:\||&&) (?=(?:[^'"]|'[^']*'|"[^"]*")*$)""", line)  # but not inside of quotes
        names = [shlex.split(part)[0] for part in parts]
        if all(name in SHELL for name in names):
            subprocess.run(line, shell=True, check=True)
            return
        for name, part in zip(names, parts, strict=True):
            if name in FOREIGN:
                self.seen["foreign"] += 1
            elif name == "can_logconvert":
                self._plug_in()
                self._patch.setattr(sys, "argv", shlex.split(part))
                can.logconvert.main()
            else:
                assert Path(name).name in ("tailbyte", "pytest"), line
                self.command(re.sub(r" > [^\s'\"]+$", "", part))

    def _plug_in(self) -> None:
        """Tells python-can what an installation announces."""
        points = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]
        tables = {"can.io.message_reader": player.MESSAGE_READERS, "can.io.message_writer": logger.MESSAGE_WRITERS}
        for group, table in tables.items():
            for suffix, value in points[group].items():
                self._patch.setitem(table, suffix, EntryPoint(suffix, value, group).load())

    def command(self, line: str) -> None:
        name, *args = shlex.split(line, comments=True)
        if name.endswith("pytest"):
            assert args == []
            return
        if any(re.search(pattern, line) for pattern in PARSED):
            parser().parse_args(args)
            self.seen["parsed"] += 1
            return
        # A page may show a capture that has faults.
        expected = (0, 1) if args[0] in ("check", "diff") else (0,)
        assert main(args) in expected, (line, self._capture.readouterr().err)
        self.seen["run"] += 1
        self._capture.readouterr()

    def console(self, block: Block) -> None:
        """Dots stand for what is left out: lines, if they are one, else part of a line."""
        first, _, shown = block.text.partition("\n")
        assert first.startswith("$ tailbyte ")
        self._capture.readouterr()
        main(shlex.split(first)[2:])
        pattern = re.escape(shown)
        pattern = re.sub(r"^\\.\\.\\.\\\n", r"(?:.*\n)*?", pattern, flags=re.MULTILINE).replace(r"\.\.\.", ".*")
        out = self._capture.readouterr().out
        assert re.match(pattern, out), f"{shown}\n--- but printed is\n{out}"
        self.seen["run"] += 1

    def python(self, block: Block) -> None:
        self._capture.readouterr()
        exec(block.text, self._names)
        self.shown = self._capture.readouterr().out
        assert self.shown.strip()

    def toml(self, block: Block) -> None:
        """A vehicle file, or how a folder's tables are shown."""
        path = Path("example.toml")
        path.write_text(block.text)
        found = tomllib.loads(block.text)
        registry = dissectors.load()
        if "quantity" in found:
            folder = Path("acme")
            (folder / "20900.Pump.uavcan").write_text("uint16 pressure\nuint8 number\nuint8 serial\nfloat16 wanted\n"
                                                      "float16 flow\nuint8 mode\n")  # fmt: skip
            shutil.copy(path, folder / picture.FILE)
            registry = dissectors.load([folder])
            plot = picture.load(registry).plots[registry.resolve("Pump").table]
            assert {line.quantity for line in plot.lines} == {"pressure", "flow"}
        elif "colour" in found:
            assert len(colour_rules(str(path), registry)) > len(found["colour"])
        else:
            load_vehicle(path, rule_pages(registry), registry)
            named = re.match(r"# ([\w-]+\.toml)\n", block.text)
            shutil.copy(path, named[1] if named else "vehicle.toml")

    def yaml(self, block: Block) -> None:
        """Only the commands: no reader of YAML is among the dependencies."""
        for command in re.findall(r"(?:^|[ /])(tailbyte (?:.+\n)(?: +--.*\n)*)", block.text):
            self.command(" ".join(command.split()))
            self.seen["yaml"] += 1


RUN: dict[str, Callable[[Reader, Block], None]] = {
    "sh": Reader.sh,
    "console": Reader.console,
    "python": Reader.python,
    "toml": Reader.toml,
    "yaml": Reader.yaml,
}


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("samples")
    shutil.copytree(ROOT / "captures", folder / "captures", ignore=shutil.ignore_patterns("*.expected"))
    (folder / "logs").mkdir()
    for name, of in SAMPLES.items():
        shutil.copy(folder / of, folder / name)  # a page may write over it
    for name, (of, *window) in MADE.items():
        assert main(["convert", str(folder / of), *window, str(folder / name)]) == 0
    return folder


load_types = dissectors.load
built_in = cache(load_types)


def types(folders: Sequence[Path] = (), trusted: Sequence[Path] = ()) -> Registry:
    """Those that come with the program are read once for all commands."""
    return load_types(folders, trusted) if folders else built_in()


@pytest.fixture
def reader(
    samples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Iterator[Reader]:
    shutil.copytree(samples, tmp_path, symlinks=True, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(dissectors, "load", types)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    yield Reader(capsys, monkeypatch)
    time.tzset()


@pytest.mark.proof
@pytest.mark.sampled(25)
@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_a_page_does_what_it_says(reader: Reader, page: Path) -> None:
    for block in blocks(page):
        if block.place is not None and page.parent.name == "dissectors":
            reader.write(block)
        elif block.kind != "text" and block.place is None:
            RUN[block.kind](reader, block)
    assert reader.seen["yaml"] == (2 if page.name == "ci.md" else 0)
    if page.name == "simulate.md":
        shown = reader.shown.splitlines()
        assert [line.split()[0] for line in shown[::3]] == ["TRF-003", "TYP-305"]
        assert all(line.startswith("    (17734753") for line in shown[2::3])


@pytest.mark.proof
@pytest.mark.sampled(4)
@pytest.mark.parametrize("command", EXAMPLES)
def test_the_examples_of_help_do_what_they_say(reader: Reader, command: str) -> None:
    folder = Path("acme")
    folder.mkdir()
    (folder / "20900.Pump.uavcan").write_text("uint16 pressure\n")
    for line, _ in EXAMPLES[command]:
        inner = re.search(r"\$\((.*)\)", line)  # what a shell would run of eval "$(...)"
        reader.line(re.sub(r" (> \S+|\| source)$", "", inner[1] if inner else line))


def test_more_is_run_than_only_parsed() -> None:
    lines = [line for page in PAGES for block in blocks(page) if block.kind == "sh" for line in block.lines()]
    commands = [line for line in lines if line.startswith("tailbyte")]
    parsed = [line for line in commands if any(re.search(pattern, line) for pattern in PARSED)]
    assert len(commands) - len(parsed) > 40
    for name in re.findall(r"tests/[\w/.]+\.py", " ".join([*PARSED.values(), *FOREIGN.values()])):
        assert (ROOT / name).exists(), name
    for pattern in PARSED:
        assert any(re.search(pattern, line) for line in parsed), f"nothing needs {pattern}"


@cache
def every_option() -> set[str]:
    """The options of all commands."""
    (commands,) = parser()._subparsers._group_actions
    for command in commands.choices.values():
        command.fill()
    return {option for command in commands.choices.values() for option in command._option_string_actions}


RECIPE_OPTIONS = {"--tap"}  # of the report that a recipe adds
TEST_OPTIONS = {
    "--all-examples",
    "--first",
    "--seed",
    "--share",
    "--rules",
    "--judge",
    "--jobs",
    "--sample",
    "--turn",
}  # of what tests/README.md runs
FOREIGN_SPANS = ("python", "pytest", "cargo", "sudo", "pip", "candump", "can_viewer", "...")


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_commands_among_the_words_exist(page: Path) -> None:
    """Whole commands are parsed; of the others the options are looked up."""
    for span in spans(page):
        words = span.split()
        if words[0] in FOREIGN_SPANS or span == "tailbyte --help":
            continue
        for option in re.findall(r"(?<![\w-])--[a-z][a-z-]+", span):
            assert option in every_option() | RECIPE_OPTIONS | TEST_OPTIONS | {"--version"}, span
        command = words[1] if words[0] == "tailbyte" and len(words) > 1 else words[0]
        if words[0] == "tailbyte" and len(words) > 1 and command.islower():
            if "." in command:  # a capture alone is triage
                continue
            assert command in COMMANDS, span
            if words[2:] and "--help" not in words and not re.fullmatch("-T|--?|--around", words[-1]):
                parser().parse_args(shlex.split(span.partition(" > ")[0])[1:])


def test_the_vehicle_file_shows_every_key(tmp_path: Path) -> None:
    (text,) = [block.text for block in blocks(ROOT / "analyzer/manual/vehicle.md") if block.kind == "toml"]
    path = tmp_path / "vehicle.toml"
    path.write_text(text)
    registry = dissectors.load()
    vehicle = load_vehicle(path, rule_pages(registry), registry)
    parts = [asdict(vehicle), asdict(vehicle.nodes[11]), asdict(vehicle.excuses[0]), asdict(vehicle.demand)]
    assert all(value not in (None, "", (), {}) for part in parts for value in part.values())
