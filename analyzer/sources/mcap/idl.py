"""The structures of an IDL text, as far as messages of a robot need it: modules, typedefs, structs."""

from __future__ import annotations

import re

# Comments and strings without an end go on to the end of the text.
_TOKEN = re.compile(
    r'//[^\n]*|/\*.*?(?:\*/|\Z)|#[^\n]*|"(?:[^"\\]|\\.)*+(?:"|\\?\Z)|[A-Za-z_][\w:]*|\d+|@|\S', re.DOTALL
)
_SKIP = ("//", "/*", "#")
_ENDS = frozenset("{};")
# Modules, structs and sequences inside each other; reading ends at deeper ones.
_DEEPEST = 16
_PLAIN = {
    "boolean": "bool",
    "octet": "uint8",
    "char": "uint8",
    "short": "int16",
    "long": "int32",
    "long long": "int64",
    "unsigned short": "uint16",
    "unsigned long": "uint32",
    "unsigned long long": "uint64",
    "float": "float32",
    "double": "float64",
}


def structs(text: str) -> dict[str, list[tuple[str, str]]]:
    """Return the fields of every struct by its full name (`a::b::C`): type, as a `.msg` file writes it, and name.

    What is not understood is left out: a struct with such a field lacks it.
    """
    return _Parser(text).run()


class _Parser:
    """Statements end at `;` or at the `{` of a module or struct, which `}` closes."""

    def __init__(self, text: str) -> None:
        self._tokens = [token for token in _TOKEN.findall(text) if not token.startswith(_SKIP)]
        self._at = 0
        self._aliases: dict[str, str] = {}
        self._scopes: list[tuple[str, str]] = []
        self._found: dict[str, list[tuple[str, str]]] = {}

    def run(self) -> dict[str, list[tuple[str, str]]]:
        words: list[str] = []
        while self._at < len(self._tokens) and len(self._scopes) <= _DEEPEST:
            word = self._tokens[self._at]
            self._at += 1
            if word == "@":
                self._annotation()
                continue
            if word not in _ENDS:
                words.append(word)
                continue
            if word == "{":
                self._open(words)
            elif word == "}":
                self._scopes = self._scopes[:-1]
            else:
                self._statement(words)
            words = []
        return self._found

    def _annotation(self) -> None:
        """`@name` and what stands in parentheses behind it."""
        self._at += 1
        if self._tokens[self._at : self._at + 1] != ["("]:
            return
        depth = 0
        while self._at < len(self._tokens):
            depth += {"(": 1, ")": -1}.get(self._tokens[self._at], 0)
            self._at += 1
            if not depth:
                return

    def _open(self, words: list[str]) -> None:
        kind, name = (words[0], words[1]) if len(words) >= 2 else ("", "")
        self._scopes.append((kind, name))
        if kind == "struct":
            self._found.setdefault(self._path(), [])

    def _path(self) -> str:
        return "::".join(name for kind, name in self._scopes if kind in {"module", "struct"})

    def _statement(self, words: list[str]) -> None:
        typedef = words[:1] == ["typedef"]
        inside = bool(self._scopes) and self._scopes[-1][0] == "struct"
        if not (typedef or inside):
            return
        words = words[1:] if typedef else words
        size = ""
        if len(words) > 3 and words[-3] == "[" and words[-1] == "]":
            size, words = f"[{words[-2]}]", words[:-3]
        if len(words) < 2:
            return
        kind = self._kind(words[:-1]) + size
        if typedef:
            self._aliases[words[-1]] = kind
        else:
            self._found[self._path()].append((kind, words[-1]))

    def _kind(self, words: list[str], depth: int = 0) -> str:
        if words[0] == "sequence" and depth < _DEEPEST:
            inner = words[2:-1]
            bound = ""
            if "," in inner:
                cut = inner.index(",")
                inner, bound = inner[:cut], f"<={''.join(inner[cut + 1 :])}"
            return f"{self._kind(inner, depth + 1)}[{bound}]" if inner else "?"
        text = " ".join(words)
        return self._aliases.get(text.rpartition("::")[2], _PLAIN.get(text, text))
