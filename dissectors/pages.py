"""Where the pages of rules stand: in TOML files, and in the `rule` decorators of small rules.

A module and its pages have the same stem. Python is read here, not run.
"""

from __future__ import annotations

import ast
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dissectors.plain_files import read_bytes
from dissectors.toml_table import ProfileError, TomlTable, read

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

FILE, FOLDER = "rules.toml", "rules"
_SIGNS = (b"rule(", b"title=")  # of a decorator that holds a page
_MADE_BY = ("rule", "kit.rule")


def page_files(folder: Path, code: str = "") -> list[Path]:
    """Return the files of a dissector's folder with pages of rules.

    These are `rules.toml`, its Python file `code`, and what stands below its folder `rules`.
    """
    whole = [
        file for file in (folder / FILE, folder / code) if _is_there(file) and (file.name == FILE or _has_page(file))
    ]
    return [*whole, *_with_pages((folder / FOLDER).rglob("*.*"))]


def files_in(folders: Iterable[str]) -> list[Path]:
    """Return the files with pages in some folders, not below them."""
    return _with_pages(file for folder in folders for file in Path(folder).glob("*.*"))


def _with_pages(files: Iterable[Path]) -> list[Path]:
    some = sorted(file for file in files if file.suffix in (".toml", ".py"))
    paged = {file.with_suffix("") for file in some if file.suffix == ".toml"}
    return [file for file in some if file.suffix == ".toml" or (file.with_suffix("") not in paged and _has_page(file))]


def _is_there(file: Path) -> bool:
    """Return whether there is something to read, or to refuse."""
    return file.exists() and not file.is_dir()


def _has_page(file: Path) -> bool:
    try:
        code = read_bytes(file)
    except OSError as error:
        raise ProfileError(str(file), 1, error.strerror or "cannot be read") from None
    return all(sign in code for sign in _SIGNS)


def read_pages(file: Path) -> TomlTable:
    """Return the pages of a file by rule. Raises `ProfileError`."""
    return read(file) if file.suffix == ".toml" else _decorated(file)


def _decorated(file: Path) -> TomlTable:
    """Return the pages that stand in decorators, with a text that has each key in the line where the code has it."""
    code = file.read_text()
    try:
        tree = ast.parse(code)
    except SyntaxError as error:
        raise ProfileError(str(file), error.lineno or 1, error.msg) from None
    lines = [""] * (code.count("\n") + 2)
    pages: dict[str, Any] = {}
    for call in _decorators(tree):
        rule = _literal(file, call.args[0])
        lines[call.lineno] = f'["{rule}"]'
        pages[rule] = {}
        for key in call.keywords:
            pages[rule][key.arg or ""] = _literal(file, key.value)
            lines[key.value.lineno] = lines[key.value.lineno] or f"{key.arg} ="
    return TomlTable(str(file), "\n".join(lines[1:]), (), pages)


def _decorators(tree: ast.Module) -> Iterator[ast.Call]:
    for node in tree.body:
        for call in node.decorator_list if isinstance(node, ast.FunctionDef) else ():
            if isinstance(call, ast.Call) and ast.unparse(call.func) in _MADE_BY and call.args and call.keywords:
                yield call


def _literal(file: Path, value: ast.expr) -> Any:
    try:
        return ast.literal_eval(value)
    except ValueError:
        raise ProfileError(str(file), value.lineno, "a page is read without running it: write the value out") from None
