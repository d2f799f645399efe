"""The report as one HTML file: its words and tables, its plots, and the templates of the page."""

from analyzer.report.html.page import render

__all__ = ["render"]
