"""A page of Markdown as text for a terminal: headings, lines of its width, tables in columns, code as it stands."""

from __future__ import annotations

from itertools import groupby, pairwise
from typing import TYPE_CHECKING

from markdown_it import MarkdownIt

from analyzer.views.page.grid import grid
from analyzer.views.page.prose import Fragment, Word, paint, width_of, words, wrap
from analyzer.views.terminal import PLAIN, escape

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from markdown_it.token import Token

    from analyzer.views.terminal import Palette

# Wider than this, running text and rows of a table are hard to read.
_WIDEST, _WIDEST_TABLE = 100, 120
_NARROWEST = 40
_INDENT = 2
_RULES = {"h1": "=", "h2": "-"}


def render(text: str, *, width: int = 80, palette: Palette = PLAIN) -> str:
    """Return the page for a terminal; its text is harmless there, whoever wrote it.

    Args:
        text: Markdown: headings, paragraphs, lists, code, tables, emphasis, links. Pictures are left out, and HTML is
            shown as it stands.
        width: columns of the terminal; 40 at least.
        palette: colours.
    """
    tokens = MarkdownIt("commonmark", {"html": False}).enable("table").parse(text)
    lines = _Page(max(width, _NARROWEST), palette).lines(tokens)
    # Between two blocks there is one empty line, however many of them said so.
    slim = [line for empty, group in groupby(lines, key=lambda line: not line) for line in ([""] if empty else group)]
    return "".join(f"{line}\n" for line in slim[slim[:1] == [""] : len(slim) - (slim[-1:] == [""])])


def inline(token: Token | None) -> list[Word]:
    """Return the words of a paragraph, a heading or a cell; of a link to another page also how to read it here."""
    parts = (token.children if token else None) or []
    alone = len(parts) == 3 and parts[0].type == "link_open"
    fragments: list[Fragment] = []
    style, target, start = "", "", 0
    for part in parts:
        if part.type in ("strong_open", "em_open"):
            style = "head"
        elif part.type in ("strong_close", "em_close"):
            style = ""
        elif part.type in ("softbreak", "hardbreak"):
            fragments.append(Fragment("", " "))
        elif part.type == "code_inline":
            fragments.append(Fragment("code", part.content))
        elif part.type == "link_open":
            target, start = str(part.attrs.get("href", "")), len(fragments)
        elif part.type == "link_close":
            fragments[start:] = _linked(fragments[start:], target, alone=alone)
        elif part.type == "text":
            fragments.append(Fragment(style, part.content))
    return words(fragments)


def _linked(text: list[Fragment], target: str, *, alone: bool) -> list[Fragment]:
    """Return a link's text with what leads there from a terminal; the name of a page alone says it already."""
    shown = "".join(fragment.text for fragment in text)
    page, dot, _ = target.partition(".md")
    if target.startswith("http"):
        return text if shown == target else [*text, Fragment("", f" ({target})")]
    if not dot or "/" in page:
        return text
    command = Fragment("code", f"tailbyte help {page}")
    if page == shown:
        return text if alone else [command]
    return [*text, Fragment("", " ("), command, Fragment("", ")")]


class _Page:
    """Lines of one page; an empty line stands behind every block."""

    def __init__(self, width: int, palette: Palette) -> None:
        self._width, self._palette = width, palette

    def lines(self, tokens: Sequence[Token], indent: int = 0) -> Iterator[str]:
        """Yield the lines of some blocks, each behind `indent` blanks."""
        at = 0
        while at < len(tokens):
            end = _end(tokens, at)
            yield from self._block(tokens[at : end + 1], indent)
            at = end + 1

    def _block(self, block: Sequence[Token], indent: int) -> Iterator[str]:
        kind, margin = block[0].type, " " * indent
        if kind == "heading_open":
            yield from self._heading(block, margin)
        elif kind == "paragraph_open":
            text = inline(block[1])
            if text:
                for line in wrap(text, min(self._width, _WIDEST) - indent):
                    yield margin + paint(line, self._palette)
        elif kind in ("fence", "code_block"):
            yield from self._code(block[0].content, indent)
        elif kind in ("bullet_list_open", "ordered_list_open"):
            yield from self._items(block, indent)
        elif kind == "table_open":
            yield from (margin + line for line in self._table(block, min(self._width, _WIDEST_TABLE) - indent))
        elif len(block) > 2:
            yield from self.lines(block[1:-1], indent + _INDENT)
        yield ""

    def _heading(self, block: Sequence[Token], margin: str) -> Iterator[str]:
        text = [tuple(Fragment("head", part.text) for part in word) for word in inline(block[1])]
        lines = wrap(text, min(self._width, _WIDEST) - len(margin))
        rule = _RULES.get(block[0].tag, "")
        yield ""
        yield from (margin + paint(line, self._palette) for line in lines)
        if rule:
            yield margin + rule * max(map(width_of, lines))

    def _code(self, content: str, indent: int) -> Iterator[str]:
        lines = [escape(line) for line in content.expandtabs(4).rstrip("\n").split("\n")]
        widest = max(map(len, lines))
        margin = " " * (indent + _INDENT if indent + _INDENT + widest <= self._width else 0)
        yield from (margin + self._palette.paint("code", line) if line else "" for line in lines)

    def _items(self, block: Sequence[Token], indent: int) -> Iterator[str]:
        number = int(block[0].attrs.get("start", 1)) if block[0].type == "ordered_list_open" else 0
        at = 1
        while at < len(block) - 1:
            end = _end(block, at)
            mark = f"{number}. " if number else "- "
            number += bool(number)
            first = True
            for line in self.lines(block[at + 1 : end], indent + len(mark)):
                if line or not block[at + 1].hidden:
                    yield " " * indent + mark + line[indent + len(mark) :] if first else line
                first = False
            at = end + 1

    def _table(self, block: Sequence[Token], width: int) -> Iterator[str]:
        cells = [(before, token) for before, token in pairwise(block) if token.type == "inline"]
        head = [inline(token) for before, token in cells if before.type == "th_open"]
        right = ["right" in str(before.attrs.get("style", "")) for before, _ in cells[: len(head)]]
        body = [inline(token) for before, token in cells if before.type == "td_open"]
        rows = [body[at : at + len(head)] for at in range(0, len(body), len(head))]
        yield from grid(head, rows, width, self._palette, right)


def _end(tokens: Sequence[Token], at: int) -> int:
    """Return where the block that begins at `at` ends."""
    depth = 0
    for end in range(at, len(tokens)):
        depth += tokens[end].nesting
        if depth == 0:
            return end
    return len(tokens) - 1
