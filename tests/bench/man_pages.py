"""Write the man pages anew, from the manual and the options of every command: python tests/bench/man_pages.py

They are in analyzer/installed, and the wheel puts them into share/man. A test compares them with what this program
makes of the sources, so that they are true.
"""

from __future__ import annotations

import argparse
import re
import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS), str(TESTS.parent)]

from bench.roff import Page, as_it_is, bold, escape  # noqa: E402

from analyzer.cli.commands import COMMANDS, Parser, every_command, parser  # noqa: E402
from analyzer.cli.help import topics  # noqa: E402
from analyzer.cli.usage.examples import EXAMPLES, Example  # noqa: E402

ROOT = TESTS.parent
MANUAL = ROOT / "analyzer/manual"
TARGET = ROOT / "analyzer/installed/data/share/man"


def pages() -> dict[str, str]:
    """Return each man page by its path below `TARGET`."""
    commands = every_command()
    found = {"man1/tailbyte.1": _main(parser())}
    for name, command in commands.items():
        found[f"man1/tailbyte-{name}.1"] = _command(name, command)
    for topic in topics():
        if topic not in COMMANDS:
            found[f"man7/tailbyte-{topic}.7"] = _topic(topic)
    return found


def reference(page: str) -> str:
    """Return how to read on in a page of the manual."""
    if page == "README":
        return "\\fBtailbyte\\fR(1)"
    return f"{bold(f'tailbyte-{page}')}({1 if page in COMMANDS else 7})"


def _head(name: str, section: int) -> list[str]:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    return [
        "'\\\" t -*- coding: UTF-8 -*-",
        '.\\" made by tests/bench/man_pages.py of the manual and the options of the commands',
        f'.TH {name.upper()} {section} "" "tailbyte {version}" "tailbyte"',
        ".nh",
        ".ad l",
    ]


def _text(lines: list[str]) -> str:
    return "".join(f"{line}\n" for line in lines)


def _main(main: Parser) -> str:
    sections = Page(reference).sections((MANUAL / "README.md").read_text())
    lines = [
        *_head("tailbyte", 1),
        ".SH NAME",
        "tailbyte \\- bus analyzer and log decoder for DroneCAN and TM\\-UAVCAN",
    ]
    lines += [".SH SYNOPSIS", f"{bold('tailbyte')} \\fICOMMAND\\fR ..."]
    lines += [".SH DESCRIPTION", escape(str(main.description))]
    lines += [".SH COMMANDS"]
    for name, about in COMMANDS.items():
        lines += [".TP", reference(name), escape(about)]
    lines += [".SH OPTIONS", *_options(main)]
    lines += [".SH MANUAL"]
    for title, body in sections[1:]:
        lines += [f".SS {title}", *body]
    lines += _notes(main.epilog)
    lines += _examples(EXAMPLES[""])
    return _text(lines)


def _command(name: str, command: Parser) -> str:
    path = MANUAL / f"{name}.md"
    sections = Page(reference).sections(path.read_text()) if path.exists() else [("", [])]
    about = str(command.description).partition(": ")[2]
    intro = sections[0][1] or [".PP", escape(about[:1].upper() + about[1:])]
    lines = [*_head(f"tailbyte-{name}", 1), ".SH NAME", f"tailbyte\\-{name} \\- {escape(COMMANDS[name])}"]
    usage = (command.usage or "%(prog)s [options]") % {"prog": command.prog}
    lines += [".SH SYNOPSIS", bold(command.prog) + escape(usage.removeprefix(command.prog), literal=True)]
    lines += [".SH DESCRIPTION", *intro, ".SH OPTIONS", *_options(command)]
    for title, body in sections[1:]:
        lines += [f".SH {title}", *body]
    lines += _notes(command.epilog)
    lines += _examples(EXAMPLES.get(name, ()))
    see = ["README", *(["rules"] if name in ("check", "explain") else [])]
    lines += [".SH SEE ALSO", ",\n".join(map(reference, see))]
    return _text(lines)


def _topic(topic: str) -> str:
    text = (MANUAL / f"{topic}.md").read_text()
    (title,) = re.findall(
        rf"^\| \[{topic}\]\({topic}\.md\) \| (.*) \|$", (MANUAL / "README.md").read_text(), re.MULTILINE
    )
    title = title.replace("`", "")
    sections = Page(reference).sections(text)
    lines = [*_head(f"tailbyte-{topic}", 7), ".SH NAME", f"tailbyte\\-{topic} \\- {escape(title)}"]
    lines += [".SH DESCRIPTION", *sections[0][1]]
    for title, body in sections[1:]:
        lines += [f".SH {title}", *body]
    return _text([*lines, ".SH SEE ALSO", reference("README")])


def _options(command: argparse.ArgumentParser) -> Iterator[str]:
    for group in command._action_groups:
        actions = [one for one in group._group_actions if one.help != argparse.SUPPRESS and _shown(one)]
        if not actions:
            continue
        if group.title not in ("positional arguments", "options"):
            yield f".SS {escape(group.title or '')}"
            if group.description:
                yield escape(group.description)
        for action in actions:
            yield from (
                ".TP",
                _heading(action),
                escape(str(action.help) % {"prog": command.prog} if action.help else ""),
            )


def _shown(action: argparse.Action) -> bool:
    return not isinstance(action, argparse._SubParsersAction)


def _heading(action: argparse.Action) -> str:
    value = action.metavar if isinstance(action.metavar, str) else action.dest
    if action.choices is not None and action.metavar is None:
        value = "|".join(map(str, action.choices))
    value = f"\\fI{escape(value, literal=True)}\\fR"
    if not action.option_strings:
        return value
    if action.nargs == 0:
        value = ""
    elif action.nargs == "?":
        value = f" [{value}]"
    else:
        value = f" {value}" + (" ..." if action.nargs in ("+", "*") else "")
    return ", ".join(bold(option) + value for option in action.option_strings)


def _notes(epilog: str | None) -> Iterator[str]:
    """Yield what stands below the options; what it says of the exit status has a section of its own."""
    parts = [part for part in (epilog or "").split("\n\n") if part]
    notes = [part for part in parts if not part.startswith("exit status: ")]
    if notes:
        yield ".SH NOTES"
        for part in notes:
            literal = part.startswith(" ") or "\n " in part
            yield from as_it_is(part, 0) if literal else (".PP", escape(part))
    for part in parts:
        if part.startswith("exit status: "):
            yield from (".SH EXIT STATUS", escape(part.removeprefix("exit status: ")))


def _examples(lines: tuple[Example, ...]) -> Iterator[str]:
    if lines:
        yield ".SH EXAMPLES"
    for line, about in lines:
        yield from (".TP", bold(line), escape(about))


def main() -> int:
    """Write all of them, and remove those whose command or page is gone."""
    wanted = pages()
    for path in TARGET.glob("man*/*"):
        if f"{path.parent.name}/{path.name}" not in wanted:
            path.unlink()
    for name, text in wanted.items():
        (TARGET / name).parent.mkdir(parents=True, exist_ok=True)
        (TARGET / name).write_text(text, "utf-8")
    sys.stdout.write(f"{len(wanted)} pages written to {TARGET.relative_to(ROOT)}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
