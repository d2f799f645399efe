"""Work in a thread ahead of its use: order, bound, errors from both sides, and no thread left behind."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import pytest

from analyzer.app.process.threads import ahead

if TYPE_CHECKING:
    from collections.abc import Iterator


def workers() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "ahead"]


class Source:
    """Counts; says what it made, in which thread, and whether it was closed."""

    def __init__(self, items: int, error: BaseException | None = None) -> None:
        self.items, self.error = items, error
        self.made = 0
        self.closed = False
        self.threads: set[str] = set()
        self.progress = threading.Condition()

    def run(self) -> Iterator[int]:
        try:
            for item in range(self.items):
                self.threads.add(threading.current_thread().name)
                with self.progress:
                    self.made += 1
                    self.progress.notify_all()
                yield item
            if self.error is not None:
                raise self.error
        finally:
            self.closed = True

    def has_made(self, count: int) -> bool:
        with self.progress:
            return self.progress.wait_for(lambda: self.made >= count, timeout=30)


@pytest.mark.parametrize("room", [1, 2, 7])
@pytest.mark.parametrize("count", [0, 1, 2, 3, 100])
def test_everything_comes_in_order_from_another_thread(count: int, room: int) -> None:
    source = Source(count)
    assert list(ahead(source.run(), room)) == list(range(count))
    assert source.closed
    assert source.threads <= {"ahead"}
    assert workers() == []


def test_it_is_ahead_but_not_by_more_than_its_room() -> None:
    source = Source(100)
    items = ahead(source.run(), 2)
    assert next(items) == 0
    assert source.has_made(3)  # beside the one that is in use
    assert source.made <= 4
    assert [next(items) for _ in range(50)] == list(range(1, 51))
    assert source.made <= 54
    items.close()


@pytest.mark.parametrize("error", [ValueError("broken"), KeyboardInterrupt(), SystemExit(3)])
def test_an_error_comes_behind_what_was_made_before_it(error: BaseException) -> None:
    items = ahead(Source(3, error).run())
    assert [next(items) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(type(error)) as caught:
        next(items)
    assert caught.value is error
    assert workers() == []


@pytest.mark.parametrize("used", [1, 2, 5])
def test_an_early_end_stops_and_closes_the_source(used: int) -> None:
    source = Source(1000)
    items = ahead(source.run())
    for _ in range(used):
        next(items)
    items.close()
    assert source.closed
    assert source.made <= used + 3
    assert workers() == []


def test_an_error_of_the_user_stops_the_source() -> None:
    source = Source(1000)

    def use() -> None:
        for item in (items := ahead(source.run())):
            if item == 4:
                items.close()
                raise RuntimeError

    with pytest.raises(RuntimeError):
        use()
    assert source.closed
    assert workers() == []


def test_what_is_no_generator_needs_no_closing() -> None:
    assert list(ahead(["a", "b"])) == ["a", "b"]
    with pytest.raises(TypeError):
        list(ahead(3))  # type: ignore[arg-type]
