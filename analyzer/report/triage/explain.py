"""The page of a verdict, as text."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING

from analyzer.flight.verdict.pages import LABELS, verdict_pages

if TYPE_CHECKING:
    from analyzer.views.terminal import Palette

_LABEL = 10


def render(kind: str, *, width: int, palette: Palette) -> str:
    """Return the page of a kind."""
    page = verdict_pages()[kind]
    lines = [f"{palette.paint('head', kind)}  {page.title}", ""]
    lines += wrap(page.means, width)
    for name, label in LABELS.items():
        first, *rest = wrap(getattr(page, name), width - _LABEL)
        lines += [
            "",
            f"{palette.paint('head', f'{label:<{_LABEL}}')}{first}",
            *(f"{'':<{_LABEL}}{one}" for one in rest),
        ]
    return "".join(f"{line}\n" for line in lines)
