"""The target of a recording, and how it is written."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.records import dataclass

if TYPE_CHECKING:
    from analyzer.live.recording.ring import RingPlan


@dataclass(frozen=True, slots=True)
class RecordingPlan:
    """The target of a recording, and how it is written.

    Args:
        path: `-w`; with a ring the files are named after it.
        form: one of `analyzer.sinks.FORMS`.
        packing: `gzip`, `zstd` or nothing.
        compression: of MCAP chunks, one of `analyzer.sinks.COMPRESSIONS`.
        ring: when a new file begins; None if never.
        force: write over a file that exists; otherwise that is refused.
        files: after so many files no new one begins, the last one takes the rest; None if there is no such limit.
        header: a comment in front of every file; empty for none.
    """

    path: str
    form: str
    packing: str = ""
    compression: str = "zstd"
    ring: RingPlan | None = None
    force: bool = False
    files: int | None = None
    header: str = ""
