"""Golden pairs: each capture beside what the command shows of it.

`pytest tests/test_golden.py --regenerate` writes the `.expected` files anew; read the difference before you commit it.
The values themselves are checked against the senders in test_captures.py.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from analyzer.cli import main

if TYPE_CHECKING:
    from collections.abc import Iterator

CAPTURES = Path(__file__).parent.parent / "captures"
CASES = sorted(path for path in CAPTURES.iterdir() if path.suffix in {".log", ".txt"})


def shown(case: Path, capsys: pytest.CaptureFixture[str]) -> Iterator[str]:
    """The list in ISO time, the complaints, the account, and the exit status."""
    status = main(["decode", "-t", "ud", str(case)])
    got = capsys.readouterr()
    yield got.out
    yield got.err.replace(str(case), case.name)
    yield f"exit {status}\n"


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_expected(case: Path, capsys: pytest.CaptureFixture[str], request: pytest.FixtureRequest) -> None:
    text = "".join(shown(case, capsys))
    expected = case.with_suffix(".expected")
    if request.config.getoption("--regenerate"):
        expected.write_text(text, encoding="utf-8")
    assert text == expected.read_text(encoding="utf-8")


def test_every_capture_has_its_pair() -> None:
    assert {case.stem for case in CASES} == {path.stem for path in CAPTURES.glob("*.expected")}
    assert len(CASES) >= 5
