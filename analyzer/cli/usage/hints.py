"""Hints for somebody who names a command or an option that does not exist."""

from __future__ import annotations

import argparse
import os
import re
from shlex import quote
from typing import TYPE_CHECKING

from analyzer.cli.usage.habits import COMMANDS, INSTEAD, OPTIONS, TOLD, VALUES

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

_INTERFACE = re.compile(r"(v?x?can|slcan|can-?usb)\d+(@\d+)?|(slcan|pcan|virtual|udp_multicast|kvaser|vector):\S+")
_LONGEST = 60
_CLOSE = 0.65


def command(word: str, others: Sequence[str], commands: Iterable[str]) -> str:
    """Return why there is no such command, and what to type instead.

    Args:
        word: what stands where the command should.
        others: the words around it.
        commands: the names there are.
    """
    names = list(commands)
    shown = quote(word)
    if os.path.lexists(word):
        return _file(word, next((one for one in others if one in names), None))
    if _INTERFACE.fullmatch(word):
        return f"{shown} is an interface: did you mean tailbyte live {shown}?"
    habit = next((name for name in COMMANDS.get(word.lower(), ()) if name.split()[0] in (*names, "--version")), None)
    near = [habit] if habit else _near(word.lower(), names)
    if near:
        return f"no command {_short(word)}; did you mean {' or '.join(f'tailbyte {name}' for name in near)}?"
    if os.sep in word or "." in word:
        return f"{shown}: no such file, and no command"
    return f"no command {_short(word)}"


def _file(path: str, named: str | None) -> str:
    name = quote(path)
    if os.path.isdir(path):  # noqa: PTH112 - any bytes
        return f"{name} is a folder: did you mean tailbyte info {name.rstrip('/')}/*?"
    return f"the command comes first: did you mean tailbyte {named} {name}?"


def before_command(option: str, others: Sequence[str], parsers: Mapping[str, argparse.ArgumentParser]) -> str:
    """Return what to type instead of an option in front of the command."""
    plain = option.lstrip("-").lower()
    if plain in ("v", "version", "help", "?") and not others:
        return f"no option {option}; did you mean tailbyte --{'help' if plain in ('help', '?') else 'version'}?"
    having = [name for name, parser in parsers.items() if option.partition("=")[0] in options_of(parser)]
    if (near := _near(plain, ["--help", "--version"])) and not having:
        return f"no option {_short(option)}; did you mean tailbyte {near[0]}?"
    if option in INSTEAD and not having[1:]:
        return f"no option {option}; did you mean tailbyte {INSTEAD[option]}?"
    named = next((one for one in others if one in parsers and (not having or one in having)), None)
    if named is not None:
        return f"{_short(option)}: options stand behind the command: tailbyte {named} {quote(option[:_LONGEST])} ..."
    if having:
        return _of_which(option, having[0], [option, *others])
    return f"no option {_short(option)} in front of the command"


def _of_which(option: str, command: str, words: Sequence[str]) -> str:
    shown = list(words) if sum(map(len, words[1:])) < _LONGEST else [*words[:3], "..."]
    said = " ".join(one if one == "..." else quote(one[:_LONGEST]) for one in shown)
    return f"{_short(option)} of which command? did you mean tailbyte {command} {said}?"


def option(
    word: str, parser: argparse.ArgumentParser, parsers: Mapping[str, argparse.ArgumentParser],
    typed: Sequence[str] = (),
) -> str:  # fmt: skip
    """Return why a command has no such option, and what to type instead; `typed` are all words if it was not named."""
    name = word.partition("=")[0]
    known = options_of(parser)
    if not word.startswith("-") or word == "-":
        return f"{_short(word)} is one argument too many"
    if len(name) > 2 and name[1] != "-" and f"-{name[2]}" in (*known, *TOLD):  # letters in a row
        name = name[:2]
    if otherwise := _otherwise(name, known):
        return f"no option {_short(name)}{otherwise}"
    near = _near(name, [one for one in known if one.startswith("--")])
    having = [other for other, one in parsers.items() if name in options_of(one)]
    if near and not having:
        return f"no option {_short(name)}; did you mean {' or '.join(near)}?"
    if having and typed:
        return _of_which(name, having[0], typed)
    if having:
        return f"{_short(name)} is an option of tailbyte {', '.join(having)}, not of this command"
    return f"no option {_short(name)}"


def _otherwise(name: str, known: Sequence[str]) -> str:
    """Return what hands that know an option from elsewhere find here instead, "" for one that nobody has."""
    for meant in OPTIONS.get(name, ()):
        if meant.split()[0] in known:
            return f"; did you mean {meant}?"
    for needed, told in TOLD.get(name, ()):
        if not needed or needed in known:
            return f": {told}"
    return f"; did you mean tailbyte {INSTEAD[name]}?" if name in INSTEAD else ""


def choice(value: object, choices: Iterable[object]) -> str:
    """Return why an option does not take a value, and which ones it takes."""
    names = [str(one) for one in choices]
    near = [name for name in VALUES.get(str(value).lower(), ()) if name in names] or _near(str(value).lower(), names)
    hint = f"; did you mean {near[0]}?" if near else ""
    return f"{_short(str(value))} is none of {', '.join(names)}{hint}"


def missing(action: argparse.Action) -> str:
    """Return what an option is to be given."""
    values = action.metavar or ", ".join(map(str, action.choices or [action.dest]))
    return f"needs a value ({values})"


def options_of(parser: argparse.ArgumentParser) -> list[str]:
    """Return the options of a command that its help shows."""
    return list(_shown(parser))


def _shown(parser: argparse.ArgumentParser) -> Iterator[str]:
    for action in parser._actions:  # noqa: SLF001 - argparse has no other way to ask
        if action.help != argparse.SUPPRESS:
            yield from action.option_strings


def _near(word: str, names: Sequence[str]) -> list[str]:
    """Return names that are nearly the word, or begin with it."""
    from difflib import get_close_matches  # noqa: PLC0415 - only those who slip wait for it

    bare = {name.lstrip("-"): name for name in names}
    word = word.lstrip("-")
    begun = [name for name in bare if len(word) > 1 and name.startswith(word)]
    return [bare[name] for name in begun[:2] or get_close_matches(word, bare, n=1, cutoff=_CLOSE)]


def _short(word: str) -> str:
    return quote(word) if len(word) <= _LONGEST else quote(word[:_LONGEST] + "...")
