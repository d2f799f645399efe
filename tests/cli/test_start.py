"""What a command imports before it starts, and what it does with the process it is in."""

from __future__ import annotations

import subprocess
import sys

import pytest
from kit.command import HOVER, LIMIT, environment

CORE = {"numpy", "pyarrow", "analyzer._native"}
LIBRARIES = {"pandas", "can", "rerun", "mcap", "google.protobuf", "dronecan", "textual", "jinja2"}
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


@pytest.mark.parametrize(
    ("args", "status", "unwanted"),
    [
        (("--help",), 0, HELP),
        (("--version",), 0, LIBRARIES | CORE | {"dissectors", "dataclasses"}),
        (("check", "--help"), 0, LIBRARIES | CORE | {"dissectors"}),
        (("export", "--help"), 0, LIBRARIES | CORE | {"dissectors"}),
        (("decode", "-c", "x"), 2, LIBRARIES | CORE | {"dissectors"}),
        (("help", "captures"), 0, LIBRARIES | CORE | {"dissectors"}),
        (("explain", "TRF-003"), 0, LIBRARIES | CORE),
        (("decode", "-q", str(HOVER)), 0, LIBRARIES | {"analyzer.report", "analyzer.plot"}),
    ],
)
def test_what_a_command_does_not_import(args: tuple[str, ...], status: int, unwanted: set[str]) -> None:
    found = imported(*args)
    assert str(status) in found
    assert sorted(unwanted & found) == []


def threads_wanted(code: str) -> str:
    report = "; import os, sys; print('wants', os.environ.get('OPENBLAS_NUM_THREADS'), file=sys.stderr)"
    env = environment()
    env.pop("OPENBLAS_NUM_THREADS", None)
    command = [sys.executable, "-c", code + report, "--version"]
    done = subprocess.run(command, env=env, capture_output=True, timeout=LIMIT, check=True)
    return done.stderr.decode().split()[-1]


def test_only_the_program_itself_asks_for_one_thread_of_linear_algebra() -> None:
    assert threads_wanted("from analyzer.cli import main; main()") == "1"
    assert threads_wanted("from analyzer.cli import main; main(['--version'])") == "None"
    assert threads_wanted("import analyzer") == "None"
    assert (
        threads_wanted("import os; os.environ['OPENBLAS_NUM_THREADS'] = '3'; from analyzer.cli import main; main()")
        == "3"
    )
