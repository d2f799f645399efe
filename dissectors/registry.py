"""All dissectors that are in use, asked by ID or by name."""

from __future__ import annotations

from functools import cache, cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from dissectors import installed
from dissectors.profile import KINDS, Profile

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from dissectors.schema import Message, MessageKind, Packet, PacketFamily

_HERE = Path(__file__).parent
_STANDARD, _FIRST = "dronecan", "tmotor"  # folders


class UnknownNameError(LookupError):
    """A name that no message has, or that several have; `candidates` are the names of tables to choose from."""

    def __init__(self, name: str, candidates: tuple[str, ...], *, several: bool) -> None:
        reason = f"{name!r} is ambiguous" if several else f"no message is called {name!r}"
        super().__init__(
            f"{reason} ({'one of' if several else 'near'}: {', '.join(candidates)})" if candidates else reason
        )
        self.candidates = candidates
        self._parts = name, candidates, several

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle it with what it is made of, not with its text."""
        name, candidates, several = self._parts
        return partial(type(self), several=several), (name, candidates)


class Registry:
    """Folders in order of precedence: of two types with one ID or name, the first one is preferred.

    Types that share an ID but not a signature stay apart as variants, numbered from 0; the CRC of a transfer tells them
    apart. A type with the signature of a preferred one is the same type and left out.
    """

    def __init__(self, profiles: Sequence[Profile]) -> None:
        self.profiles = tuple(profiles)
        self._found: dict[tuple[bool, int], list[tuple[Profile, str]]] = {}

    def __deepcopy__(self, _memo: object) -> Self:
        """Share it: what has been looked up is true for a copy of whoever asks, too."""
        return self

    def signatures(self, service: int, type_id: int) -> list[int]:
        """Return the signatures of types with a message (`service` 0) or service (1) ID, the preferred one first."""
        return [profile.signature(name) for profile, name in self._find(type_id, service=bool(service))]

    def mistaken(self, service: int, type_id: int) -> dict[int, str]:
        """Return signatures that a sender may take by mistake for those of an ID, with the names that give them."""
        found: dict[int, str] = {}
        for profile, name in self._find(type_id, service=bool(service)):
            found = profile.mistaken(name) | found
        return {code: name for code, name in found.items() if code not in self.signatures(service, type_id)}

    def undefined(self, service: int, type_id: int) -> dict[int, str]:
        """Return signatures of further types with an ID, which are known by name only."""
        listed = [one for profile in self.profiles for one in profile.undefined if not service]
        return {code: name for known, code, name in listed if known == type_id}

    def all_signatures(self) -> dict[int, str]:
        """Return the signature of every type that is in use, with its full name; compile them all."""
        offers = [(profile, offer.full_name) for profile in self.profiles for offer in profile.offers()]
        return {profile.signature(name): name for profile, name in reversed(offers)}

    def message(self, kind: int, type_id: int, variant: int = 0) -> Message | None:
        """Return the message of an ID, None if unknown. `kind` is 0 message, 1 anonymous, 2 request or 3 response."""
        found = self._find(type_id, service=kind >= 2)
        if variant >= len(found):
            return None
        profile, full_name = found[variant]
        return profile.message(KINDS[max(0, kind - 1)], full_name)

    def carriers(self) -> tuple[Message, ...]:
        """Return every message that carries packets, of all folders."""
        return self._having("packets")

    def families(self) -> tuple[PacketFamily, ...]:
        """Return the packets of each of those: packets of one message may turn up in another."""
        return tuple(message.packets for message in self.carriers() if message.packets is not None)

    @cached_property
    def packets(self) -> Mapping[str, Packet]:
        """Every packet by its table, that of the message that it belongs in."""
        return {
            f"{message.table}.{packet.name}": packet
            for message in self.carriers()
            if message.packets is not None
            for packet in message.packets.packets
        }

    def turning(self) -> tuple[Message, ...]:
        """Return every message of an ESC that says whether its motor turns, of all folders."""
        return self._having("turns")

    def doubtful(self) -> tuple[Message, ...]:
        """Return every message with fields that nodes fill in different ways, of all folders."""
        return self._having("reading")

    def _having(self, key: str) -> tuple[Message, ...]:
        return tuple(message for profile in self.profiles for message in profile.having(key))

    def names(self) -> tuple[str, ...]:
        """Return every table name that `resolve` knows, sorted."""
        return tuple(sorted(self._tables))

    def message_of(self, table: str) -> Message | None:
        """Return the message of a table, None if the table is one of packets, or nothing defines it."""
        if table not in self._tables:
            return None
        profile, kind, full_name = self._tables[table]
        return profile.message(kind, full_name)

    def definition(self, table: str) -> Message | Packet | None:
        """Return the message or packet that gives the columns of a table their meaning, None if nothing does."""
        return self.packets.get(table) or self.message_of(table)

    def table_of(self, path: str) -> str:
        """Return the table whose name, and a dot, a path to a column begins with; empty if nothing defines one."""
        parts = path.split(".")
        names = (".".join(parts[:size]) for size in range(len(parts) - 1, 0, -1))
        return next((name for name in names if self.definition(name) is not None), "")

    def resolve(self, name: str) -> Message:
        """Return the message of a table name, full type name, alias or the end of one (`NodeStatus`, `esc.Status`).

        An exact name wins over an end, and capitals matter only where they decide. Raises `UnknownNameError`.
        """
        profile, kind, full_name = self._tables[self.table(name)]
        return profile.message(kind, full_name)

    def table(self, name: str) -> str:
        """Return the name of that message's table, without compiling it. Raises `UnknownNameError`."""
        tables = self.named(name)
        if len(tables) == 1:
            return tables[0]
        if tables:
            raise UnknownNameError(name, tuple(tables), several=True)
        import difflib  # noqa: PLC0415 - costs 4 ms that only a mistyped name is worth

        near = difflib.get_close_matches(name, [known.rpartition(".")[2] for known, _ in self._known], n=3)
        raise UnknownNameError(name, tuple(dict.fromkeys(near)), several=False)

    def named(self, name: str) -> list[str]:
        """Return the tables that `table` would choose from: one if it is unique, none for a name that nothing has."""
        lower = name.lower()
        ends: tuple[Callable[[str], bool], ...] = (
            lambda known: known == name,
            lambda known: known.endswith(f".{name}"),
            lambda known: known.lower() == lower or known.lower().endswith(f".{lower}"),
        )
        for matches in ends:
            tables = sorted({table for known, table in self._known if matches(known)})
            if tables:
                return tables
        return []

    def _find(self, type_id: int, *, service: bool) -> list[tuple[Profile, str]]:
        """Return the types with this ID in order of precedence. One alone is not compiled to be found."""
        key = (service, type_id)
        if key not in self._found:
            named = ((profile, profile.find(type_id, service=service)) for profile in self.profiles)
            claims = [(profile, name) for profile, name in named if name]
            if len(claims) > 1:
                different: dict[int, tuple[Profile, str]] = {}
                for profile, name in claims:
                    different.setdefault(profile.signature(name), (profile, name))
                claims = list(different.values())
            self._found[key] = claims
        return self._found[key]

    @cached_property
    def _tables(self) -> dict[str, tuple[Profile, MessageKind, str]]:
        """Where each table comes from; a type that another one with its ID hides is left out."""
        tables: dict[str, tuple[Profile, MessageKind, str]] = {}
        for profile in self.profiles:
            for offer in profile.offers():
                if (profile, offer.full_name) in self._find(offer.type_id, service=offer.service):
                    for kind in KINDS[1:] if offer.service else KINDS[:1]:
                        name = f"{offer.name}.{kind.capitalize()}" if offer.service else offer.name
                        tables.setdefault(name, (profile, kind, offer.full_name))
        return tables

    @cached_property
    def _known(self) -> tuple[tuple[str, str], ...]:
        """Every name that can be asked for, with its table; the name of a service stands for both of its halves."""
        known = []
        for table, (profile, kind, full_name) in self._tables.items():
            names = (table, full_name, *(profile.aliases(full_name) if kind == "message" else ()))
            known += [(name, table) for name in names]
        return tuple(known)


def load(extra: Sequence[Path] = (), trusted: Collection[Path] = ()) -> Registry:
    """Return the dissectors of `extra` folders, of installed packages and of this package, in that order of precedence.

    An installed package offers a folder by an entry point of the group `analyzer.dissectors` whose value is its path.
    The folders in `extra` are compiled at once, so that their mistakes show here (`ProfileError`, `DsdlError`); all
    others are compiled when a type of theirs is asked for. No file outside these folders is read. Of the `extra` ones
    only those that are `trusted` may bring Python that runs; the others are data.
    """
    standard, vendors = _own_profiles()
    profiles = [Profile.open(Path(folder), standard.namespace, trusted=folder in trusted) for folder in extra]
    for profile in profiles:
        profile.dissector()
    profiles += [Profile.open(folder, standard.namespace) for folder in installed.folders()]
    return Registry([*profiles, *vendors, standard])


@cache
def _own_profiles() -> tuple[Profile, tuple[Profile, ...]]:
    """Return the standard types, and the vendors of this package: every other folder of it with a profile, by name.

    `_FIRST` goes before all of them. All registries of a process share them with what they have compiled.
    """
    standard = Profile.open(_HERE / _STANDARD)
    names = {path.parent.name for path in _HERE.glob("*/profile.toml")} - {_STANDARD}
    ordered = sorted(names, key=lambda name: (name != _FIRST, name))
    return standard, tuple(Profile.open(_HERE / name, standard.namespace) for name in ordered)
