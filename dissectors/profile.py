"""A dissector folder: `profile.toml` onto DSDL, each message built when it is asked for.

With a profile the folder offers the messages it lists and every type of its `tree`; without one, every definition
file in the folder (`Profile.open`). Errors are `ProfileError` or `DsdlError`, both with file and line.
"""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from typing import TYPE_CHECKING

from dissectors import packets
from dissectors.dsdl import DsdlError
from dissectors.keys import PROFILE
from dissectors.keys.profile import NESTED
from dissectors.layout import ArrayType, CompoundType, PrimitiveType
from dissectors.namespace import Compiled, Namespace
from dissectors.notes import NoteReader, columns
from dissectors.records import dataclass, replace
from dissectors.remarks import RemarkReader
from dissectors.schema import Dissector, Evidence, Message, Reading
from dissectors.toml_table import ProfileError, TomlTable, read

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from dissectors.schema import Derived, MessageKind, Note

__all__ = ["KINDS", "Offer", "Profile", "ProfileError"]

KINDS: tuple[MessageKind, ...] = ("message", "request", "response")


@dataclass(frozen=True, slots=True)
class Offer:
    """A type that a folder decodes, before anything of it is compiled. `name` is what it is called in tables."""

    name: str
    full_name: str
    type_id: int
    service: bool


class Profile:
    """One folder, read: its name and version, the types it offers and, on demand, their messages."""

    def __init__(self, folder: Path, table: TomlTable, parent: Namespace | None, *, trusted: bool = True) -> None:
        self.folder = folder
        self.table = table = table.of(PROFILE)
        self.name = table.string("name") or folder.name
        self.version = table.string("version")
        # A module, or a file NAME.py here, with what conformance rules need: it runs only if the folder is trusted.
        self.code = table.string("rules")
        self.rules = self.code if trusted else ""
        self.namespace = Namespace(parent)
        self.reader = NoteReader({name: table.table("enum").texts(name) for name in table.table("enum").body})
        self._names: dict[str, str] = {}  # full type name -> name in tables
        self._built: dict[tuple[MessageKind, str], Message] = {}
        self._having: dict[str, tuple[Message, ...]] = {}
        listed = [(name, body) for kind in KINDS for name, body in table.tables(kind)]
        for name, body in listed:
            self._add_file(name, body)
        self._add_tree(table)
        for name, body in listed:
            full_name = body.string("type") or name
            if full_name not in self.namespace.entries:
                body.fail(f"no definition file for {full_name}: give it with dsdl, or a tree that holds it")
            self._names[full_name] = name
        self.undefined = [_undefined(name, body) for name, body in table.tables("undefined")]
        for name, body in table.tables("type"):
            if not self.namespace.knows(name):
                body.fail(f"no definition file for {name}")
        table.finish()

    @classmethod
    def open(cls, folder: Path, parent: Namespace | None = None, *, trusted: bool = True) -> Profile:
        """Read a folder; nested types that it does not define are looked up in `parent`.

        Python that it brings runs only if it is `trusted`.
        """
        path = folder / "profile.toml"
        if path.exists():
            return cls(folder, read(path), parent, trusted=trusted)
        if not folder.is_dir():
            raise ProfileError(str(folder), 0, "no such folder")
        return cls(folder, TomlTable(str(path), "", (), {"tree": "."}), parent)

    @property
    def muted(self) -> bool:
        """True if its rules in Python do not run because the folder is not trusted."""
        return bool(self.code) and not self.rules

    def find(self, type_id: int, *, service: bool) -> str | None:
        """Return the full name of the offered type with this ID."""
        entry = self.namespace.find(type_id, service=service)
        return entry.full_name if entry else None

    def offers(self) -> Iterator[Offer]:
        """Yield every offered type that has an ID; read, but do not compile, the files of possible services."""
        for entries in self.namespace.by_id.values():
            for entry in entries:
                service = self.namespace.is_service(entry)
                name = self._names.get(entry.full_name, entry.full_name)
                yield Offer(name, entry.full_name, entry.type_id or 0, service)

    def aliases(self, full_name: str) -> tuple[str, ...]:
        """Return other names that a message of this profile answers to."""
        return self.table.table("message").table(self._names.get(full_name, full_name)).strings("aliases")

    def signature(self, full_name: str) -> int:
        """Return the data type signature of an offered type."""
        return self.namespace.compile(full_name).signature

    def mistaken(self, full_name: str) -> dict[int, str]:
        """Return signatures that a sender may take for that of an offered type, each with the name that gives it.

        Those of its other names, in every namespace that this folder knows its types by, and the one that it would have
        if its file did not dictate another.
        """
        aliases = [alias for _, body in self.table.tables("message") for alias in body.strings("aliases")]
        spaces = dict.fromkeys(name.rpartition(".")[0] for name in (full_name, *aliases))
        own = (full_name, self._names.get(full_name, full_name), *self.aliases(full_name))
        ends = dict.fromkeys(name.rpartition(".")[2] for name in own)
        names = [f"{space}.{end}" for space in spaces for end in ends]
        found = {self.namespace.signature_as(full_name, name): name for name in reversed(names)}
        return {code: found[code] for code in reversed(found) if code != self.signature(full_name)}

    def message(self, kind: MessageKind, full_name: str) -> Message:
        """Return the message with its notes, built once."""
        key = (kind, full_name)
        if key not in self._built:
            self._built[key] = self._build(kind, self.namespace.compile(full_name))
        return self._built[key]

    def having(self, key: str) -> tuple[Message, ...]:
        """Return the messages that have a key, such as `packets`; only these are built, and once."""
        if key not in self._having:  # lists ask it of every batch
            some = (body.string("type") or name for name, body in self.table.tables("message") if key in body.body)
            self._having[key] = tuple(self.message("message", name) for name in some)
        return self._having[key]

    def dissector(self) -> Dissector:
        """Return everything the folder offers, compiled and checked: the first mistake in any file is raised."""
        built = [
            self.message(kind, offer.full_name)
            for offer in self.offers()
            for kind in (KINDS[1:] if offer.service else KINDS[:1])
        ]
        self._check_listed()
        return Dissector(self.name, self.version, tuple(built))

    def _add_tree(self, table: TomlTable) -> None:
        """Add `tree`, a folder of definition files, and `package`, one in a package, which is not imported."""
        package, tree = table.string("package"), table.string("tree")
        if package:
            top, _, below = package.partition("/")
            spec = importlib.util.find_spec(top) if top.isidentifier() else None
            if spec is None or not spec.submodule_search_locations:
                table.fail(f"no installed package {top!r}", "package")
            self.namespace.add_tree(Path(spec.submodule_search_locations[0]) / below)
        if tree:
            folder = (self.folder / tree).resolve()
            if not folder.is_dir():
                table.fail(f"no such folder: {folder}", "tree")
            # Files that lie in the folder itself are in the namespace that the folder is called.
            own = any(child.suffix == ".uavcan" for child in folder.iterdir())
            self.namespace.add_tree(folder, folder.name if own else "")

    def _add_file(self, name: str, body: TomlTable) -> None:
        file = body.string("dsdl")
        if file:
            path = (self.folder / file).resolve()
            if not path.is_file():
                body.fail(f"no such file: {path}", "dsdl")
            self.namespace.add(path, body.string("type") or name)

    def _check_listed(self) -> None:
        """Refuse two types with one ID, and a table of the wrong kind: one of them would never be used."""
        taken: dict[tuple[int, bool], str] = {}
        for offer in self.offers():
            other = taken.setdefault((offer.type_id, offer.service), offer.full_name)
            if other != offer.full_name:
                path = self.namespace.entries[offer.full_name].path
                raise DsdlError(str(path), 0, f"{other} has the data type ID {offer.type_id} already")
        for kind in KINDS:
            for name, body in self.table.tables(kind):
                entry = self.namespace.entries[body.string("type") or name]
                if entry.type_id is None:
                    body.fail("the definition file has no data type ID in its name")
                if self.namespace.is_service(entry) != (kind != "message"):
                    body.fail(f"{entry.full_name} is a {'message' if kind != 'message' else 'service'}")
        for name, body in self.table.tables("type"):
            self.reader.notes(body, self.namespace.compile(name).layouts[0], body.string("clause"))
            body.finish()

    def _build(self, kind: MessageKind, compiled: Compiled) -> Message:
        layout = compiled.layouts[max(0, KINDS.index(kind) - 1)]
        name = self._names.get(compiled.full_name, compiled.full_name)
        table = self.table.table(kind).table(name)
        clause = table.string("clause")
        notes = self._notes(table, layout, clause)
        derived = self.reader.derived(table, layout, clause)
        readings = tuple(self._readings(table, layout, notes))
        _check(table, layout, derived, readings)
        message = Message(
            name=name,
            full_name=compiled.full_name,
            kind=kind,
            type_id=compiled.type_id or 0,
            signature=compiled.signature,
            layout=layout,
            notes=notes,
            derived=tuple(derived.values()),
            packets=packets.family(table, layout, self.folder, replace(self.reader, messages=self._layout)),
            prefix=table.flag("prefix"),
            readings=readings,
            clause=clause,
            summary=self.reader.summary(table, layout, notes, derived),
            aliases=table.strings("aliases"),
            turns=self._turns(table, layout),
            actuates=table.flag("actuates"),
            role=table.string("role"),
            remarks=RemarkReader(layout, notes, derived, readings).remarks(table),
        )
        for key in ("type", "dsdl"):
            table.string(key)
        table.finish()
        return message

    def _turns(self, table: TomlTable, layout: CompoundType) -> str:
        column = table.string("turns")
        kind = layout.member(column)
        if column and not (isinstance(kind, PrimitiveType) and kind.kind not in ("bool", "void")):
            table.fail(f"{column!r} is no number of {layout.name}", "turns")
        return column

    def _layout(self, name: str) -> CompoundType | None:
        """Return the layout of a message that the profile lists."""
        listed = self.table.table("message")
        if name not in listed.body:
            return None
        return self.namespace.compile(listed.table(name).string("type") or name).layouts[0]

    def _notes(self, table: TomlTable, layout: CompoundType, clause: str) -> dict[str, Note]:
        """Return the message's own notes and, under `field.member`, those of the types nested in it."""
        notes = self.reader.notes(table, layout, clause)
        for member in layout.fields:
            inner = member.type.element if isinstance(member.type, ArrayType) else member.type
            if isinstance(inner, CompoundType):
                about = self._about(inner)
                nested = self._notes(about, inner, about.string("clause"))
                notes |= {f"{member.name}.{path}": note for path, note in nested.items()}
        return notes

    def _about(self, nested: CompoundType) -> TomlTable:
        """Return what the profile says of a type wherever it is nested: its table in `type`, or in `message`."""
        for kind in ("type", "message"):
            if nested.name in self.table.table(kind).body:
                return self.table.table(kind).table(nested.name)
        return TomlTable(self.table.file, "", (), {}, NESTED)

    def _readings(self, table: TomlTable, layout: CompoundType, notes: dict[str, Note]) -> Iterator[Reading]:
        known = {name for name, _ in columns(layout, notes)}
        for name, body in table.tables("reading"):
            choices = body.strings("choices")
            field = body.string("field")
            if field not in known:
                body.fail(f"no field {field!r}", "field")
            evidence = tuple(self._evidence(row, choices, known) for row in body.rows("evidence"))
            if len(choices) < 2 or not evidence:
                body.fail("a reading has two or more choices, and evidence")
            otherwise, noted = body.one_of("otherwise", choices), body.one_of("noted", choices)
            yield Reading(name, field, choices, evidence, otherwise, body.string("clause"), noted)
            body.finish()

    def _evidence(self, row: TomlTable, choices: tuple[str, ...], known: set[str]) -> Evidence:
        found = Evidence(
            choice=row.one_of("choice", choices, required=False),
            field=row.one_of("field", sorted(known)),
            low=row.fraction("low"),
            stop=row.fraction("stop"),
            every=row.flag("every"),
            sends=row.strings("sends"),
        )
        row.finish()
        if not found.choice or bool(found.field) == bool(found.sends):
            row.fail("evidence names a choice, and either a field or the messages that a node sends")
        if not set(found.sends) <= self.table.table("message").body.keys():
            row.fail("not a message of this profile", "sends")
        return found


def _check(table: TomlTable, layout: CompoundType, derived: Mapping[str, Derived], readings: Iterable[Reading]) -> None:
    """Refuse columns that follow a reading or choices that the message does not have."""
    known = {reading.name: reading.choices for reading in readings}
    for name, column in derived.items():
        body = table.table("derived").table(name)
        if column.reading and column.reading not in known:
            body.fail(f"no reading {column.reading!r} (allowed: {', '.join(known) or 'none'})", "reading")
        if column.reading and isinstance(layout.member(column.source), ArrayType):
            body.fail("only a single number follows a reading", "reading")
        if not column.by_choice.keys() <= set(known.get(column.reading, column.by_choice)):
            body.fail(f"a choice is unknown (allowed: {', '.join(known[column.reading])})", "by_choice")


def _undefined(name: str, body: TomlTable) -> tuple[int, int, str]:
    """Return a message type of which only ID and signature are known, and its name."""
    type_id, digits = body.integer("id"), body.string("signature")
    if type_id is None or not re.fullmatch("[0-9A-Fa-f]{16}", digits):
        body.fail("a data type ID, and a signature of 16 hexadecimal digits, are expected")
    body.finish()
    return type_id, int(digits, 16), name
