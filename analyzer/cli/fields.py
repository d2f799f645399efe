"""`tailbyte fields`: the names that filters and `-e` know: type, unit, values, and where the document has them."""

from __future__ import annotations

import csv
import json
import shutil
import sys
from typing import TYPE_CHECKING

from analyzer.cli import status
from analyzer.cli.arguments import options

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Sequence

    from analyzer.filter.fields import FieldRef
    from analyzer.filter.names import FilterNames

NAME = "tailbyte fields"
KEYS = ("name", "type", "unit", "values", "clause", "about")


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.description = __doc__
    parser.add_argument(
        "pattern", nargs="*", metavar="PATTERN", help="part of a name, or a pattern with * and ?; default: all"
    )
    parser.add_argument("-T", dest="form", choices=("text", "json", "csv"), default="text", help="default: text")
    options.add_dissectors(parser)
    options.add_output(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Write every field whose name fits."""
    import dissectors  # noqa: PLC0415
    from analyzer.filter.language.errors import listed, near  # noqa: PLC0415
    from analyzer.filter.names import FilterNames  # noqa: PLC0415 - needs numpy
    from dissectors import DsdlError, ProfileError  # noqa: PLC0415

    try:
        names = FilterNames(dissectors.load(*options.folders(args)))
        every = list(names.catalogue())
    except (DsdlError, ProfileError, OSError) as error:
        return status.usage(str(error), NAME)
    fitting = [_fitting(every, pattern) for pattern in args.pattern]
    found = [ref for ref in every if not fitting or any(ref.name in names for names in fitting)]
    if not found:
        found = [one for pattern in args.pattern for one in _ending(names, every, pattern)]
    if not found:
        meant = near(args.pattern[0], [ref.name for ref in every])
        ends = {name.rpartition(".")[2]: name for name in (ref.name for ref in every)}
        meant += [ends[one] for one in near(args.pattern[0], list(ends)) if ends[one] not in meant]
        hint = f"; did you mean {listed(meant)}?" if meant else ""
        return status.usage(f"no field's name has {args.pattern[0]!r} in it{hint}", NAME)
    wanted = {pattern.lower() for pattern in args.pattern}
    found.sort(key=lambda ref: ref.name.lower().rpartition(".")[2] not in wanted)  # these are called just that
    _write(found, args)
    return status.OK


def _ending(names: FilterNames, every: Sequence[FieldRef], pattern: str) -> list[FieldRef]:
    """Return the fields that a filter takes a name for which is not written out."""
    from analyzer.filter.language.errors import FilterError  # noqa: PLC0415

    try:
        found = names.find(pattern, pattern, 0)
    except FilterError as error:
        return [ref for ref in every if ref.name in error.candidates and ref.name.endswith(pattern.rpartition(".")[2])]
    same = [ref for ref in every if ref.column == found.column and ref.path == found.path]
    return [ref for ref in same if set(ref.tables) & set(found.tables)]


def _fitting(every: Sequence[FieldRef], pattern: str) -> set[str]:
    """Return the names that fit a pattern, or have it in them; one with a dot begins where a word does, if any."""
    from fnmatch import fnmatchcase  # noqa: PLC0415

    wanted, names = pattern.lower(), {ref.name: ref.name.lower() for ref in every}
    if "*" in wanted or "?" in wanted:
        return {name for name, lower in names.items() if fnmatchcase(lower, wanted)}
    begun = {name for name, lower in names.items() if f".{wanted}" in f".{lower}"} if "." in wanted else set()
    return begun or {name for name, lower in names.items() if wanted in lower}


def _write(found: Sequence[FieldRef], args: argparse.Namespace) -> None:
    if args.form == "json":
        rows = ",\n".join(json.dumps(_record(ref), ensure_ascii=False) for ref in found)
        sys.stdout.write(f"[\n{rows}\n]\n")
    elif args.form == "csv":
        from analyzer.views.records import harmless  # noqa: PLC0415

        writer = csv.writer(sys.stdout)
        writer.writerow(KEYS)
        writer.writerows(map(harmless, _cells(ref)) for ref in found)
    else:
        from analyzer.cli.pager import paged  # noqa: PLC0415

        with paged(wanted=not args.no_pager) as out:
            out.writelines(_lines(found))


def _record(ref: FieldRef) -> dict[str, object]:
    from analyzer.filter.constants import digits  # noqa: PLC0415

    values = {digits(value): words[0] for value, words in ref.kind.texts.items()} if ref.kind.sort == "number" else {}
    words = [words[0] for words in ref.kind.texts.values()] if ref.kind.sort == "text" else []
    kind = "type" if ref.origin == "type" else ref.kind.sort
    return dict(zip(KEYS, (ref.name, kind, ref.kind.unit, values or words, ref.clause, ref.about), strict=True))


def _cells(ref: FieldRef) -> list[str]:
    record = _record(ref)
    values = record["values"]
    said = [f"{k}={v}" for k, v in values.items()] if isinstance(values, dict) else list(values)  # type: ignore[call-overload]
    return [str(record[key]) if key != "values" else "; ".join(said) for key in KEYS]


def _lines(found: Sequence[FieldRef]) -> Iterator[str]:
    """Yield the fields as columns, cut to a terminal."""
    from analyzer.views.terminal import escape, fit  # noqa: PLC0415

    rows = [[escape(cell) for cell in _cells(ref)] for ref in found]
    widths = [min(max(len(row[k]) for row in rows), most) for k, most in enumerate((60, 8, 12))]
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    for row in rows:
        name, kind, unit = (f"{cell:<{size}}" for cell, size in zip(row, widths, strict=False))
        said = "; ".join(filter(None, (row[5], row[3], f"clause {row[4]}" if row[4] else "")))
        line = f"{name}  {kind}  {unit}  {said}".rstrip()
        yield (line if width is None else fit(line, width)) + "\n"
