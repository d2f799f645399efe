"""Fields as a filter knows them: where its values come from, and what they can be compared with."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from analyzer.tables import KINDS, STATUSES
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Mapping

Sort = Literal["number", "flag", "text", "bytes", "moment", "duration"]
# Of transfers, of frames, of message tables; a type that is there; and what has to be found out in other ways.
Origin = Literal["transfer", "frame", "table", "type", "node", "channel", "unit", "label", "finding"]


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of values: the things that they can be compared with.

    `texts` name numbers; if they are `closed`, others are mistakes. `special` are numbers that stand for no number.
    `low` and `high` are what the field can hold. `mask` are the bits that say whether a word of flags is set.
    An `octet` is written as a byte is: two digits are hexadecimal. Lists have at `most` so many elements, bytes as
    many of them; 0 for one number, and for bytes of which nobody knows. Bytes with a `size` are as many, or missing.
    """

    sort: Sort
    unit: str = ""
    texts: Mapping[float, tuple[str, ...]] = field(default_factory=dict)
    closed: bool = False
    special: tuple[float, ...] = ()
    low: float | None = None
    high: float | None = None
    whole: bool = False
    mask: int = 0
    octet: bool = False
    most: int = 0
    size: int = 0

    @property
    def numeric(self) -> bool:
        """True for what can be added."""
        return self.sort in ("number", "duration", "flag")


@dataclass(frozen=True, slots=True)
class FieldRef:
    """A field or type that a filter names.

    `column` is that of its table, `path` leads into structures. Several `tables` have it if its name fits them all.
    """

    name: str
    origin: Origin
    kind: Kind
    column: str = ""
    tables: tuple[str, ...] = ()
    path: tuple[str, ...] = ()
    about: str = ""
    clause: str = ""

    @property
    def key(self) -> tuple[object, ...]:
        """Where its values come from."""
        return self.origin, self.column, self.tables, self.path


def _whole(high: int, low: int = 0) -> Kind:
    return Kind("number", whole=True, low=low, high=high)


FLAG, TEXT, BYTES, MOMENT, DURATION = Kind("flag"), Kind("text"), Kind("bytes"), Kind("moment"), Kind("duration", "s")
PRESENT = Kind("flag")


def _words(words: tuple[str, ...]) -> Kind:
    return Kind("text", texts={code: (word,) for code, word in enumerate(words)}, closed=True)


_NODE, _ID, _DATA = _whole(127), _whole((1 << 29) - 1), Kind("bytes", most=64)
_SEVERITIES = Kind("text", texts={0: ("error",), 1: ("warning",), 2: ("note",)}, closed=True)
FIXED = {
    ref.name: ref
    for ref in (
        FieldRef("frame.number", "frame", _whole((1 << 63) - 1), "number", about="number of the frame, from 1"),
        FieldRef("frame.time", "frame", MOMENT, "t", about='time: "12:49:54.89", "2026-03-14 12:49:54" or with Z'),
        FieldRef("frame.time_epoch", "frame", MOMENT, "epoch", about="seconds since 1970"),
        FieldRef("frame.time_relative", "frame", DURATION, "relative", about="time since the first frame"),
        FieldRef("frame.time_delta", "frame", DURATION, "delta", about="time since the row before"),
        FieldRef("frame.interface_name", "frame", TEXT, "bus", about="interface"),
        FieldRef("frame.data", "frame", _DATA, "data", about="bytes of the frame, tail byte included"),
        FieldRef("data.data", "frame", _DATA, "data", about="the same"),
        FieldRef("can.id", "frame", _ID, "id", about="identifier"),
        FieldRef("can.len", "frame", _whole(64), "len", about="data bytes, tail byte included"),
        FieldRef("can.flags.xtd", "frame", FLAG, "xtd", about="29-bit identifier"),
        FieldRef("can.flags.rtr", "frame", FLAG, "rtr", about="remote frame"),
        FieldRef("can.flags.err", "frame", FLAG, "err", about="error frame"),
        FieldRef("dronecan.src", "transfer", _NODE, "src", about="source node; 0 when anonymous"),
        FieldRef("dronecan.dst", "transfer", _NODE, "dst", about="destination node of a service"),
        FieldRef("dronecan.priority", "transfer", _whole(31), "priority", about="0 is highest"),
        FieldRef("dronecan.type_id", "transfer", _whole(65535), "type_id", about="data type ID"),
        FieldRef("dronecan.type", "transfer", TEXT, "type", about="data type"),
        FieldRef("dronecan.kind", "transfer", _words(KINDS), "kind", about="message, anonymous, request or response"),
        FieldRef("dronecan.transfer_id", "transfer", _whole(31), "transfer_id", about="transfer ID"),
        FieldRef("dronecan.status", "transfer", _words(STATUSES), "status", about="what became of the transfer"),
        FieldRef("payload", "transfer", BYTES, "payload", about="bytes of the transfer, without CRC and tail bytes"),
        FieldRef("src", "transfer", _NODE, "src", about="short for dronecan.src"),
        FieldRef("dst", "transfer", _NODE, "dst", about="short for dronecan.dst"),
        FieldRef("node", "node", _NODE, "node", about="source or destination"),
        FieldRef("node.label", "label", TEXT, "label", about="label of the node in the vehicle file"),
        FieldRef("ch", "channel", _whole(255, 1), "ch", about="ESC as people count them, from 1"),
        FieldRef("unit", "unit", _whole(254, 1), "unit", about="power unit of a packet, from 1"),
        FieldRef("finding.rule", "finding", TEXT, "rule", about="rule of a finding that names a frame of the row"),
        FieldRef("finding.severity", "finding", _SEVERITIES, "severity", about="error, warning or note"),
    )
}  # fmt: skip

# Names of the same thing in tshark, can-utils and elsewhere, and what they may be here.
_WORDS = {
    "can": ("can.id",),
    "can_id canid id identifier can.identifier can.can_id arbitration_id": ("can.id",),
    "frame": ("frame.data", "frame.number"),
    "frame.len frame.cap_len can.dlc can.length dlc len length": ("can.len",),
    "data can.data frame.raw frame.bytes raw": ("frame.data", "payload"),
    "can.ext can.eff can.xtd can.flags.ext can.flags.eff": ("can.flags.xtd",),
    "can.error can.err": ("can.flags.err",),
    "bus interface iface dev can.bus can.interface can.channel frame.interface frame.interface_id": (
        "frame.interface_name",
    ),
    "time": ("frame.time_relative", "frame.time"),
    "frame.time_delta_displayed delta": ("frame.time_delta",),
    "timestamp epoch": ("frame.time_epoch",),
    "esc channel motor": ("ch",),
    "source sender from source_node source_node_id dronecan.source dronecan.source_node uavcan.source_node_id": (
        "src",
    ),
    "dest destination target to dronecan.destination uavcan.dst uavcan.destination_node_id": ("dst",),
    "node.id node_id nid node_addr dronecan.node dronecan.node_id uavcan.node_id": ("node",),
    "dronecan uavcan protocol type msg message dronecan.msg dronecan.message frame.protocols": ("dronecan.type",),
    "dronecan.data_type_id data_type_id dtid": ("dronecan.type_id",),
    "tid dronecan.tid": ("dronecan.transfer_id",),
    "status state": ("dronecan.status",),
    "malformed _ws.malformed bad broken": ("dronecan.status",),
    "expert _ws.expert expert.message _ws.expert.message error warning": ("finding.severity", "finding.rule"),
    "expert.severity _ws.expert.severity": ("finding.severity",),
    "label node.name": ("node.label",),
}
MEANT = {word: names for words, names in _WORDS.items() for word in words.split()}

# What Wireshark filters by and nothing here has, by the beginning of the name, and what helps instead.
_COMMENTS = "comments are shown, by both lists of `decode` and by `view`: no filter asks for them"
ELSEWHERE = {
    "_ws.col.": "what a column says is made of fields: ask for one, TYPE.FIELD, or search with / in `view`",
    "_ws.": "it is Wireshark's own; findings are finding.rule and finding.severity, broken transfers dronecan.status",
    "frame.comment": _COMMENTS,
    "pkt_comment": _COMMENTS,
    "frame.mark": "marks are of `view`: ( and ) go to the one before and behind",
    "frame.ignore": "no frame is ever left out here",
    "frame.color": "colours are given by filters, they are none: tailbyte help colours",
}
