"""The formats of a report: a new one is a module beside this one, with `render(report)`, and a line in `FORMATS`."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable


@dataclass(frozen=True, slots=True)
class ReportFormat:
    """A format: its module in a room, the suffixes that ask for it, and the help of its option (empty: it has none)."""

    name: str
    module: str
    suffixes: tuple[str, ...]
    help: str = ""
    room: str = __package__

    def render(self, report: Any, *, everything: bool = False) -> str:
        """Return the whole report, or what else its room shows, in this format.

        `everything` is for the text, where `--all` leaves nothing out.
        """
        module: Any = import_module(f"{self.room}.{self.module}")
        render: Callable[..., str] = module.render
        return render(report, everything=everything, utc=True) if self.name == "text" else render(report)


FORMATS = (
    ReportFormat("html", "html.page", (".html", ".htm"), "one page for a browser, without a network"),
    ReportFormat("json", "json", (".json",), "everything, in a documented schema"),
    ReportFormat("junit", "junit", (".xml",), "JUnit XML, for test reports of CI services"),
    ReportFormat("markdown", "markdown", (".md",), "for comments and job summaries"),
    ReportFormat("text", "text", (".txt",)),
)


def by_suffix(forms: Iterable[ReportFormat]) -> dict[str, str]:
    """Return the names of formats by the suffixes that ask for them."""
    return {suffix: form.name for form in forms for suffix in form.suffixes}
