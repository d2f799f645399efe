"""The script for a shell, made from the parsers: what no kind of value is known for is left to its choices."""

from __future__ import annotations

from importlib.resources import files
from typing import TYPE_CHECKING

import shtab

from analyzer.cli.commands import COMMANDS, every_command, parser
from analyzer.cli.completion.names import names

if TYPE_CHECKING:
    import argparse

    from dissectors import Registry

# Kinds of values by what the help calls them, or by the option where it says too little.
_METAVARS = {
    "CAPTURE": "file_captures",
    "CATEGORY:SEVERITY": "gates",
    "FIELD": "fields",
    "FILTER": "filters",
    "GOOD BAD": "file_captures",
    "IFACE": "interfaces",
    "IFACE[,FILTER]": "interfaces",
    "NAME[,ARGS]": "statistics",
    "ORIGIN": "origins",
    "PATTERN": "terms",
    "RULE=P": "rules",
    "RULES": "rules",
    "RULE|SEVERITY": "rules",
    "RULE|WORD": "lexicon",
    "TOPIC": "topics",
    "TYPE,...": "types",
    "WHAT": "differences",
}
_OPTIONS = {
    "-Y": "filters",
    "--display-filter": "filters",
    "--fault": "rules",
    "--flight": "flights",
    "--scenario": "scenarios",
    "--table": "tables",
    "--interface": "drivers",
}
_FILES_AND_FOLDERS = {"files": shtab.FILE, "folders": shtab.DIRECTORY}
# Beginnings of words that stand for a file.
_FILES = ("FILE", "OUT", "OLD", "REPORT", "DIR|", "FLIGHT.bin", "STORE")


def script(shell: str, registry: Registry) -> str:
    """Return the script; raises what reading the types raises."""
    main = parser()
    for name, command in every_command(main).items():
        command.description = COMMANDS[name]
        for action in command._actions:  # noqa: SLF001 - argparse has no other way to ask
            if kind := _kind(action, command):
                action.complete = _FILES_AND_FOLDERS.get(kind) or _call(kind)  # type: ignore[attr-defined]
            if isinstance(action.metavar, str):
                action.metavar = action.metavar.replace(":", " ")  # zsh would read on from there
    text = str(shtab.complete(main, shell, root_prefix="tailbyte", preamble=_preamble(shell, registry)))
    # zsh is told that the first capture is the last one; "*:" stands for all of them.
    return text.replace('"(*)::', '"*:') if shell == "zsh" else text


def _call(kind: str) -> dict[str, str]:
    """Return how each shell calls the function of a kind."""
    name = f"_tailbyte_{kind}"
    return {"bash": name, "zsh": name, "fish": f"({name})"}


def _preamble(shell: str, registry: Registry) -> str:
    """Return the functions, and the names that they know."""
    assign = "set -g _tailbyte_names_{} '{}'" if shell == "fish" else "_tailbyte_names_{}='{}'"
    functions = files("analyzer").joinpath("cli", "completion", f"functions.{shell}").read_text("utf-8")
    return "\n".join([functions, *(assign.format(kind, " ".join(some)) for kind, some in names(registry).items())])


def _kind(action: argparse.Action, command: argparse.ArgumentParser) -> str:
    """Return what a value of this action is, "" where nobody can say."""
    if action.choices is not None or action.nargs == 0:
        return ""
    shown = action.metavar if isinstance(action.metavar, str) else ""
    for option in action.option_strings:
        if option in _OPTIONS and shown != "ID:MASK":
            return _OPTIONS[option]
    if shown in _METAVARS:
        both = shown == "CAPTURE" and "IFACE" in (command.usage or "")
        return "file_sources" if both else _METAVARS[shown]
    if shown == "DIR":
        return "folders"
    return "files" if shown.startswith(_FILES) else ""
