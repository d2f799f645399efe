"""The command explain: pages, the list, the document, and rules that there are not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit.judged import registry

from analyzer.rules.catalogue import LAYERS, load
from analyzer.views.terminal import display_width

if TYPE_CHECKING:
    from collections.abc import Callable

    Command = Callable[..., tuple[int, str, str]]


def test_a_page(command: Command) -> None:
    status, out, err = command("explain", "trf-010")
    assert (status, err) == (0, "")
    assert out.startswith("TRF-010  Transfer CRC mismatch")
    assert max(map(display_width, out.splitlines())) <= 80


def test_the_list_has_every_rule(command: Command) -> None:
    _, out, _ = command("explain", "--list")
    lines = out.splitlines()
    assert [line.partition(" ")[0] for line in lines] == list(load(registry()))
    assert {line.partition("-")[0] for line in lines} == {*LAYERS, "HW"}
    assert max(map(display_width, lines)) <= 80
    _, out, _ = command("explain", "--list", "CAP")
    assert all(line.startswith("CAP-") for line in out.splitlines())


def test_all_pages_as_one_document(command: Command) -> None:
    _, out, _ = command("explain", "--markdown")
    assert out.startswith("# Rules\n")
    assert out.count("\n## ") == len(load(registry()))


@pytest.mark.parametrize(
    ("args", "reason"),
    [
        (["TRF-101"], "no rule is called 'TRF-101' (near: TRF-0"),
        (["TRF-010", "nonsense"], "nonsense"),
        ([], "--list"),
        (["", ","], "--list"),
        (["--list", "--markdown"], "which one"),
    ],
)
def test_explain_what_there_is_not(command: Command, args: list[str], reason: str) -> None:
    status, out, err = command("explain", *args)
    assert (status, out) == (2, "")
    assert reason in err
