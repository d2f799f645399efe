"""What is said of keys is what the readers read: nothing is described that nobody asks for, and the other way round."""

from __future__ import annotations

from typing import TYPE_CHECKING, get_args

import pytest

import dissectors
from analyzer.rules import catalogue, field_tests
from analyzer.rules.exercised import coverage
from dissectors import keys, kit, picture
from dissectors.keys import pages
from dissectors.kit.rule import PageKeys
from dissectors.printed import printed
from dissectors.profile import Profile
from dissectors.toml_table import TomlTable, parse

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.keys import Key, Keys


def described(table: Keys) -> Iterator[Keys]:
    """A table's keys, and those of all tables inside."""
    yield table
    for key in (*table.keys, *([table.other] if table.other else [])):
        yield from inside(key)


def inside(key: Key) -> Iterator[Keys]:
    if key.keys is not None:
        yield from described(key.keys)
    if key.each is not None:
        yield from inside(key.each)


def test_every_key_that_is_described_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    finished: dict[str, set[str]] = {}
    finish = TomlTable.finish

    def noted(table: TomlTable) -> None:
        if table.keys is not None and not table.keys.other:
            known = finished.setdefault(table.keys.title, set(table.asked))
            assert known == table.asked, table.keys.title
        finish(table)

    monkeypatch.setattr(TomlTable, "finish", noted)
    registry = dissectors.load()
    for profile in registry.profiles:
        parent = registry.profiles[-1].namespace
        Profile.open(profile.folder, parent).dissector()
    for kept in (catalogue.load, catalogue._general, catalogue._of):
        kept.cache_clear()
    found = catalogue.load(registry)
    assert list(field_tests.rules_from(registry, found))
    picture.load(registry)
    coverage.never(registry)
    assert any(list(printed(profile.folder)) for profile in registry.profiles)
    all_keys = {one.title: one for file in keys.FILES for one in described(file) if one.keys}
    for title, asked in finished.items():
        assert asked == {key.name for key in all_keys[title].keys}, title
    # What no built-in profile has is read by the tests of errors.
    assert all_keys.keys() - finished.keys() <= {"pieces"}


def test_a_reader_cannot_ask_for_what_is_not_described() -> None:
    table = parse(b"title = 'x'", "a.toml", pages.PAGE)
    assert table.string("title") == "x"
    with pytest.raises(TypeError, match="no text or word or enumeration 'color'"):
        table.string("color")
    with pytest.raises(TypeError, match="no flag 'title'"):
        table.flag("title")


def test_words_are_those_of_the_types() -> None:
    assert get_args(kit.Severity) == pages.SEVERITIES
    assert set(PageKeys.__annotations__) <= {key.name for key in pages.PAGE.keys}
    assert {key.name for key in pages.PAGE.keys} - set(PageKeys.__annotations__) <= {"values", "tests"}


@pytest.mark.parametrize("file", keys.FILES, ids=lambda file: file.title)
def test_keys_are_described_for_people(file: Keys) -> None:
    for table in described(file):
        names = [key.name for key in table.keys]
        assert len(names) == len(set(names))
        assert table.about.endswith((".", "]`."))
        for key in table.keys:
            assert key.about.endswith("."), key
            assert key.kind not in ("whole", "wholes") or key.low < key.high
            assert key.type
