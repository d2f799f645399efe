"""Man pages: true to the manual and the options, accepted by groff and `man`, where an installation puts them."""

from __future__ import annotations

import shutil
import subprocess
import tomllib

import pytest
from bench import man_pages
from bench.roff import Page, escape
from kit.command import environment
from kit.pages import MANUAL, ROOT

from analyzer.cli.commands import COMMANDS

PAGES = man_pages.pages()
ANEW = "not what the sources say: run python tests/bench/man_pages.py"


def test_they_are_true() -> None:
    there = {f"{path.parent.name}/{path.name}": path.read_text() for path in man_pages.TARGET.glob("man*/*")}
    assert sorted(there) == sorted(PAGES), ANEW
    assert [name for name, text in PAGES.items() if there[name] != text] == [], ANEW


def test_every_command_and_every_page_of_the_manual_has_one() -> None:
    topics = {path.stem for path in MANUAL.glob("*.md")} - {"README"}
    assert set(PAGES) == {
        "man1/tailbyte.1",
        *(f"man1/tailbyte-{name}.1" for name in COMMANDS),
        *(f"man7/tailbyte-{name}.7" for name in topics - set(COMMANDS)),
    }


def test_the_wheel_takes_them() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["maturin"]
    assert (ROOT / settings["data"] / "data/share/man").resolve() == man_pages.TARGET.resolve()


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("groff") is None, reason="groff is not installed")
def test_groff_has_nothing_to_say_and_a_terminal_holds_every_line() -> None:
    plain = ["-P-c", "-P-b", "-P-o", "-P-u"]
    command = ["groff", "-K", "utf8", "-t", "-man", "-ww", "-r", "LL=80n", *plain, "-T", "utf8"]
    for name in PAGES:
        # Each as it is read: several in one run share a sheet of paper, on which the last table may not fit.
        done = subprocess.run([*command, man_pages.TARGET / name], capture_output=True, encoding="utf-8", check=True)
        assert (name, done.stderr) == (name, "")
        assert [line for line in done.stdout.splitlines() if len(line) > 80] == [], name


@pytest.mark.skipif(shutil.which("man") is None, reason="man is not installed")
def test_man_shows_options_code_and_links() -> None:
    path = man_pages.TARGET / "man1/tailbyte-check.1"
    env = environment({"MANWIDTH": "80", "LC_ALL": "C.UTF-8", "MANPAGER": "cat"})
    shown = subprocess.run(["man", "-l", str(path)], env=env, capture_output=True, text=True, check=True).stdout
    assert "tailbyte-check - judge captures by all rules of the protocol" in shown
    assert "\n       --fail-on CATEGORY:SEVERITY\n" in shown
    assert "\nEXIT STATUS\n" in shown
    assert "tailbyte check flight.log --html report.html" in shown
    assert "tailbyte-rules(7)" in shown
    assert "**" not in shown


def test_a_page_of_everything() -> None:
    text = """\
# title: left out

A `--flag`, a **word**, *another*, a [page](check.md), [it](check.md#part), [far](https://a.b/c-d) and back\\\\slash.
.not a request

## Part

* one
* two

  more of it

1. first

| a | b |
|---|---|
| `x` | y |

| a | b | c |
|---|---|---|
| 1 | 2 | 3 |

```sh
it's -a
.b
```
"""
    (title, intro), (part, body) = Page(lambda page: f"<{page}>").sections(text)
    assert (title, part) == ("", "Part")
    assert intro == [
        ".PP",
        (
            "A \\fB\\%\\-\\-flag\\fR, a \\fBword\\fR, \\fIanother\\fR, a page (<check>), it (<check>), "
            "far <https://a.b/c\\-d> and back\\eslash.\n\\&.not a request"
        ),
    ]
    assert body == [
        ".IP \\(bu 2", "one", ".IP \\(bu 2", "two", ".IP", "more of it", ".IP 1. 4", "first",
        ".TP", "\\fB\\%x\\fR", "y", ".PP", ".PP", ".TS", "lb lb lb", "l l l.", "a\tb\tc", "1\t2\t3", ".TE",
        ".PP", ".RS 2", ".EX", "it\\(aqs \\-a\n\\&.b", ".EE", ".RE",
    ]  # fmt: skip
    assert escape("a-b") == "a-b"
