"""What a command imports before it starts, and what it does with the process it is in."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from importlib import metadata

import pytest
from kit.command import HOVER, LIMIT, environment

from analyzer.app.version import UNKNOWN, version

CORE = {"numpy", "pyarrow", "analyzer._native"}
LIBRARIES = {"pandas", "can", "rerun", "mcap", "google.protobuf", "dronecan", "textual", "jinja2"}
UNUSED = {"pyarrow.vendored.docscrape", "numpy.ma.core"}  # parts of numpy and Arrow
PARSERS = {"tomllib", "importlib.metadata"}
NOT_LIVE = {
    "_ssl",
    "wrapt",
    "can.io.asc",
    "analyzer.views.writers",
    "analyzer.views.listing",
}  # of a bus without a list
HELP = LIBRARIES | CORE | {"dissectors", "dataclasses", "inspect", "pathlib", "tomllib"}

PROGRAM = """
import sys
from analyzer.cli import main
sys.argv[0] = "tailbyte"
status = main()
print("imported:", status, *sys.modules, file=sys.stderr)
"""


def imported(*args: str) -> set[str]:
    """Run a command in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *args], env=environment(), capture_output=True, timeout=LIMIT, check=True
    )
    return set(done.stderr.decode().rpartition("imported: ")[2].split())


@pytest.mark.proof
@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("args", "status", "unwanted"),
    [
        (("--help",), 0, HELP),
        (("--version",), 0, LIBRARIES | CORE | PARSERS | {"dissectors", "dataclasses"}),
        (("check", "--help"), 0, LIBRARIES | CORE | {"dissectors"}),
        (("export", "--help"), 0, LIBRARIES | CORE | {"dissectors"}),
        (("decode", "-c", "x"), 2, LIBRARIES | CORE | {"dissectors"}),
        (("help", "captures"), 0, LIBRARIES | CORE | {"dissectors"}),
        (("explain", "TRF-003"), 0, LIBRARIES | CORE | PARSERS),
        (
            ("decode", "-q", str(HOVER)),
            0,
            LIBRARIES | UNUSED | PARSERS | {"analyzer.report", "analyzer.plot"},
        ),
        (
            ("check", str(HOVER)),
            0,
            LIBRARIES | UNUSED | PARSERS | {"analyzer.plot", "analyzer.app.capture", "tempfile"},
        ),
        (
            ("live", "virtual:start", "-q", "-a", "duration:0.2"),
            4,
            LIBRARIES - {"can"} | UNUSED | NOT_LIVE | {"analyzer.plot"},
        ),
    ],
)
def test_what_a_command_does_not_import(args: tuple[str, ...], status: int, unwanted: set[str]) -> None:
    found = imported(*args)
    assert str(status) in found
    assert sorted(unwanted & found) == []


def test_the_version_is_that_of_the_installation() -> None:
    try:
        known = metadata.version("tailbyte")
    except metadata.PackageNotFoundError:
        known = UNKNOWN
    assert version() == known


def asked_of(name: str, code: str) -> str:
    """Return what a library finds in the environment once some code has run with `--version`."""
    report = f"; import os, sys; print('asked', os.environ.get({name!r}), file=sys.stderr)"
    env = environment()
    env.pop(name, None)
    command = [sys.executable, "-c", code + report, "--version"]
    done = subprocess.run(command, env=env, capture_output=True, timeout=LIMIT, check=True)
    return done.stderr.decode().split()[-1]


@pytest.mark.parametrize(
    ("name", "ours", "theirs"),
    [("OPENBLAS_NUM_THREADS", "1", "3"), ("ARROW_DEFAULT_MEMORY_POOL", "system", "mimalloc")],
)
def test_only_the_program_itself_tells_libraries_how_to_use_the_process(name: str, ours: str, theirs: str) -> None:
    assert asked_of(name, "from analyzer.cli import main; main()") == ours
    assert asked_of(name, "from analyzer.cli import main; main(['--version'])") == "None"
    assert asked_of(name, "import analyzer") == "None"
    chosen = f"import os; os.environ[{name!r}] = {theirs!r}; from analyzer.cli import main; main()"
    assert asked_of(name, chosen) == theirs


ARROW = """
import sys
from analyzer.app.process import start
if len(sys.argv) > 1:
    start.alone()
start.plain_arrow()
import pyarrow as pa
columns = pa.record_batch({"a": [1, None, 300], "b": ["x", None, "z"]})
print(columns.take(pa.array([2, 1])).to_pylist(), columns.column("a").is_null(nan_is_null=True).to_pylist())
print(columns.filter(pa.array([True, None, True])).to_pylist())
print(columns.column("b").filter(pa.array([True, None, True]), null_selection_behavior="emit_null").to_pylist())
for attempt in (
    lambda: columns.column("a").cast("int16").type,
    lambda: columns.column("a").cast(pa.uint8(), safe=False).to_pylist(),
    lambda: columns.column("a").cast(pa.uint8()),
    lambda: columns.take(pa.array([3])),
):
    try:
        print(attempt())
    except pa.ArrowException as error:
        print(error)
print("pyarrow.vendored.docscrape" in sys.modules, file=sys.stderr)
import pyarrow.compute as pc
print(columns.column("a").fill_null(5).to_pylist())
print(pc.add(pa.array([1, 2]), 2), pc.take(pa.array([1]), pa.array([0])))
"""


@pytest.mark.proof
@pytest.mark.slow
def test_arrow_does_the_same_without_its_documentation() -> None:
    done = [
        subprocess.run(
            [sys.executable, "-c", ARROW, *one], env=environment(), capture_output=True, timeout=LIMIT, check=True
        )
        for one in ([], ["alone"])
    ]
    assert done[0].stdout == done[1].stdout
    assert [one.stderr for one in done] == [b"True\n", b"False\n"]


MASKED = """
from analyzer.app.process import start
start.alone()
start.plain_arrow()
import pyarrow as pa, numpy as np, sys
assert pa.array(np.array([1, 2])).to_pylist() == [1, 2]
assert "numpy.ma.core" not in sys.modules
if len(sys.argv) > 1:
    import numpy.ma.core
    assert not hasattr(sys.modules["numpy.ma"], "no such name")
masked = np.ma.masked_array([1, 2], [False, True])
assert type(masked) is sys.modules["numpy.ma.core"].MaskedArray
print(pa.array(masked).to_pylist())
"""


@pytest.mark.parametrize("how", [(), ("core first",)])
def test_masked_arrays_are_there_for_those_who_import_them(how: tuple[str, ...]) -> None:
    command = [sys.executable, "-c", MASKED, *how]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=LIMIT, check=True)
    assert done.stdout == "[1, None]\n"


COLLECTED = """
import gc
from analyzer.app.process import start
start.alone()
FIRST
before = gc.get_stats()[0]["collections"]
kept = [[] for _ in range(100_000)]
assert gc.get_stats()[0]["collections"] == before
more = [[] for _ in range(150_000)]
print(gc.get_threshold()[0], gc.get_freeze_count() > 200_000)
"""


CAN = """
import sys
from analyzer.app.process import start
if len(sys.argv) > 1:
    start.alone()
start.plain_can()
sys.modules["asammdf"] = None
import can
print("can.io.blf" in sys.modules, "wrapt" in sys.modules, "_ssl" in sys.modules, file=sys.stderr)
import asyncio.base_events as events
with can.ThreadSafeBus(interface="virtual", channel="quiet") as bus:
    print(bus.channel_info)
print(events.ssl.SSLContext.__name__, events.sslproto.SSLProtocol.__name__)
from can.io.asc import ASCReader
from can.io import blf
from can.io import Printer
class Plugin(can.ThreadSafeBus):
    shared: "can.ThreadSafeBus | None" = None
    kinds = can.ThreadSafeBus | None, int | can.Printer
class Writer(can.ASCWriter):
    pass
with Plugin(interface="virtual", channel="quiet") as bus:
    print([kind.__name__ for kind in Plugin.__mro__], isinstance(bus, can.ThreadSafeBus))
print(issubclass(Writer, can.ASCWriter))
print(Writer.__mro__[1].__module__, can.ThreadSafeBus.send.__name__, Plugin.kinds)
with can.Printer() as printer:
    print(ASCReader.__name__, blf.BLFReader.__name__, isinstance(printer, sys.modules["can.io.printer"].Printer))
"""


def test_what_a_bus_hardly_needs_is_there_for_those_who_ask() -> None:
    done = [
        subprocess.run(
            [sys.executable, "-c", CAN, *one], env=environment(), capture_output=True, text=True, timeout=LIMIT,
            check=True,
        )
        for one in ([], ["alone"])
    ]  # fmt: skip
    assert done[0].stdout == done[1].stdout
    assert [one.stderr for one in done] == ["True True True\n", "False False False\n"]


@pytest.mark.parametrize(("first", "threshold"), [("", 400_000), ("start.return_memory()", 3_000)])
def test_garbage_is_looked_for_once_the_start_is_over(first: str, threshold: int) -> None:
    """Seldom in a command that ends, more often in a session without end."""
    script = COLLECTED.replace("FIRST", first)
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment(), capture_output=True, text=True, timeout=LIMIT, check=True
    )
    assert done.stdout == f"{threshold} True\n"


MAPPED = """
import ctypes
from analyzer.app.process import start
start.alone()
start.keep_memory()
AND
class Taken(ctypes.Structure):
    _fields_ = [(name, ctypes.c_size_t) for name in "abcdefghij"]
libc = ctypes.CDLL(None)
libc.mallinfo2.restype = Taken
libc.malloc.restype = ctypes.c_void_p
before = libc.mallinfo2().e
libc.malloc(1 << 20)
print(libc.mallinfo2().e - before >= 1 << 20)
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallinfo2"), reason="another C library")
@pytest.mark.parametrize(("then", "given_back"), [
    ("", False), ("start.return_columns(faulty=True)", True),
    ("start.return_columns(faulty=True); start.return_columns(faulty=False)", False),
])  # fmt: skip
def test_columns_are_given_back_to_the_system_once_that_is_asked_for(then: str, given_back: bool) -> None:
    script = MAPPED.replace("AND", then)
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment(), capture_output=True, text=True, timeout=LIMIT, check=True
    )
    assert done.stdout == f"{given_back}\n"
