"""Jobs done by other threads: the order of each key, the bound, errors, and no thread left."""

from __future__ import annotations

import threading
from functools import partial

import pytest

from analyzer.sinks.behind import AT_ONCE, Behind


def workers() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name.startswith("behind")]


@pytest.mark.parametrize("threaded", [False, True])
def test_jobs_of_one_key_are_done_in_their_order(threaded: bool) -> None:
    behind, done = Behind(threaded=threaded), {key: [] for key in "abc"}
    for k in range(300):
        behind.do("abc"[k % 3], partial(done["abc"[k % 3]].append, k))
    behind.finish()
    behind.close()
    assert done == {key: list(range(n, 300, 3)) for n, key in enumerate("abc")}
    assert workers() == []


def test_no_more_than_some_are_under_way() -> None:
    behind, go, asked = Behind(threaded=True), threading.Event(), []

    def ask() -> None:
        for key in "abcde":
            behind.do(key, go.wait)
            asked.append(key)

    asker = threading.Thread(target=ask)
    asker.start()
    while len(asked) < AT_ONCE:
        pass
    asker.join(0.05)
    assert len(asked) == AT_ONCE  # the next one waits for a place
    go.set()
    asker.join()
    behind.finish()
    behind.close()
    assert len(asked) == 5


def test_what_a_job_raises_is_raised_by_a_later_call() -> None:
    def fail() -> None:
        raise OSError("no room")

    behind = Behind(threaded=True)
    behind.do("a", fail)
    with pytest.raises(OSError, match="no room"):
        behind.do("a", lambda: None)
    behind.do("b", fail)
    with pytest.raises(OSError, match="no room"):
        behind.finish()
    behind.close()
    assert workers() == []
