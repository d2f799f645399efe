"""The kit of conformance rules: all that the rules of a vendor may use.

A dissector's folder may hold rules that join its own tables; `analyzer.rules` runs them beside those that hold for any
bus. Both sides speak in the terms of this package, so that neither imports the other. Times are integer nanoseconds,
frames and transfers are numbered through the whole capture from 0.

A rule reads a batch through its `View`: `FrameTable`, `TransferTable`, `EventTable`, and a `DecodedTable` for each
message and packet. It is a `Rule` (or a function that `rule` makes one), and gives an `Occurrence` for a breach, or
`Occurrences` for many. `Conformance` lists what a module brings.
"""

from __future__ import annotations

from dissectors.kit.array import Array
from dissectors.kit.clock import BusTimes, times_by_bus
from dissectors.kit.collection import rules_of
from dissectors.kit.conformance import Conformance, Exercise, Measures
from dissectors.kit.decoded import DecodedTable
from dissectors.kit.definitions import Types
from dissectors.kit.occurrence import Occurrence, Occurrences, Severity, Values, Worst
from dissectors.kit.order import by_key, changes, count_below, groups, last_set
from dissectors.kit.paces import Break, PacedReports
from dissectors.kit.pauses import Pauses
from dissectors.kit.resumed import all_resumed, resumptions
from dissectors.kit.rows import NODES, breach, doubtful, frames_of, rows_by_bus, sender, sound, usable
from dissectors.kit.rule import Feed, PageKeys, Rule, rule
from dissectors.kit.running import RunningTime
from dissectors.kit.series import Latest, Previous, set_back
from dissectors.kit.starts import Starts
from dissectors.kit.tables import EventTable, FrameTable, TransferTable
from dissectors.kit.view import SESSION, JointLoss, JointLosses, Kept, Second, Seconds, View
from dissectors.times import MICROSECOND, MILLISECOND, NO_TIME, SECOND

__all__ = [
    "MICROSECOND", "MILLISECOND", "NODES", "NO_TIME", "SECOND", "SESSION", "Array", "Break", "BusTimes", "Conformance",
    "DecodedTable", "EventTable", "Exercise", "Feed", "FrameTable", "JointLoss", "JointLosses", "Kept", "Latest",
    "Measures", "Occurrence", "Occurrences", "PacedReports", "PageKeys", "Pauses", "Previous", "Rule", "RunningTime",
    "Second", "Seconds", "Severity", "Starts", "TransferTable", "Types", "Values", "View", "Worst", "all_resumed",
    "breach", "by_key", "changes", "count_below", "doubtful", "frames_of", "groups", "last_set", "resumptions",
    "rows_by_bus", "rule", "rules_of", "sender", "set_back", "sound", "times_by_bus", "usable",
]  # fmt: skip
