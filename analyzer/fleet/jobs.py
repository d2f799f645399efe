"""The request of a fleet run: settings that decide the results, and one job a capture."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import dissectors
from analyzer.app.criteria import Criteria
from analyzer.app.request import RuleChoice
from analyzer.app.version import version
from dissectors.records import as_dict, dataclass, field

# What decides the verdict of a rule, but for its code, which the version of the program stands for.
_OF_A_RULE = (
    "severity",
    "category",
    "origin",
    "enabled",
    "text",
    "settings",
    "exercised",
    "inconclusive",
    "drops",
    "event",
)


@dataclass(frozen=True, slots=True)
class FleetSettings:
    """All that decides what is found in a capture. The Python of `trusted` folders runs on the workers."""

    rules: RuleChoice = field(default_factory=RuleChoice)
    dissectors: tuple[Path, ...] = ()
    trusted: tuple[Path, ...] = ()

    def chosen(self) -> dict[str, Any]:
        """Return them as plain data."""
        return {**as_dict(self.rules), "dissectors": [str(one) for one in self.dissectors]}

    def digest(self) -> str:
        """Return a hash of them, of the files that they name, and of all rules. Raises as `Criteria` does."""
        criteria = Criteria(self.rules, dissectors.load(self.dissectors, self.trusted))
        sha = hashlib.sha256(json.dumps(self.chosen(), sort_keys=True, default=str).encode())
        pages = {name: [str(getattr(page, one)) for one in _OF_A_RULE] for name, page in criteria.pages.items()}
        sha.update(json.dumps(pages, sort_keys=True).encode())
        for path in sorted(self._files()):
            sha.update(path.read_bytes())
        return sha.hexdigest()[:16]

    def _files(self) -> list[Path]:
        named = [Path(one) for one in (self.rules.vehicle, self.rules.baseline) if one is not None]
        own = [path for folder in self.dissectors for path in folder.rglob("*") if path.is_file()]
        return named + [path for path in own if "__pycache__" not in path.parts]


@dataclass(frozen=True, slots=True)
class Retries:
    """How often a capture is opened that cannot be read now, and the pause in seconds, doubled each time."""

    attempts: int = 4
    pause: float = 0.5


@dataclass(frozen=True, slots=True)
class Job:
    """One capture to be judged. `run` is the number of the run, the rest is as in the table `captures`."""

    url: str
    etag: str
    size: int | None
    vehicle: str
    date: str
    settings: str
    run: str = ""
    version: str = field(default_factory=version)

    @property
    def key(self) -> str:
        """A text that is the same for the same bytes, version and settings."""
        named = f"{self.url}\0{self.etag}\0{self.version}\0{self.settings}"
        return hashlib.sha256(named.encode("utf-8", "surrogateescape")).hexdigest()[:32]
