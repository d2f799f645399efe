"""A plugin of pytest: the tests of a rule go first, the quickest before the others, and a file gets what came of them.

    RULE=TRF-010 TIMES=times.json SAID=said.json pytest -p bench.mutate_order tests/rules/test_damage.py

`TIMES` are seconds by node ID from an earlier run. `SAID` gets those of this run, and the test that failed: the first
whose own statement did, before which the run does not end, else the first in which something else raised.
"""

from __future__ import annotations

import inspect
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pytest

_UNKNOWN = 1.0  # seconds of a test that has not run yet
_MOST = 10  # tests in which something raised, before the run ends
_times: dict[str, float] = {}
_raised: list[str] = []
_failed: list[str] = []
_session: list[pytest.Session] = []


def pytest_collection_modifyitems(session: pytest.Session, items: list[pytest.Item]) -> None:
    _session.append(session)
    rule, times = os.environ.get("RULE", ""), _read(os.environ.get("TIMES"))
    items.sort(key=lambda item: (_distance(item, rule), times.get(item.nodeid, _UNKNOWN)))


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    _times[report.nodeid] = _times.get(report.nodeid, 0.0) + report.duration
    if report.failed:
        crash = getattr(report.longrepr, "reprcrash", None)
        own = crash is not None and Path(crash.path).resolve().is_relative_to(Path(__file__).resolve().parents[1])
        (_failed if own else _raised).append(report.nodeid)
        if _failed or len(_raised) == _MOST:
            _session[0].shouldfail = "enough is known"


def pytest_sessionfinish() -> None:
    said = {"times": _times, "failed": next(iter(_failed + _raised), ""), "raised": not _failed}
    Path(os.environ["SAID"]).write_text(json.dumps(said), encoding="utf-8")


def _distance(item: Any, rule: str) -> int:
    """0 for a test with the rule in its ID, 1 for one with it in its source, 2 for any other."""
    if rule in item.nodeid:
        return 0
    return 1 if rule in inspect.getsource(item.function) else 2


def _read(path: str | None) -> dict[str, float]:
    times: dict[str, float] = json.loads(Path(path).read_text(encoding="utf-8"))["times"] if path else {}
    return times
