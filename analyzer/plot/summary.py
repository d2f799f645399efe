"""The first page of a recording: what `info` and `check` say of the capture, and what the picture leaves out."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from analyzer.report import markdown
from analyzer.views import info

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analyzer.facts.summary import Facts
    from analyzer.plot.inventory import Inventory
    from analyzer.plot.thinning import Thinning
    from analyzer.report.model import Report

_SHOWN = 10
_FOLDED = re.compile(r"<details><summary>(.*?)</summary>")  # the viewer shows no HTML
_SIGNS = re.compile(f"[{''.join(sorted(markdown.PICTURES))}]+ ?")  # nor has it a font for these


def page(
    report: Report, facts: Facts, inventory: Inventory, thinned: Mapping[str, Thinning], window: str = ""
) -> str:  # fmt: skip
    """Write Markdown. `thinned` says by path which lines lost points, `window` which part is shown, in words."""
    notes = []
    if window:
        notes.append(
            f"- Plots show a part of the capture: {markdown.code(window)}. Everything else here is of all of it."
        )
    if thinned:
        notes.append(
            f"- **Fewer points than the capture has** in {len(thinned)} lines: the lowest and the highest of so many "
            "in a row are shown, so that no peak is lost. `--max-points all` shows all, `--around` a part in full."
        )
        ordered = sorted(thinned.items(), key=lambda one: -one[1].count)
        notes += [f"  - {markdown.code(path)}: {one.count} points, 2 of {one.bucket}" for path, one in ordered[:_SHOWN]]
        if len(ordered) > _SHOWN:
            notes.append(f"  - and {len(ordered) - _SHOWN} more")
    if inventory.beyond:
        notes.append(f"- {inventory.beyond} times there was no room for another device or line.")
    shown = "\n".join(notes)
    found = _FOLDED.sub(r"#### \1", markdown.render(report)).replace("</details>", "")
    found = _SIGNS.sub("", found)
    return f"{found}\n{shown}\n\n### tailbyte info\n\n```text\n{info.render(facts)}```\n"
