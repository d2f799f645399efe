"""The traffic of a vehicle, its senders, and the world in which that happens."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Callable
    from random import Random

    from dissectors.schema import Message

Values = dict[str, Any]

# The lowest priority that there is (4.1.2).
LOWEST = 31


class Code(int):
    """A float given as its raw code, for what no number can say."""


@dataclass(slots=True, eq=False)
class SimulatedFrame:
    """One CAN frame, from the moment somebody wants to send it until it is recorded.

    `id` has 29 bits, or 11 unless `extended`. An `error` frame is what a controller reports: `id` is its error class
    (linux/can/error.h). `dlc` is the length that a remote frame asks for. It competes for the bus from `delay` ns after
    its transfer was sent, or takes its turn at once on interface `bus` 1, which has no other traffic. `lost` means on
    the bus but not recorded, `garbled` that only half of its line is; its stamp is `shift` ns too early. `t` (end of
    frame) and `number` (from 1; error frames have none) are set when recorded.
    """

    id: int
    data: bytes
    extended: bool = True
    remote: bool = False
    error: bool = False
    fd: bool = False
    brs: bool = False
    dlc: int | None = None
    delay: int = 0
    bus: int = 0
    lost: bool = False
    garbled: bool = False
    shift: int = 0
    sending: Sending | None = None
    answers: tuple[Answer, ...] = ()
    t: int = -1
    number: int = 0


@dataclass(slots=True, eq=False)
class Sending:
    """One transfer on its way: `values` become `payload`, the payload becomes `frames`.

    `values` has the raw value of every field by its DSDL name (a union by its active member). `signature` seeds the
    transfer CRC, which stands only in transfers of several frames. Who listens gets the values as they were sent,
    unless it was `damaged`. What a fault has `changed` on its way to the frames is left alone by others. `answers` list
    all of its frames.
    """

    node: int
    message: Message
    values: Values
    dst: int | None
    priority: int
    transfer_id: int
    signature: int
    anonymous: bool = False
    payload: bytes = b""
    frames: list[SimulatedFrame] = field(default_factory=list)
    damaged: bool = False
    changed: bool = False
    answers: tuple[Answer, ...] = ()
    t: int = 0

    @property
    def name(self) -> str:
        """The table name of its type: `ESCStatus`, `uavcan.protocol.GetNodeInfo.Request`."""
        return self.message.table


@dataclass(slots=True, eq=False)
class Answer:
    """One entry of the answer key. `frames` are frame numbers from 1, `lines` those of error frames in the file.

    Of a fault that lasts for hours the first are listed; `more` counts the others.
    """

    rule: str
    t: int
    done: str
    node: int | None = None
    type: str = ""
    also: tuple[str, ...] = ()
    t_end: int = -1
    frames: list[int] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    more: int = 0


class BusNode(Protocol):
    """A device on the bus, with running transfer IDs, NodeStatus and an answer to GetNodeInfo.

    `transfer_ids` has the next one by table name and destination. What it sends while it is `cut` off reaches nobody.
    """

    number: int
    health: int
    mode: int
    silent: bool
    cut: bool
    transfer_ids: dict[tuple[str, int | None], int]

    @property
    def introduction(self) -> Values:
        """The values of its answer to GetNodeInfo."""

    def send(
        self,
        name: str,
        values: Values,
        *,
        dst: int | None = None,
        priority: int | None = None,
        transfer_id: int | None = None,
    ) -> Sending:
        """Send a message, a request or a response now; `transfer_id` overrides the counter, as a response must."""

    def restart(self) -> None:
        """Cycle the power: transfer IDs and uptime start from zero."""


class World(Protocol):
    """The bus, its clock and its dice."""

    now: int
    end: int
    bit_rate: int
    random: Random

    def at(self, t: int, call: Callable[[], object]) -> None:
        """Call at time `t`, or now if that is over."""

    def every(self, period: int, call: Callable[[], object], first: int = 0) -> None:
        """Call at `first` and every `period` ns from then on."""

    def device(self, number: int, name: str, *, silent: bool = False) -> BusNode:
        """Put a device on the bus; while `silent` it sends nothing, whatever it is told."""

    def node(self, number: int) -> BusNode | None:
        """Return the device with a number, the first one of several."""

    def send(self, sending: Sending) -> None:
        """Send a transfer that no device has built."""

    def copy(self, call: Callable[[SimulatedFrame], SimulatedFrame | None] | None) -> None:
        """Record what `call` makes of every frame on the bus right behind it: a second interface."""

    def allocate(self, server: int, number: int, call: Callable[[], object]) -> None:
        """Have a silent device ask the device `server` for its node ID, and call once it speaks by it."""

    def hear(self, name: str, call: Callable[[Sending], object]) -> None:
        """Call with every undamaged transfer of a type, at the end of its last frame."""

    def stamp(self) -> int:
        """Return what the recorder's clock says now."""

    def put(self, frames: list[SimulatedFrame], sending: Sending | None = None) -> None:
        """Let frames that are no device's regular traffic compete for the bus from now on."""

    def cut(self, frame: SimulatedFrame) -> None:
        """End the recording behind this frame."""

    def deafen(self, until: int) -> None:
        """Record nothing that ends before `until`; the bus goes on."""

    def step_clock(self, by: int) -> None:
        """Set the recorder's clock by so many ns, ahead or back, for all that comes."""

    def stop(self) -> None:
        """End the recording now."""

    def block(self, until: int, *, keep: bool = False) -> None:
        """Let nothing be sent before `until`; what waits now is given up, or waits on to `keep` it."""

    def message(self, name: str) -> Message:
        """Return the data type of a name."""


def next_id(node: BusNode, table: str, dst: int | None = None) -> int:
    """Return the transfer ID of a node's next transfer of a type, which is then taken."""
    found = node.transfer_ids.get((table, dst), 0)
    node.transfer_ids[table, dst] = (found + 1) % 32
    return found
