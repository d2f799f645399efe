"""Markdown of the manual as the text of a man page: for `man_pages.py`."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING

from markdown_it import MarkdownIt

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from markdown_it.token import Token

Reference = Callable[[str], str]  # a page of the manual to the words that lead to it

_TERMINAL, _BODY = 80, 7  # columns of a terminal, and where the text of a page begins

# A column of running text, beside others, in characters.
_WIDE_CELL = 24


def escape(text: str, *, literal: bool = False) -> str:
    """Return text that roff shows as it is; what is typed is `literal`: its hyphens can be copied."""
    text = text.replace("\\", "\\e")
    if literal:
        text = (
            text.replace("-", "\\-")
            .replace("'", "\\(aq")
            .replace("`", "\\(ga")
            .replace("^", "\\(ha")
            .replace("~", "\\(ti")
        )
    return "\n".join(f"\\&{line}" if line[:1] in (".", "'") else line for line in text.split("\n"))


def bold(text: str) -> str:
    """Return what is typed; its words are never divided at the end of a line."""
    words = (f"\\%{word}" if word else word for word in escape(text, literal=True).split(" "))
    return f"\\fB{' '.join(words)}\\fR"


def as_it_is(text: str, indent: int = 2) -> Iterator[str]:
    """Yield lines that stay as they are, indented; further to the left if they would not fit a terminal."""
    widest = max(map(len, text.split("\n")))
    yield from (
        ".PP",
        f".RS {min(indent, _TERMINAL - _BODY - widest)}",
        ".EX",
        escape(text, literal=True),
        ".EE",
        ".RE",
    )


class Page:
    """Turns the tokens of a page to lines; `h2` becomes a section, deeper headings sections in it."""

    def __init__(self, reference: Reference) -> None:
        self._reference = reference

    def sections(self, text: str) -> list[tuple[str, list[str]]]:
        """Return the sections of a page with their lines; the first has no title, the title of the page is left out."""
        tokens = MarkdownIt("commonmark", {"html": False}).enable("table").parse(text)
        found: list[tuple[str, list[str]]] = [("", [])]
        place = 0
        while place < len(tokens):
            if tokens[place].type == "heading_open" and tokens[place].tag in ("h1", "h2"):
                if tokens[place].tag == "h2":
                    found.append((self._inline(tokens[place + 1]), []))
                place += 3
                continue
            end = _end(tokens, place)
            found[-1][1].extend(self._block(tokens[place:end]))
            place = end
        return found

    def _block(self, tokens: Sequence[Token], lead: str = ".PP") -> Iterator[str]:
        kind = tokens[0].type
        if kind == "heading_open":
            yield f".SS {self._inline(tokens[1])}"
        elif kind == "paragraph_open":
            yield lead
            yield self._inline(tokens[1])
        elif kind in ("fence", "code_block"):
            yield from as_it_is(tokens[0].content.rstrip("\n"))
        elif kind in ("bullet_list_open", "ordered_list_open"):
            yield from self._list(tokens[1:-1], ordered=kind.startswith("ordered"))
        elif kind == "table_open":
            yield from self._table(tokens)
        elif kind not in ("hr", "html_block"):
            raise ValueError(f"no man page has {kind}")

    def _list(self, tokens: Sequence[Token], *, ordered: bool) -> Iterator[str]:
        place = number = 0
        while place < len(tokens):
            end, number = _end(tokens, place), number + 1
            inner = tokens[place + 1 : end - 1]
            at = 0
            while at < len(inner):
                after = _end(inner, at)
                mark = f".IP {number}. 4" if ordered else ".IP \\(bu 2"
                if at and inner[at].type == "paragraph_open":
                    mark = ".IP"
                yield from self._block(inner[at:after], mark)
                at = after
            place = end

    def _table(self, tokens: Sequence[Token]) -> Iterator[str]:
        rows: list[list[str]] = []
        for token, text in pairwise(tokens):
            if token.type == "tr_open":
                rows.append([])
            elif token.type in ("td_open", "th_open"):
                rows[-1].append(self._inline(text))
        head, *body = rows
        if len(head) == 2:  # what a definition list says better
            for term, text in body:
                yield from (".TP", term if term.startswith("\\f") else f"\\fB{term}\\fR", text)
            yield ".PP"
            return
        wide = [max(len(re.sub(r"\\f.|\\", "", row[k])) for row in rows) > _WIDE_CELL for k in range(len(head))]
        columns = " ".join("lx" if one else "l" for one in wide)
        yield from (".PP", ".TS", " ".join("lb" if not one else "lbx" for one in wide), f"{columns}.")
        for row in [head, *body]:
            cells = (f"T{{\n{cell}\nT}}" if one and cell else cell for cell, one in zip(row, wide, strict=True))
            yield "\t".join(cells)
        yield ".TE"

    def _inline(self, token: Token) -> str:
        parts: list[str] = []
        target, start = "", 0
        for part in token.children or []:
            if part.type in ("strong_open", "em_open"):
                parts.append("\\fB" if part.type == "strong_open" else "\\fI")
            elif part.type in ("strong_close", "em_close"):
                parts.append("\\fR")
            elif part.type in ("softbreak", "hardbreak"):
                parts.append("\n")
            elif part.type == "code_inline":
                parts.append(bold(part.content))
            elif part.type == "link_open":
                target, start = str(part.attrs["href"]), len(parts)
            elif part.type == "link_close":
                parts[start:] = [self._linked("".join(parts[start:]), target)]
            elif part.type == "text":
                parts.append(escape(part.content))
        lines = "".join(parts).split("\n")
        return "\n".join(f"\\&{line}" if line[:1] in (".", "'") else line for line in lines)

    def _linked(self, text: str, target: str) -> str:
        if target.startswith("http"):
            return text if text == target else f"{text} <{escape(target, literal=True)}>"
        page, dot, _ = target.partition(".md")
        if not dot or "/" in page:
            return text
        words = self._reference(page)
        return words if text == page else f"{text} ({words})"


def _end(tokens: Sequence[Token], place: int) -> int:
    """Return where the block ends that begins there."""
    depth = 0
    for k in range(place, len(tokens)):
        depth += tokens[k].nesting
        if depth == 0:
            return k + 1
    raise ValueError("a block without end")
