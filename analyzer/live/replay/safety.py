"""Protection of real buses from accidents: motors have propellers.

Two questions: may anything real be at the other end of an interface (`find_doubt`), and would a frame move, release or
change something there (`Guard`). Both say yes when they cannot know.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.live.interfaces import links
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from dissectors.registry import Registry

_VIRTUAL = ("vcan", "vxcan")
# Frames that DroneCAN does not know are counted under this name.
FOREIGN = "no DroneCAN"
# Identifiers that are remembered.
_MOST = 1 << 16
_MESSAGE, _ANONYMOUS, _REQUEST, _RESPONSE = range(4)


def find_doubt(interface: str, channel: object, options: Mapping[str, object]) -> str:
    """Return why frames sent there may reach something real; empty if they cannot.

    They cannot on python-can's `virtual`, on `udp_multicast` with a hop limit of 0 (its datagrams then stay in this
    machine), and on a SocketCAN interface that the kernel itself calls vcan or vxcan, as long as every interface to
    which the kernel passes them on is one, too. A name proves nothing.
    """
    if interface == "virtual":
        return ""
    if interface == "udp_multicast":
        return "" if options.get("hop_limit") == 0 else "its datagrams leave this machine, unless hop_limit=0"
    if interface != "socketcan":
        return f"{interface} is no virtual interface"
    try:
        known = {link.index: link for link in links.list_links()}
        rules = links.list_gateways()
    except OSError as error:
        return f"what it is cannot be asked ({error.strerror or error})"
    start = next((index for index, link in known.items() if link.name == channel), None)
    if start is None:
        return "the kernel does not know it"
    return next(_suspects(start, known, rules), "")


@dataclass(frozen=True, slots=True)
class GuardOpinion:
    """The guard's opinion of a frame: the table name of its type, who seems to send it, and if it actuates."""

    name: str
    node: int | None
    actuates: bool


class Guard:
    """Judges frames by their identifiers; types that nobody knows count as actuating."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._known: dict[tuple[int, bool, bool], GuardOpinion] = {}

    def judge(self, number: int, *, extended: bool, remote: bool = False) -> GuardOpinion:
        """Judge a frame by its identifier without flags. A remote frame carries nothing, and does nothing."""
        key = (number, extended, remote)
        found = self._known.get(key)
        if found is None:
            if len(self._known) >= _MOST:
                self._known.clear()
            found = self._known[key] = self._judge(number) if extended else GuardOpinion(FOREIGN, None, actuates=True)
            if remote:
                found = self._known[key] = GuardOpinion(found.name, found.node, actuates=False)
        return found

    def _judge(self, number: int) -> GuardOpinion:
        node = number & 0x7F
        if number & 0x80:
            kind, type_id = (_REQUEST if number & 0x8000 else _RESPONSE), number >> 16 & 0xFF
        elif node:
            kind, type_id = _MESSAGE, number >> 8 & 0xFFFF
        else:
            kind, type_id = _ANONYMOUS, number >> 8 & 0x3
        variants = tuple(self._variants(kind, type_id))
        if kind == _ANONYMOUS and number >> 10 & 0x3FFF:
            # A receiver may take it for what it would be with a source, if that is known.
            variants = (*self._variants(_MESSAGE, number >> 8 & 0xFFFF), *variants)
        if not variants:
            return GuardOpinion(f"unknown {'service' if number & 0x80 else 'message'} {type_id}", node, actuates=True)
        return GuardOpinion(variants[0][0], node, actuates=any(actuates for _, actuates in variants))

    def _variants(self, kind: int, type_id: int) -> Iterator[tuple[str, bool]]:
        variant = 0
        while (message := self._registry.message(kind, type_id, variant)) is not None:
            yield message.table, message.actuates
            variant += 1


class Survey:
    """Actuating frames by sender and type."""

    def __init__(self) -> None:
        self._counts: dict[GuardOpinion, int] = {}

    def add(self, verdict: GuardOpinion, frames: int = 1) -> None:
        """Count so many frames, if they actuate."""
        if verdict.actuates:
            self._counts[verdict] = self._counts.get(verdict, 0) + frames

    def rows(self) -> list[tuple[str, str, int]]:
        """Return node (`-` if there is none), type and number of frames, by node."""
        found = [("-" if v.node is None else str(v.node), v.name, count) for v, count in self._counts.items()]
        return sorted(found, key=lambda row: (row[0].rjust(3), row[1]))


def _suspects(start: int, known: Mapping[int, links.Link], rules: list[tuple[int, int]]) -> Iterator[str]:
    """Give the reasons why an interface, or one that its frames go on to, may be real."""
    seen, todo = {start}, [start]
    while todo:
        index = todo.pop()
        link = known.get(index)
        through = "" if index == start else f"its frames go on to {link.name if link else 'another interface'}: "
        if link is None or link.kind not in _VIRTUAL:
            kind = link.kind if link else ""
            yield f"{through}{f'the kernel calls it {kind}' if kind else 'no kind is known of it'}, not vcan"
        elif link.elsewhere:
            yield f"{through}its other end is out of sight, in another network namespace"
        else:
            onward = {to for source, to in rules if source == index} | ({link.peer} if link.peer else set())
            todo += sorted(onward - seen)
            seen |= onward
