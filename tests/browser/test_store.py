"""The store: what goes in comes out, wherever it is looked at; its folder is one's own and goes away."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

import numpy as np
import pytest
from kit.browsing import capture

from analyzer.app.request import Request
from analyzer.app.run import Run
from analyzer.browser.colouring import RowColouring
from analyzer.browser.listed import ListPages
from analyzer.browser.store import store as store_module
from analyzer.browser.store.folder import PREFIX, StoreFolder, remove_stale
from analyzer.browser.store.store import StoreFullError, TableStore
from analyzer.browser.view import BrowserView
from analyzer.cli import main
from analyzer.window.numbering import Numbering

CAPTURES = ["mission-8-faults.log", "faults.log", "services.log", "fd.log", "bus-break.log", "hobbywing.log"]


def stored(path: str, folder: Path) -> tuple[TableStore, Run]:
    run, store = Run(Request((path,))), TableStore(folder)
    run.engine.core.measured = True
    for batch in run.batches():
        store.add(batch)
    return store, run


@pytest.mark.parametrize("name", CAPTURES)
def test_batches_come_back_as_they_went_in(name: str, tmp_path: Path) -> None:
    store, _ = stored(capture(name), tmp_path)
    for batch, kept in zip(Run(Request((capture(name),))).batches(), store.batches(), strict=True):
        assert kept == batch or (
            all(getattr(kept, one) == getattr(batch, one) for one in ("frames", "transfers", "events", "settled"))
            and dict(kept.messages) == {table: rows for table, rows in batch.messages.items() if len(rows)}
        )


@pytest.mark.parametrize("name", CAPTURES)
def test_rows_are_written_as_decode_writes_them(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store, run = stored(capture(name), tmp_path)
    pages = ListPages(store, run.registry, Numbering(), RowColouring(store, []))
    rows = [store.row(*store.locate(number)) for number in range(len(store))]
    shown = [line.text for start in range(0, len(rows), 37) for line in pages.lines(rows[start : start + 37], 400)]
    main(["decode", capture(name), "--foreign", "--no-pager"])
    listed = [line for line in capsys.readouterr().out.splitlines() if not line.startswith(" " * 11)]

    def words(line: str) -> tuple[str, ...]:
        return tuple(word for word in line.split() if not word.endswith("…"))[:4]

    assert sorted(map(words, shown)) == sorted(words(line) for line in listed if "Src>Dst" not in line)


@pytest.mark.parametrize("name", ["mission-8-faults.log", "faults.log"])
def test_each_frame_has_its_row(name: str, tmp_path: Path) -> None:
    store, _ = stored(capture(name), tmp_path)

    view = BrowserView.__new__(BrowserView)
    view.store = store
    for place in range(0, store.frames, 7):
        found = store.row_of_frame(place)
        assert found is not None
        places = view.places_of(store.row(*found))
        assert place in places or not places or places[0] > place


def test_rows_by_time(tmp_path: Path) -> None:
    store, _ = stored(capture("hover.log"), tmp_path)
    times = [store.time(store.row(*store.locate(number))) for number in range(len(store))]
    for t in np.linspace(store.low or 0, store.high or 0, 17).astype(np.int64).tolist():
        found = store.row_at_time(t)
        assert found is not None
        expected = next((k for k, one in enumerate(times) if one is not None and one >= t), len(times) - 1)
        assert store.starts[found[0]] + found[1] == expected


def test_the_folder_is_ones_own_and_goes_away(tmp_path: Path) -> None:
    stale = tmp_path / f"{PREFIX}dead"
    stale.mkdir()
    (stale / "lock").touch()
    with StoreFolder(str(tmp_path)) as folder:
        assert not stale.exists()
        assert stat.S_IMODE(folder.path.stat().st_mode) == 0o700
        with StoreFolder(str(tmp_path)):
            assert folder.path.exists()  # its process lives
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_goes_away_meanwhile_hides_no_other_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in "ab":
        (tmp_path / f"{PREFIX}{name}").mkdir()
        (tmp_path / f"{PREFIX}{name}" / "lock").touch()
    gone, user = iter([FileNotFoundError("it was removed")]), os.getuid()

    def owner() -> int:
        for error in gone:
            raise error
        return user

    monkeypatch.setattr(os, "getuid", owner)
    remove_stale(str(tmp_path))
    assert len(list(tmp_path.iterdir())) == 1


def test_a_full_disk_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(store_module, "write", full)
    with pytest.raises(StoreFullError, match="the disk is full: what fits is shown; TMPDIR names another place"):
        stored(capture("hover.log"), tmp_path)


def test_batches_share_what_does_not_change(tmp_path: Path) -> None:
    run, store = Run(Request((capture("mission-8-faults.log"),))), TableStore(tmp_path)
    text = Path(capture("mission-8-faults.log")).read_bytes()
    for start in range(0, len(text), 50_000):
        for batch in (*run.engine.feed(text[start : start + 50_000]), *run.engine.flushed()):
            store.add(batch)
    before, last = store.segments[-2:]
    assert before.readings
    assert last.readings is before.readings
    assert last.buses is before.buses
