"""Faults of identifiers that only T-Motor's types can show: their priority, a deleted type, an ID taken twice."""

from __future__ import annotations

from dissectors.layout import ArrayType, CompoundType, Member, PrimitiveType
from dissectors.schema import Message
from dissectors.traffic import LOWEST, Case, Fault, Sending, Step, next_id, of

_LISTED = of("RawCommand", "ParamCfg", "ESCStatus", "PUSHSCI", "PUSHCAN", "ParamGet")
# Programs written for V2.3 of the protocol send this under the ID of uavcan.equipment.ahrs.Solution.
CLOUD_LINK = Message(
    "CloudLink",
    "com.tmotor.esc.CloudLink",
    "message",
    1000,
    0x1362AB78CD12F03A,
    CompoundType("CloudLink", (Member("data", ArrayType(PrimitiveType("uint", 8), 255, dynamic=True)),)),
)
# Its first two bytes, and where the other type of this ID has array lengths, which are left at 0: as long as the
# shortest one of that, it can be read either way.
_MAGIC, _LENGTH, _ZEROS = b"\xcd\xab", 29, (15, 22)


def _priority(case: Case, sending: Sending) -> Step:
    """Change the priority of the types that have the lowest one (4.3.1)."""
    priority = int(case.options["priority"]) & LOWEST
    if priority == LOWEST or not _LISTED(sending):
        return Step.SKIP
    sending.priority = priority
    case.say(f"a transfer was sent with priority {priority} instead of {LOWEST}")
    return Step.DONE


def _deleted(case: Case) -> None:
    """Let the ground station send what V2.2 no longer has; no ESC obeys."""
    index = case.random.randrange(len(case.vehicle.escs))
    values = {"esc_index": index, "esc_mode": 0, "esc_fdb_rate": 0, "esc_cmd": 0, "esc_cmd_val": 0}
    case.say(f"node {case.vehicle.ground.number} sends a FocCtrl for index {index}, a type that V2.2 has deleted")
    case.mark(case.vehicle.ground.send("com.tmotor.esc.FocCtrl", values))


def _taken(case: Case) -> None:
    """Send small bytes: read as the other type they are ordinary numbers."""
    node = case.vehicle.escs[0].node if case.options.get("node") is None else case.world.node(int(case.options["node"]))
    node = node or case.vehicle.ground
    data = bytearray(case.random.randrange(0x40) for _ in range(_LENGTH))
    data[: len(_MAGIC)] = _MAGIC
    for at in _ZEROS:
        data[at] = 0
    transfer_id = next_id(node, CLOUD_LINK.table)
    sending = Sending(
        node.number, CLOUD_LINK, {"data": bytes(data)}, None, LOWEST, transfer_id, CLOUD_LINK.signature, changed=True
    )
    case.say(
        f"message type {CLOUD_LINK.type_id} with the signature {CLOUD_LINK.signature:016X}, "
        "which is not that of uavcan.equipment.ahrs.Solution"
    )
    case.mark(sending)
    case.world.send(sending)


FAULTS: tuple[Fault, ...] = (
    Fault(
        "CAN-013",
        "a transfer whose priority is not the lowest",
        transfer=_priority,
        fits=of("ESCStatus"),
        options={"priority": 16},
        harmless=True,
    ),
    Fault("CAN-016", "a FocCtrl, which V2.2 has deleted", start=_deleted, also=("CAN-017",)),
    Fault(
        "CAN-020",
        "two types share a data type ID: 1000 with another signature than that of uavcan.equipment.ahrs.Solution",
        start=_taken,
        also=("TRF-010", "TRF-011"),
    ),
)
