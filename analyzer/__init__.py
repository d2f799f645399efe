"""tailbyte: a bus analyzer for TM-UAVCAN and DroneCAN. Capture -> frames -> transfers -> messages -> views.

    import analyzer
    for batch in analyzer.open_capture("flight.log"):
        print(batch.transfers.num_rows, batch.messages.keys())

    report = analyzer.check("flight.log")
    print([finding.text for finding in report.findings if finding.fails])

`analyzer.tables` documents every column, `analyzer.report.model` every attribute of a report.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from analyzer.app.capture import Capture as Capture
    from analyzer.app.capture import open_capture as open_capture
    from analyzer.app.check import check as check
    from analyzer.app.diff import diff as diff
    from analyzer.app.schemas import schema as schema
    from analyzer.app.triage import triage as triage
    from analyzer.decode.engine import Batch as Batch
    from analyzer.decode.engine import Engine as Engine
    from analyzer.flight.verdict.model import Triage as Triage
    from analyzer.report.comparison.model import CaptureDiff as CaptureDiff
    from analyzer.report.model import Report as Report
    from analyzer.sources import CaptureError as CaptureError
    from analyzer.sources import UnavailableError as UnavailableError

__all__ = [
    "Batch",
    "Capture",
    "CaptureDiff",
    "CaptureError",
    "Engine",
    "Report",
    "Triage",
    "UnavailableError",
    "check",
    "diff",
    "open_capture",
    "schema",
    "triage",
]  # fmt: skip

_HOMES = {
    "Batch": "analyzer.decode.engine",
    "Capture": "analyzer.app.capture",
    "CaptureError": "analyzer.sources",
    "CaptureDiff": "analyzer.report.comparison.model",
    "Engine": "analyzer.decode.engine",
    "Report": "analyzer.report.model",
    "Triage": "analyzer.flight.verdict.model",
    "UnavailableError": "analyzer.sources",
    "check": "analyzer.app.check",
    "diff": "analyzer.app.diff",
    "open_capture": "analyzer.app.capture",
    "schema": "analyzer.app.schemas",
    "triage": "analyzer.app.triage",
}


def __getattr__(name: str) -> Any:
    # The command line must start without pyarrow, so the API is loaded when it is first asked for.
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module  # noqa: PLC0415

    return getattr(import_module(_HOMES[name]), name)
