"""A printer never makes anybody wait: what a slow reader does not take is counted, a reader that is gone is noticed."""

from __future__ import annotations

import os
from pathlib import Path
from threading import Thread

import pytest
from kit.command import wait_until
from live.test_recording_trouble import waiting_in

from analyzer.live import printer
from analyzer.live.printer import Printer


@pytest.fixture
def pipe() -> list[int]:
    return list(os.pipe())


def everything(file: int) -> bytes:
    parts = []
    while part := os.read(file, 1 << 16):
        parts.append(part)
    return b"".join(parts)


def test_everything_arrives_in_order(pipe: list[int]) -> None:
    texts = [f"{k} µ\n" * (k % 50) for k in range(3000)]
    read: list[bytes] = []
    reader = Thread(target=lambda: read.append(everything(pipe[0])))
    reader.start()
    with Printer(pipe[1]) as one:
        for text in texts:
            one.put(text)
    os.close(pipe[1])
    reader.join()
    os.close(pipe[0])
    assert read == ["".join(texts).encode()]
    assert (one.lost, one.gone, one.problem) == (0, False, None)


def test_a_reader_that_has_stopped_costs_what_does_not_fit(pipe: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(printer, "PATIENCE", 0.2)
    text = "x" * 1000 + "\n"
    with Printer(pipe[1], most=200_000) as one:
        for _ in range(5000):
            one.put(text)
        inside = 5000 - one.lost
        assert 199 <= inside <= 400  # what waits here, and in the pipe
    assert 5000 - one.lost < 100  # only what the pipe itself holds has gone
    os.set_blocking(pipe[0], False)
    assert os.read(pipe[0], 1001) == text.encode()
    os.close(pipe[0])
    wait_until(lambda: one.gone)
    os.close(pipe[1])


def test_how_long_the_oldest_text_has_waited(pipe: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(printer, "PATIENCE", 0.1)
    now = [0.0]
    with Printer(pipe[1], clock=lambda: now[0]) as one:
        assert one.behind == 0.0
        one.put("x" * (1 << 20))
        now[0] += 3.0
        one.put("x")
        now[0] += 1.2
        assert one.behind == 4.2
        assert len(os.read(pipe[0], 1 << 16)) > 0
        reader = Thread(target=everything, args=(pipe[0],), daemon=True)
        reader.start()
        wait_until(lambda: one.behind == 0.0)
    os.close(pipe[1])
    reader.join()
    os.close(pipe[0])


def test_one_text_larger_than_the_bound_still_goes_out(pipe: list[int]) -> None:
    with Printer(pipe[1], most=10) as one:
        one.put("a" * 100)
    os.close(pipe[1])
    assert everything(pipe[0]) == b"a" * 100
    os.close(pipe[0])


def test_a_reader_that_is_gone_is_noticed(pipe: list[int]) -> None:
    os.close(pipe[0])
    with Printer(pipe[1]) as one:
        one.put("x")
        wait_until(lambda: one.gone)
        one.put("y")
    os.close(pipe[1])
    assert (one.lost, one.problem) == (0, None)


def test_a_full_disk_is_a_problem() -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("no /dev/full")
    with full.open("wb", buffering=0) as file, Printer(file.fileno()) as one:
        one.put("x")
        wait_until(lambda: one.problem is not None)
    assert one.problem == "No space left on device"


def test_a_pipe_that_does_not_wait_is_waited_for(pipe: list[int]) -> None:
    """Somebody else who has it may have told it so."""
    os.set_blocking(pipe[1], False)
    text = "x" * 999 + "\n"
    read: list[bytes] = []
    with Printer(pipe[1]) as one:
        for _ in range(1000):
            one.put(text)
        wait_until(lambda: waiting_in(pipe[0]) >= 60_000)
        reader = Thread(target=lambda: read.append(everything(pipe[0])))
        reader.start()
    os.close(pipe[1])
    reader.join()
    os.close(pipe[0])
    assert (one.lost, one.gone, one.problem) == (0, False, None)
    assert read == [text.encode() * 1000]
