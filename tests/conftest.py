"""What the tests share: a capture run through the engine, its tables as plain rows."""

from __future__ import annotations

import ctypes
import gc
import signal
import sys
import time
from collections import Counter
from functools import _lru_cache_wrapper, cached_property
from typing import TYPE_CHECKING, Any
from zlib import crc32

import can
import can.util
import kit.strategies  # noqa: F401 - its profiles of hypothesis
import pyarrow as pa
import pytest
from hypothesis import settings

import dissectors
from analyzer.cli import main
from analyzer.decode.engine import Batch, Engine
from analyzer.tables import EVENTS, FRAME_ANOMALIES, KINDS, STATUSES, TRANSFER_ANOMALIES, VERDICTS
from analyzer.views import times

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator

    from dissectors.registry import Registry


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--regenerate", action="store_true", help="write captures/*.expected anew")
    parser.addoption("--seed", type=int, default=1, help="of the flights of a campaign; .ci/full goes through 1 to 25")
    parser.addoption("--share", type=int, default=1, help="of what is sampled, run one in so many, chosen by the seed")
    parser.addoption("--all-examples", action="store_true", help="try laws as often as they say, not a fifth of it")


def pytest_configure(config: pytest.Config) -> None:
    """Choose how often laws are tried, and hear signals.

    Shells start background jobs deaf to Ctrl-C or to hanging up, and what the tests start would be, too.
    """
    settings.load_profile("all" if config.getoption("--all-examples") else "sample")
    usual = {signal.SIGINT: signal.default_int_handler, signal.SIGHUP: signal.SIG_DFL}
    for number, handler in usual.items():
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, handler)


def pytest_itemcollected(item: pytest.Item) -> None:
    """Mark what hypothesis tries, so that all of its examples can be asked for."""
    if getattr(getattr(item, "obj", None), "is_hypothesis_test", False):
        item.add_marker("law")


def pytest_collection_finish() -> None:
    """Hide from the garbage collector what lives to the end: looking through it costs more than many tests."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown() -> Generator[None]:
    """Go back to the zone of this machine after a test that had another one."""
    yield
    time.tzset()
    times._day.cache_clear()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Make parameters of `sampled` tests slow, all but the first and each so-manieth after it.

    With `--share N` only one in N of those that became slow is left, one in N of the parameters of other slow tests,
    but for laws and proofs, and every third one of those without parameters: others for each seed. The guest, which
    takes longest and waits most of the time, begins at once.
    """
    items.sort(key=lambda item: item.path.name != GUEST)
    share, seed = config.getoption("--share"), config.getoption("--seed")
    seen: Counter[str] = Counter()
    spared: set[pytest.Item] = set()
    for item in items:
        sampled = item.get_closest_marker("sampled")
        if sampled is not None:
            name = item.nodeid.partition("[")[0]
            if seen[name] % sampled.args[0]:
                item.add_marker("slow")
                if not item.get_closest_marker("proof") and crc32(item.nodeid.encode()) % share != seed % share:
                    spared.add(item)
            seen[name] += 1
        elif share > 1 and _waits_its_turn(item):
            turns = share if hasattr(item, "callspec") else 3
            if crc32(item.nodeid.encode()) % turns != seed % turns:
                spared.add(item)
    if spared:
        config.hook.pytest_deselected(items=list(spared))
        items[:] = [item for item in items if item not in spared]


def _waits_its_turn(item: pytest.Item) -> bool:
    always = item.path.name == GUEST or any(map(item.get_closest_marker, ("law", "proof")))
    return item.get_closest_marker("slow") is not None and not always


GUEST = "test_socketcan.py"
# Modules that keep flights for the tests that share them.
HOLDING = ("kit.simulated", "witness.can", "witness.push_form", "witness.views")
FLUSH = object()  # among the chunks: ask for a batch


def names(bits: int, of: tuple[str, ...]) -> set[str]:
    assert bits >> len(of) == 0
    return {name for bit, name in enumerate(of) if bits >> bit & 1}


def rows_of(batch: pa.RecordBatch) -> list[dict[str, Any]]:
    """Rows as dictionaries, times and durations as integer nanoseconds."""
    batch.validate(full=True)
    columns = {}
    for field, column in zip(batch.schema, batch.columns, strict=True):
        timed = pa.types.is_timestamp(field.type) or pa.types.is_duration(field.type)
        columns[field.name] = (column.cast(pa.int64()) if timed else column).to_pylist()
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


class Decoded:
    """A whole capture: rows of every table, codes replaced by their texts; frame numbers from 0 as in the tables."""

    def __init__(self, batches: Iterable[Batch], engine: Engine) -> None:
        self.batches, self.engine = list(batches), engine
        first_frame = first_transfer = 0
        for batch in self.batches:
            assert (batch.first_frame, batch.first_transfer) == (first_frame, first_transfer)
            first_frame += len(batch.frames)
            first_transfer += len(batch.transfers)

    @cached_property
    def frames(self) -> list[dict[str, Any]]:
        """Verdicts and anomalies are the final ones."""
        out: list[dict[str, Any]] = []
        before = 0
        for batch in self.batches:
            out += rows_of(batch.frames)
            for settled in rows_of(batch.settled):
                assert before <= settled["frame"] < batch.first_frame
                row = out[settled["frame"]]
                row["verdict"] = settled["verdict"]
                row["anomaly"] |= settled["anomaly"]
            assert before <= batch.settled_before <= len(out)
            before = batch.settled_before
        for row in out:
            row["verdict"] = VERDICTS[row["verdict"]]
            row["anomaly"] = names(row["anomaly"], FRAME_ANOMALIES)
        return out

    @cached_property
    def transfers(self) -> list[dict[str, Any]]:
        out = [row for batch in self.batches for row in rows_of(batch.transfers)]
        for row in out:
            row["kind"], row["status"] = KINDS[row["kind"]], STATUSES[row["status"]]
            row["anomaly"] = names(row["anomaly"], TRANSFER_ANOMALIES)
        return out

    @cached_property
    def events(self) -> list[dict[str, Any]]:
        out = [row for batch in self.batches for row in rows_of(batch.events)]
        return [row | {"kind": EVENTS[row["kind"]]} for row in out]

    @cached_property
    def messages(self) -> dict[str, list[dict[str, Any]]]:
        out: dict[str, list[dict[str, Any]]] = {}
        for batch in self.batches:
            for name, table in batch.messages.items():
                out.setdefault(name, []).extend(rows_of(table))
        return out

    @cached_property
    def verdicts(self) -> list[str]:
        return [row["verdict"] for row in self.frames]

    def message_of(self, transfer: int) -> tuple[str, dict[str, Any]] | None:
        """Name and row of what transfer row `transfer` carries; packets inside it are not counted."""
        return self._by_transfer.get(transfer)

    @cached_property
    def _by_transfer(self) -> dict[int, tuple[str, dict[str, Any]]]:
        pairs = [(row["transfer"], (name, row)) for name, rows in self.messages.items() for row in rows]
        pairs = [(number, found) for number, found in pairs if "bits_left" in found[1]]
        assert len(dict(pairs)) == len(pairs), "two messages of one transfer"
        return dict(pairs)

    def check_conservation(self) -> None:
        """Every line and every frame is accounted for, once."""
        totals = self.engine.totals
        assert totals.balanced, totals
        assert totals.verdicts == {name: self.verdicts.count(name) for name in VERDICTS}
        named = [number for row in self.transfers for number in row["frame"]]
        assert sorted(named) == [number for number, verdict in enumerate(self.verdicts) if verdict == "used"]
        counted = {"error frame": "error_frames", "drop": "drops", "comment": "comments", "unreadable": "unreadable"}
        for kind, part in counted.items():
            assert sum(row["kind"] == kind for row in self.events) == totals.lines[part], kind
        assert totals.lines["frames"] == len(self.frames)


@pytest.fixture(scope="module", autouse=True)
def forget(request: pytest.FixtureRequest) -> Iterator[None]:
    """Drop the flights of a module behind its last test: a worker would keep those of all of them."""
    yield
    for module in (request.module, *map(sys.modules.get, HOLDING)):
        for value in vars(module).values() if module else ():
            if isinstance(value, _lru_cache_wrapper) and value.__module__ == module.__name__:
                value.cache_clear()
    gc.collect()
    pa.default_memory_pool().release_unused()
    if sys.platform == "linux":
        ctypes.CDLL(None).malloc_trim(0)


@pytest.fixture(scope="session")
def registry() -> Registry:
    return dissectors.load()


@pytest.fixture(scope="session")
def flush() -> object:
    """Stands between two chunks for a batch that is asked for early."""
    return FLUSH


@pytest.fixture(scope="session")
def decode(registry: Registry) -> Callable[..., Decoded]:
    """Runs chunks of candump text (or one) through an engine of its own; the laws of conservation hold in every run."""

    def run(*chunks: bytes | object, types: Registry = registry, **how: Any) -> Decoded:
        engine = Engine(types, **how)

        def batches() -> Iterator[Batch]:
            for chunk in chunks:
                if chunk is FLUSH:
                    yield from engine.flushed()
                else:
                    yield from engine.feed(chunk)
            yield from engine.end()

        got = Decoded(batches(), engine)
        got.check_conservation()
        return got

    return run


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Runs in this process: status, output, complaints."""

    def call(*args: object) -> tuple[int, str, str]:
        handler = signal.getsignal(signal.SIGINT)
        status = main([str(arg) for arg in args])
        signal.signal(signal.SIGINT, handler)  # a command that was interrupted is deaf from then on
        return status, *capsys.readouterr()

    return call


@pytest.fixture
def no_can_configuration(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever this machine has configured for python-can."""
    monkeypatch.setattr(can.util, "CONFIG_FILES", [])
    for name in ("CAN_INTERFACE", "CAN_CHANNEL", "CAN_BITRATE", "CAN_CONFIG"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def receiver() -> Iterator[can.BusABC]:
    """The other end of `virtual:here`."""
    with can.Bus("here", interface="virtual", ignore_config=True) as bus:
        yield bus


@pytest.fixture
def real(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Whatever is opened from now on is the virtual bus; the list says as what."""
    opened: list[dict[str, Any]] = []

    def open_(**config: Any) -> can.BusABC:
        opened.append(config)
        return can.interface.Bus("here", interface="virtual", ignore_config=True)

    monkeypatch.setattr(can, "Bus", open_)
    return opened
