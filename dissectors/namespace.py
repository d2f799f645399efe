"""Definition files by full type name, compiled to layouts and signatures on demand."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from dissectors import dsdl
from dissectors.dsdl import DsdlError, FieldSyntax, Section
from dissectors.layout import ArrayType, CompoundType, Member, PrimitiveType
from dissectors.records import dataclass
from dissectors.signature import normalised, signature

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

MAX_DEPTH = 16
MAX_NODES = 4096
MAX_BITS = 65536 * 8
MAX_FILES = 4096
MAX_SERVICE_ID = 255
MAX_MESSAGE_ID = 65535

_FILE = re.compile(r"(?:(\d{1,6})\.)?([A-Z][A-Za-z0-9_]*)(?:\.\d{1,3}\.\d{1,3})?\.uavcan", re.ASCII)
_NAME = re.compile(r"(?:[a-z][a-z0-9_]*\.)+[A-Z][A-Za-z0-9_]*", re.ASCII)


@dataclass(frozen=True, slots=True)
class Entry:
    """A definition file: its full type name and the default data type ID of its file name."""

    full_name: str
    type_id: int | None
    path: Path


@dataclass(frozen=True, slots=True)
class Compiled:
    """A compiled type: one layout for a message, request and response for a service.

    `constants` are parallel to `layouts`; `nodes` counts the parts of all of them.
    """

    full_name: str
    type_id: int | None
    layouts: tuple[CompoundType, ...]
    signature: int
    constants: tuple[Mapping[str, int | float | bool], ...]
    nodes: int

    @property
    def service(self) -> bool:
        """True for a request and response pair."""
        return len(self.layouts) == 2


class Namespace:
    """A set of definition files; a type that is not found in it is looked up in `parent`.

    `by_id` and `entries` come from file names alone; a file is read when its type is asked for, and compiled once.
    """

    def __init__(self, parent: Namespace | None = None) -> None:
        self.parent = parent
        self.entries: dict[str, Entry] = {}
        self.by_id: dict[int, list[Entry]] = {}
        self._compiled: dict[str, Compiled] = {}
        self._open: list[str] = []

    def add(self, path: Path, full_name: str) -> Entry:
        """Make one file known under `full_name`; the data type ID is the number its name starts with."""
        match = _FILE.fullmatch(path.name)
        if match is None:
            raise DsdlError(str(path), 0, "a definition file is called [<id>.]<Name>.uavcan")
        if not _NAME.fullmatch(full_name) or len(full_name) > dsdl.MAX_NAME:
            reason = (
                f"{full_name[:100]!r} is no type name: lower-case namespaces, then a capital, {dsdl.MAX_NAME} at most"
            )
            raise DsdlError(str(path), 0, reason)
        if full_name in self.entries and self.entries[full_name].path != path:
            raise DsdlError(str(path), 0, f"{full_name} is also defined by {self.entries[full_name].path}")
        entry = Entry(full_name, int(match[1]) if match[1] else None, path)
        self.entries[full_name] = entry
        if entry.type_id is not None:
            self.by_id.setdefault(entry.type_id, []).append(entry)
        return entry

    def add_tree(self, folder: Path, prefix: str = "") -> None:
        """Make every definition file below `folder` known, folder names being namespaces under `prefix`.

        A file that was added under another name keeps that one.
        """
        added = {entry.path for entry in self.entries.values()}
        for path in (path for path in _definitions(folder) if path not in added):
            match = _FILE.fullmatch(path.name)
            folders = ".".join(path.relative_to(folder).parts[:-1])
            self.add(path, ".".join(filter(None, (prefix, folders, match[2] if match else path.name))))

    def is_service(self, entry: Entry) -> bool:
        """Return whether a file defines a service, from a cheap look at its text."""
        if entry.type_id is not None and entry.type_id > MAX_SERVICE_ID:
            return False
        return any(line.partition("#")[0].strip() == "---" for line in dsdl.read(entry.path).splitlines())

    def find(self, type_id: int, *, service: bool) -> Entry | None:
        """Return the file that defines this ID as a message or as a service, the two being separate numbers."""
        return next((entry for entry in self.by_id.get(type_id, ()) if self.is_service(entry) == service), None)

    def compile(self, full_name: str) -> Compiled:
        """Return the compiled type; `DsdlError` if a definition is missing, wrong, nested in itself or too large."""
        done = self._compiled.get(full_name)
        if done is None:
            entry = self.entries.get(full_name)
            if entry is None:
                if self.parent is None:
                    raise DsdlError(full_name, 0, "no definition file for this type")
                return self.parent.compile(full_name)
            self._open.append(full_name)
            try:
                done = self._compile(entry)
            finally:
                self._open.pop()
            self._compiled[full_name] = done
        return done

    def signature_as(self, full_name: str, name: str) -> int:
        """Return the signature that an entry would have if it were called `name` and its file dictated none."""
        entry = self.entries[full_name]
        nested: list[Compiled] = []
        sections = dsdl.parse(dsdl.read(entry.path), str(entry.path)).sections
        texts = [(section.union, self._members(section, entry, nested)[1]) for section in sections]
        return signature(normalised(name, texts), [inner.signature for inner in nested])

    def _compile(self, entry: Entry) -> Compiled:
        file = str(entry.path)
        tree = dsdl.parse(dsdl.read(entry.path), file)
        limit = MAX_SERVICE_ID if tree.service else MAX_MESSAGE_ID
        if entry.type_id is not None and entry.type_id > limit:
            raise DsdlError(file, 0, f"the data type ID is at most {limit}")
        nested: list[Compiled] = []
        suffixes = (".Request", ".Response") if tree.service else ("",)
        layouts, texts = [], []
        for section, suffix in zip(tree.sections, suffixes, strict=True):
            members, lines = self._members(section, entry, nested)
            layouts.append(CompoundType(entry.full_name + suffix, members, section.union))
            texts.append((section.union, lines))
        nodes = sum(2 * len(layout.fields) + 1 for layout in layouts) + sum(inner.nodes for inner in nested)
        if nodes > MAX_NODES or any(layout.max_bits > MAX_BITS for layout in layouts):
            raise DsdlError(file, 0, f"too large: at most {MAX_BITS // 8} bytes and {MAX_NODES} parts")
        code = signature(normalised(entry.full_name, texts), [inner.signature for inner in nested], tree.override)
        constants = tuple({one.name: one.value for one in section.constants} for section in tree.sections)
        return Compiled(entry.full_name, entry.type_id, tuple(layouts), code, constants, nodes)

    def _members(self, section: Section, entry: Entry, nested: list[Compiled]) -> tuple[tuple[Member, ...], list[str]]:
        """Return the fields of a section with nested types resolved, and their normalised lines."""
        members, lines = [], []
        for field in section.fields:
            base: PrimitiveType | CompoundType
            if isinstance(field.base, PrimitiveType):
                base, text = field.base, _spell(field.base)
            else:
                inner = self._nested(field, field.base, entry)
                nested.append(inner)
                base, text = inner.layouts[0], inner.full_name
            if field.size is None:
                members.append(Member(field.name, base))
            else:
                members.append(Member(field.name, ArrayType(base, field.size.count, field.size.dynamic)))
                text += f"[{'<=' if field.size.dynamic else ''}{field.size.count}]"
            lines.append(f"{text} {field.name}" if field.name else text)
        return tuple(members), lines

    def _nested(self, field: FieldSyntax, name: str, entry: Entry) -> Compiled:
        full_name = name if "." in name else f"{entry.full_name.rpartition('.')[0]}.{name}"
        file = str(entry.path)
        if full_name in self._open:
            raise DsdlError(file, field.line, f"{full_name} contains itself")
        if len(self._open) >= MAX_DEPTH:
            raise DsdlError(file, field.line, f"nested deeper than {MAX_DEPTH}")
        if not self.knows(full_name):
            raise DsdlError(file, field.line, f"no definition file for {full_name}")
        inner = self.compile(full_name)
        if inner.service:
            raise DsdlError(file, field.line, f"{full_name} is a service and cannot be nested")
        return inner

    def knows(self, full_name: str) -> bool:
        """Return whether there is a definition file for this name, here or in a parent."""
        return full_name in self.entries or (self.parent is not None and self.parent.knows(full_name))


def _spell(base: PrimitiveType) -> str:
    """Return a primitive as the normalised text has it: the cast mode is always written, padding has none."""
    if base.kind == "void":
        return f"void{base.bits}"
    width = "" if base.kind == "bool" else base.bits
    return f"{'saturated' if base.saturated else 'truncated'} {base.kind}{width}"


def _definitions(folder: Path) -> Iterator[Path]:
    """Yield every definition file below a folder, in a fixed order; symbolic links to folders are not followed."""
    count = 0
    waiting = [(folder, 0)]
    while waiting:
        current, depth = waiting.pop()
        try:
            children = sorted(current.iterdir())
        except OSError as error:
            raise DsdlError(str(current), 0, error.strerror or "cannot be listed") from None
        for child in children:
            if child.name.endswith(".uavcan"):
                count += 1
                if count > MAX_FILES:
                    raise DsdlError(str(folder), 0, f"more than {MAX_FILES} definition files")
                yield child
            elif depth < MAX_DEPTH and "." not in child.name and not child.is_symlink() and child.is_dir():
                waiting.append((child, depth + 1))
