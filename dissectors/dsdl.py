"""DSDL v0 as a language: the text of one definition file to a syntax tree.

Names of nested types stay names here; `dissectors.namespace` finds their files and compiles the layout. Every error
is a `DsdlError` with file, line and reason, whatever the text is.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NoReturn

from dissectors.layout import PrimitiveType
from dissectors.plain_files import read_bytes
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from dissectors.layout import PrimitiveKind

MAX_FILE_BYTES = 256 * 1024
MAX_NAME = 80
MAX_ARRAY = 65535

_TOKEN = re.compile(
    r"\s*(?:(?P<mark>---)|(?P<directive>@\w+)|(?P<name>[A-Za-z_]\w*(?:\.\w+)*)"
    r"|(?P<float>[+-]?(?:\d+\.\d*|\.\d+|\d+(?=[eE]))(?:[eE][+-]?\d{1,3})?)"
    r"|(?P<int>[+-]?(?:0[xX][0-9a-fA-F]+|0[bB][01]+|0[oO][0-7]+|\d+))(?!\w)"
    r"|(?P<char>'(?:[^'\\]|\\[nrt0'\"\\]|\\x[0-9a-fA-F]{2})')|(?P<sign><=|[<=\[\]])|(?P<comment>\#.*)|(?P<end>$))",
    re.ASCII,
)
_ATTRIBUTE = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)
_NUMBERED = re.compile(r"(uint|int|float|void)(\d{1,4})", re.ASCII)
_SIGNATURE = re.compile(r"(?:0[xX])?[0-9a-fA-F]{1,16}", re.ASCII)
_ESCAPES = {"n": "\n", "r": "\r", "t": "\t", "0": "\0"}
_FLOAT_MAX = {16: 65504.0, 32: 3.4028234663852886e38, 64: 1.7976931348623157e308}


class DsdlError(ValueError):
    """A definition that cannot be used; the text reads `file:line: reason` (line 0 is the file as a whole)."""

    def __init__(self, file: str, line: int, reason: str) -> None:
        super().__init__(f"{file}:{line}: {reason}" if line else f"{file}: {reason}")
        self.file, self.line, self.reason = file, line, reason

    def __reduce__(self) -> tuple[type[DsdlError], tuple[str, int, str]]:
        """Pickle it with its three parts, not with its text."""
        return type(self), (self.file, self.line, self.reason)


@dataclass(frozen=True, slots=True)
class Size:
    """`[count]`, or up to `count` elements if `dynamic`."""

    count: int
    dynamic: bool


@dataclass(frozen=True, slots=True)
class FieldSyntax:
    """One field; `base` is a primitive, or the name of a nested type as it is written. Padding has no name."""

    line: int
    name: str
    base: PrimitiveType | str
    size: Size | None


@dataclass(frozen=True, slots=True)
class Constant:
    """A named value; it takes no space on the wire."""

    name: str
    type: PrimitiveType
    value: int | float | bool


@dataclass(frozen=True, slots=True)
class Section:
    """A message, or the request or the response of a service."""

    fields: tuple[FieldSyntax, ...]
    constants: tuple[Constant, ...]
    union: bool


@dataclass(frozen=True, slots=True)
class Definition:
    """One file: one section for a message, two for a service; `override` is the signature that the file dictates."""

    sections: tuple[Section, ...]
    override: int | None

    @property
    def service(self) -> bool:
        """True if the file has a response mark `---`."""
        return len(self.sections) == 2


def read(path: Path) -> str:
    """Return the text of a definition file; `DsdlError` if it cannot be read or is larger than `MAX_FILE_BYTES`."""
    try:
        data = read_bytes(path, MAX_FILE_BYTES + 1)
    except OSError as error:
        raise DsdlError(str(path), 0, error.strerror or "cannot be read") from None
    if len(data) > MAX_FILE_BYTES:
        raise DsdlError(str(path), 0, f"larger than {MAX_FILE_BYTES} bytes")
    return data.decode("utf-8-sig", errors="replace")


def parse(text: str, file: str) -> Definition:
    """Return the syntax tree of a definition; `file` is its name in errors."""
    return _Parser(file).definition(text)


class _Parser:
    def __init__(self, file: str) -> None:
        self.file = file
        self.line = 0
        self.tokens: list[tuple[str, str]] = []
        self.override: int | None = None

    def fail(self, reason: str) -> NoReturn:
        raise DsdlError(self.file, self.line, reason)

    def definition(self, text: str) -> Definition:
        sections = [_SectionBuilder()]
        for self.line, line in enumerate(re.split(r"\r\n|\n|\r", text), 1):
            self.tokens = list(self.scan(line))
            if not self.tokens:
                continue
            kind, word = self.tokens[0]
            if kind == "mark":
                self.alone()
                if len(sections) == 2:
                    self.fail("a second response mark ---")
                self.check(sections[-1])
                sections.append(_SectionBuilder())
            elif kind == "directive":
                self.directive(word, sections[-1])
            elif word == "OVERRIDE_SIGNATURE":
                self.signature(line)
            else:
                self.attribute(sections[-1])
        self.check(sections[-1])
        done = (Section(tuple(part.fields), tuple(part.constants), part.union) for part in sections)
        return Definition(tuple(done), self.override)

    def scan(self, line: str) -> Iterator[tuple[str, str]]:
        position = 0
        while True:
            match = _TOKEN.match(line, position)
            if match is None:
                self.fail(f"not understood: {line[position:].strip()[:40]!r}")
            kind = match.lastgroup or "end"
            if kind in ("end", "comment"):
                return
            yield kind, match[kind]
            position = match.end()

    def take(self, *kinds: str) -> str | None:
        """Return the next token, if it is one of these kinds or of these words."""
        if self.tokens and (self.tokens[0][0] in kinds or self.tokens[0][1] in kinds):
            return self.tokens.pop(0)[1]
        return None

    def alone(self) -> None:
        if len(self.tokens) > 1:
            self.fail(f"nothing may follow {self.tokens[0][1]}")

    def directive(self, word: str, section: _SectionBuilder) -> None:
        if word != "@union":
            self.fail(f"unknown directive {word[:40]} (allowed: @union)")
        self.alone()
        if section.union:
            self.fail("a second @union")
        section.union = True

    def signature(self, line: str) -> None:
        words = line.partition("#")[0].split()
        if len(words) != 2 or not _SIGNATURE.fullmatch(words[1]):
            self.fail("OVERRIDE_SIGNATURE takes one hexadecimal number of 64 bits")
        if self.override is not None:
            self.fail("a second OVERRIDE_SIGNATURE")
        self.override = int(words[1], 16)

    def attribute(self, section: _SectionBuilder) -> None:
        cast = self.take("saturated", "truncated")
        word = self.take("name")
        if word is None:
            self.fail("a type is expected")
        base = self.base(word, cast)
        size = self.size(base) if self.take("[") else None
        name = self.take("name")
        if isinstance(base, PrimitiveType) and base.kind == "void":
            if name or self.tokens:
                self.fail("padding has no name and no value")
            section.fields.append(FieldSyntax(self.line, "", base, None))
            return
        if name is None or not _ATTRIBUTE.fullmatch(name) or len(name) > MAX_NAME:
            self.fail("a name is expected: a letter, then letters, digits or _")
        if name in section.names:
            self.fail(f"{name} is defined twice")
        section.names.add(name)
        if self.take("="):
            section.constants.append(self.constant(name, base, size))
        else:
            section.fields.append(FieldSyntax(self.line, name, base, size))
        if self.tokens:
            self.fail(f"nothing may follow here: {self.tokens[0][1][:40]!r}")

    def base(self, word: str, cast: str | None) -> PrimitiveType | str:
        kind, bits = ("bool", 1) if word == "bool" else (word, 0)
        numbered = _NUMBERED.fullmatch(word)
        if numbered:
            kind, bits = numbered[1], int(numbered[2])
        elif word != "bool":
            return self.nested(word, cast)
        if kind == "void" and cast:
            self.fail(f"{cast} cannot be applied to padding")
        if kind == "float" and bits not in _FLOAT_MAX:
            self.fail(f"{word} does not exist (allowed: float16, float32, float64)")
        if kind in ("uint", "int") and not 2 <= bits <= 64:
            self.fail(f"{word} does not exist (allowed: 2 to 64 bits; one bit is a bool)")
        if kind == "void" and not 1 <= bits <= 64:
            self.fail(f"{word} does not exist (allowed: 1 to 64 bits)")
        # Casting is the sender's affair: `truncated` on int and bool, where it has no defined meaning, harms no reader.
        return PrimitiveType(_KINDS[kind], bits, cast != "truncated")

    def nested(self, word: str, cast: str | None) -> str:
        if cast:
            self.fail(f"{cast} cannot be applied to a nested type")
        if not re.fullmatch(r"(?:[a-z][a-z0-9_]*\.)*[A-Z][A-Za-z0-9_]*", word) or len(word) > MAX_NAME:
            self.fail(f"no such type: {word[:MAX_NAME]}")
        return word

    def size(self, base: PrimitiveType | str) -> Size:
        if isinstance(base, PrimitiveType) and base.kind == "void":
            self.fail("an array of padding")
        bound = self.take("<=", "<")
        number = self.take("int")
        if number is None or not self.take("]"):
            self.fail("an array is [N], [<=N] or [<N]")
        if self.take("["):
            self.fail("an array of arrays: use a nested type")
        count = self.integer(number) - (bound == "<")
        if not 1 <= count <= MAX_ARRAY:
            self.fail(f"an array holds 1 to {MAX_ARRAY} elements, not {count}")
        return Size(count, bound is not None)

    def integer(self, word: str) -> int:
        digits = word.lstrip("+-")
        if len(digits) > 80:
            self.fail("a number of more than 80 digits")
        value = int(digits, 0) if digits[:2].lower() in ("0x", "0b", "0o") else int(digits)
        return -value if word.startswith("-") else value

    def constant(self, name: str, base: PrimitiveType | str, size: Size | None) -> Constant:
        if not isinstance(base, PrimitiveType) or size:
            self.fail("only a number, a bool or a character can be constant")
        if not self.tokens:
            self.fail("a value is expected")
        kind, word = self.tokens.pop(0)
        if kind == "name" and word in ("true", "false"):
            value: float = int(word == "true")
        elif kind == "int":
            value = self.integer(word)
        elif kind == "float":
            value = float(word)
        elif kind == "char":
            value = _character(word[1:-1])
        else:
            self.fail(f"a constant is one literal, not {word[:40]!r}")
        return Constant(name, base, self.fit(value, base))

    def fit(self, value: float, base: PrimitiveType) -> int | float | bool:
        if base.kind == "float":
            if abs(value) > _FLOAT_MAX[base.bits]:
                self.fail(f"the value does not fit in float{base.bits}")
            return float(value)
        if value in (float("inf"), float("-inf")) or value != int(value):
            self.fail("the value is not a whole number")
        low, high = (
            (-(1 << base.bits - 1), (1 << base.bits - 1) - 1) if base.kind == "int" else (0, (1 << base.bits) - 1)
        )
        if not low <= value <= high:
            self.fail(f"the value does not fit: {low} to {high}")
        return bool(value) if base.kind == "bool" else int(value)

    def check(self, section: _SectionBuilder) -> None:
        if section.union and len(section.fields) < 2:
            self.fail("a union has at least two fields")
        if section.union and not all(field.name for field in section.fields):
            self.fail("a union has no padding")


class _SectionBuilder:
    def __init__(self) -> None:
        self.fields: list[FieldSyntax] = []
        self.constants: list[Constant] = []
        self.names: set[str] = set()
        self.union = False


_KINDS: dict[str, PrimitiveKind] = {"uint": "uint", "int": "int", "float": "float", "bool": "bool", "void": "void"}


def _character(text: str) -> int:
    if text.startswith("\\x"):
        return ord(bytes.fromhex(text[2:]))
    if text.startswith("\\"):
        return ord(_ESCAPES.get(text[1], text[1]))
    return ord(text)
