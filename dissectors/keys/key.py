"""How the keys of a dissector's files are described: once, for the readers and for the reference alike."""

from __future__ import annotations

from typing import Literal

from dissectors.records import dataclass, field

Kind = Literal[
    "text", "word", "flag", "whole", "number", "scale", "texts", "words", "wholes", "codes", "enumeration", "bits",
    "table", "tables", "rows",
]  # fmt: skip

_PLAIN: dict[str, str] = {
    "text": "text", "flag": "true or false", "number": "number", "scale": "number, not 0", "texts": "list of texts",
    "codes": "table: whole number = text", "enumeration": "name of an `enum`, or a table: whole number = text",
    "table": "table", "tables": "tables by name", "rows": "list of tables",
    "bits": "tables by name; `NAME = 7` is short for a flag of that bit",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Key:
    """One key: what it may hold, and what it means.

    `words` are all that it may be, empty where they depend on the file; whole numbers go from `low` to `high`. `keys`
    are those of a table, or of each table or row; `each` describes what stands under names that the file chooses.
    """

    name: str
    kind: Kind
    about: str
    example: str = ""
    default: str = ""
    required: bool = False
    words: tuple[str, ...] = ()
    low: int = 0
    high: int = 0
    keys: Keys | None = None
    each: Key | None = None

    @property
    def type(self) -> str:
        """The values that may stand there, in words."""
        if self.kind in ("word", "words"):
            some = ", ".join(f"`{word}`" for word in self.words) or "words, see the meaning"
            return f"{'one' if self.kind == 'word' else 'list'} of {some}"
        if self.kind in ("whole", "wholes"):
            return f"{'whole number' if self.kind == 'whole' else 'list of whole numbers'}, {self.low} to {self.high}"
        return _PLAIN[self.kind]


@dataclass(frozen=True, slots=True)
class Keys:
    """The keys of one table, or of a file: `title` is how people call it."""

    title: str
    about: str
    keys: tuple[Key, ...]
    other: Key | None = None
    index: dict[str, Key] = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Index the keys once: files are read key by key."""
        object.__setattr__(self, "index", {key.name: key for key in self.keys})

    @classmethod
    def any(cls, key: Key) -> Keys:
        """Return the keys of a table whose names the file chooses; all are like `key`."""
        return cls(key.name, key.about, (), key)

    def find(self, name: str) -> Key | None:
        """Return the key of this name."""
        return self.index.get(name, self.other)


def by_name(name: str, about: str, keys: Keys, example: str = "") -> Key:
    """Return a key that holds a table of these keys for each name that the file chooses."""
    return Key(name, "tables", about, example, keys=keys, each=Key("NAME", "table", keys.about, keys=keys))
