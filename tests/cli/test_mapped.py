"""Pages of program files: which ones may go, and that a process works on without them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from kit.command import LIMIT, environment

from analyzer.app.process.mapped import Mapping, mappings

SMAPS = """\
7f00-7f40 r-xp 00001000 fe:01 77                          /usr/lib/libarrow.so
Size:                256 kB
Rss:                 200 kB
Private_Dirty:         0 kB
Anonymous:             0 kB
VmFlags: rd ex mr mw me
7f40-7f50 r--p 00041000 fe:01 77                          /usr/lib/libarrow.so
Rss:                  64 kB
Anonymous:            64 kB
7f50-7f60 rw-p 00051000 fe:01 77                          /usr/lib/libarrow.so
Rss:                  64 kB
Anonymous:             0 kB
7f60-7f80 r--p 00000000 00:00 0
Rss:                 128 kB
Anonymous:             0 kB
7f80-7f90 r--p 00000000 fe:01 78                          /usr/lib/with (two) words.so
Rss:                  12 kB
Anonymous:             0 kB
7f90-7fa0 r--p 00000000 fe:01 79                          /var/lib/table
Rss:                 100 kB
Anonymous:             0 kB
7fa0-7fb0 r-xp 00000000 fe:01 80                          /usr/lib/libstdc++.so.6.0.30
Rss:                 100 kB
Anonymous:             0 kB
"""


def test_only_whole_pages_of_libraries_that_nobody_writes_may_go() -> None:
    found = list(mappings(SMAPS.splitlines()))
    assert found[0] == Mapping(0x7F00, 0x7F40, "r-xp", "/usr/lib/libarrow.so", 200, 0)
    assert [one.can_go for one in found] == [True, False, False, False, False, False, True]
    assert list(mappings([])) == []


WORKS_ON = """
import sys
from analyzer.app.process import start
from analyzer.app.process.mapped import return_files

def files():
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("RssFile"))

if sys.argv[1:]:
    start.alone()
import numpy as np
import pyarrow as pa
before = files()
return_files()
after = files()
assert pa.array(np.arange(1000)).take(pa.array([999])).to_pylist() == [999]
import pyarrow.parquet
print("less" if after < before / 2 else "same")
"""


@pytest.mark.skipif(not Path("/proc/self/smaps").exists(), reason="this system does not say what is mapped")
@pytest.mark.parametrize(("ours", "said"), [(("alone",), "less\n"), ((), "same\n")])
def test_a_process_of_our_own_works_on_without_them(ours: tuple[str, ...], said: str) -> None:
    command = [sys.executable, "-c", WORKS_ON, *ours]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=LIMIT, check=True)
    assert done.stdout == said
