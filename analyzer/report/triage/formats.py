"""The formats of triage: a new one is a module beside this one, with `render(found)`, and a line here."""

from __future__ import annotations

from analyzer.report.formats import ReportFormat

FORMATS = (
    ReportFormat("html", "html", (".html", ".htm"), "one page for a browser, without a network", __package__),
    ReportFormat("json", "json", (".json",), "everything, in a documented schema", __package__),
    ReportFormat("markdown", "markdown", (".md",), "for comments and job summaries", __package__),
    ReportFormat("text", "text", (".txt",), "", __package__),
)
