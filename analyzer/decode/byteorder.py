"""Which nodes send the numbers inside packets with the high byte first, found out from what else they send.

The document prints no byte order for packets (4.4.4, 4.4.5). Little-endian is assumed. A profile says which fields of a
packet show the same as a field of a message (`agrees`); a packet is evidence for one byte order when a field read that
way agrees with the node's latest message before it, and no field agrees read the other way alone. A number that reads
the same both ways proves nothing. Three proofs of big-endian without one of little-endian settle a node, and so does
one of little-endian: what is settled stays. Where packets can wait for the end of their batch, all of them are read as
the node turns out in it. Else big-endian starts with the packet after the third proof, and those before are marked as
undecided; that goes by row numbers, so it does not matter where the capture is cut into batches.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.decode.columns import NODES
from analyzer.decode.readings import FORCED, UNDECIDED, Statement
from analyzer.decode.told import ByNode
from dissectors.kit.cells import floats, numbers
from dissectors.schema import BYTE_ORDERS

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

    import pyarrow as pa

    from analyzer.decode.packets import FoundPackets
    from analyzer.decode.sent import SentMessages
    from dissectors.kit import Array
    from dissectors.schema import Agreement, Packet

    Read = Callable[[FoundPackets, Array], tuple[Mapping[str, pa.Array], ...]]

PROOFS = 3
READING = "byte order"


class ByteOrder:
    """The byte order of every (bus, node): what it last said, what its packets proved, where big-endian begins.

    State is bounded by the 65,536 pairs there are.

    Args:
        packets: every packet that a profile knows.
        forced: choices by node ID that stand against any proof.
        ahead: packets wait for the end of their batch.
    """

    def __init__(self, packets: Iterable[Packet], forced: Mapping[int, Collection[str]], *, ahead: bool) -> None:
        self._ahead, self._forced = ahead, forced
        self._watched: dict[str, dict[str, ByNode]] = {}  # message -> field -> latest value of earlier batches, by node
        for packet in packets:
            for _, agreement in _agreements(packet):
                latest = self._watched.setdefault(agreement.message, {})
                latest.setdefault(agreement.field, ByNode(np.float64))
        self._settled, self._big = np.zeros(NODES, bool), np.zeros(NODES, bool)
        self._since = ByNode()  # from which packet on
        self._proofs: dict[int, int] = {}  # of big-endian, for nodes that are not settled
        self._heard: dict[str, Array] = {}  # message -> nodes whose packets may prove something
        for node, choices in forced.items():
            for choice in set(choices) & set(BYTE_ORDERS):
                mine = np.arange(NODES) & 0xFF == node
                self._settled[mine], self._since[mine], self._big[mine] = True, 0, choice == BYTE_ORDERS[1]

    def learn(self, sent: Mapping[str, SentMessages], found: Sequence[FoundPackets], read: Read) -> None:
        """Take in one batch, all of its messages. `read` gives packets at some places, once in each byte order."""
        ballots = [ballot for one in found if (ballot := self._ballot(one, sent, read)) is not None]
        if ballots:
            nodes, positions, big = (np.concatenate(columns) for columns in zip(*ballots, strict=True))
            for node in np.unique(nodes[big]).tolist():
                mine = np.flatnonzero(nodes == node)
                mine = mine[np.argsort(positions[mine])]
                self._count(node, positions[mine], big[mine])
            little = ~big & ~self._settled[nodes]
            self._since.lower(nodes[little], positions[little])
            self._settled[nodes[little]] = True
        for name in self._watched.keys() & sent.keys():
            self._remember(name, sent[name])

    @property
    def waiting(self) -> bool:
        """True if packets came that may still be found to be of the other order."""
        return any((heard & ~self._settled).any() for heard in self._heard.values())

    def know(self, other: ByteOrder) -> None:
        """Take over what another one has settled."""
        self._settled, self._big = other._settled.copy(), other._big.copy()
        self._since[self._settled] = 0

    def statements(self) -> Iterator[Statement]:
        """Yield the byte order of each node whose packets may prove one."""
        for message, heard in self._heard.items():
            for code in np.flatnonzero(heard).tolist():
                bus, node = code >> 8, code & 0xFF
                choice = BYTE_ORDERS[int(self._big[code])] if self._settled[code] else UNDECIDED
                forced = FORCED if set(self._forced.get(node, ())) & set(BYTE_ORDERS) else ""
                yield Statement(message, READING, READING, bus, node, choice + forced)

    def decided(self, found: FoundPackets) -> Array:
        """Return the packets whose byte order is proved."""
        if self._ahead:
            proved: Array = self._settled[found.senders]
            return proved
        return np.asarray(found.positions >= self._since[found.senders])

    def big_endian(self, found: FoundPackets) -> Array:
        """Return the packets that are to be read big-endian."""
        big: Array = self._big[found.senders]
        return big & self.decided(found) if big.any() else big

    def _ballot(
        self, found: FoundPackets, sent: Mapping[str, SentMessages], read: Read
    ) -> tuple[Array, Array, Array] | None:
        """Yield (node, position, proves big-endian) of packets that prove something about a node not settled yet."""
        pairs = [] if found.packet is None else list(_agreements(found.packet))
        if found.packet is None or not pairs:
            return None
        heard = self._heard.setdefault(found.table.rpartition(".")[0], np.zeros(NODES, bool))
        heard[found.senders[found.sound]] = True
        rows = np.flatnonzero(found.sound & ~self._settled[found.senders])
        if not rows.size:
            return None
        nodes, readings = found.senders[rows], read(found, rows)
        proof = np.zeros((2, len(rows)), bool)
        for name, agreement in pairs:
            said = self._said(sent.get(agreement.message), agreement, nodes, found.positions[rows])
            near = [
                np.abs(numbers(reading[name]) - said) <= float(agreement.within) * np.abs(said) for reading in readings
            ]
            proof[0] |= near[0] & ~near[1]
            proof[1] |= near[1] & ~near[0]
        speaks = proof[0] != proof[1]
        return nodes[speaks], found.positions[rows][speaks], proof[1][speaks]

    def _said(self, sent: SentMessages | None, about: Agreement, nodes: Array, positions: Array) -> Array:
        """Return the value of the node's latest good message before each position, NaN if there is none."""
        values = self._watched[about.message][about.field][nodes]
        if sent is None:
            return values
        wanted = np.zeros(NODES, bool)
        wanted[nodes] = True
        table, rows, at_nodes = _good(sent, np.flatnonzero(sent.trusted & wanted[sent.senders]))
        if not rows.size:
            return values
        order = np.argsort(at_nodes, kind="stable")  # rows are in the order of their transfers already
        keys = _key(at_nodes[order], numbers(table.column("transfer"))[rows[order]])
        before = np.searchsorted(keys, _key(nodes, positions >> np.uint64(16))) - 1
        mine = (before >= 0) & (at_nodes[order][before] == nodes)
        values[mine] = numbers(table.column(about.field))[rows[order][before[mine]]]
        return values

    def _remember(self, name: str, sent: SentMessages) -> None:
        """Keep what each node has said last; of those that are settled nobody asks."""
        if self._settled[sent.nodes].all():
            return
        places = np.flatnonzero(sent.trusted & ~self._settled[sent.senders])
        _, behind = np.unique(sent.senders[places][::-1], return_index=True)
        last = places[len(places) - 1 - behind]
        table, rows, nodes = _good(sent, last)
        if len(rows) < len(last):  # one of them is too short: an earlier one counts
            table, rows, nodes = _good(sent, places)
        for field, latest in self._watched[name].items():
            latest[nodes] = floats(numbers(table.column(field))[rows])  # of several rows of one node the last one stays

    def _count(self, node: int, positions: Array, big: Array) -> None:
        """Take the proofs of one node in order, among them at least one of big-endian."""
        little = np.flatnonzero(~big)
        run = int(little[0]) if little.size else len(big)
        missing = PROOFS - self._proofs.pop(node, 0)
        if run >= missing:
            self._since[node] = positions[missing - 1] + np.uint64(1)
            self._settled[node] = self._big[node] = True
        elif not little.size:
            self._proofs[node] = PROOFS - missing + run


def _agreements(packet: Packet) -> Iterable[tuple[str, Agreement]]:
    return ((name, note.agrees) for name, note in packet.notes.items() if note.agrees is not None)


def _good(sent: SentMessages, places: Array) -> tuple[pa.RecordBatch, Array, Array]:
    """Return the table of some messages, its rows to which nothing is missing, and the nodes of these."""
    table = sent.table(places)
    rows = np.flatnonzero(numbers(table.column("bits_left")) >= 0)
    return table, rows, sent.senders[places][rows]


def _key(nodes: Array, transfers: Array) -> Array:
    return nodes.astype(np.uint64) << np.uint64(48) | transfers
