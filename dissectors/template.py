"""Summary templates: one line of text about a message, with its columns filled in.

`{column}` or `{column:format}`, where a column is a field, `field.part` or a derived name, and the format is Python's
for numbers. An enumeration and a special value print their text; a list prints its elements joined by blanks.
"""

from __future__ import annotations

import re
import string

from dissectors.records import dataclass

MAX_TEMPLATE = 500

_FORMAT = re.compile(r"[<>^]?[+ -]?#?0?\d{0,2},?(?:\.\d{1,2})?[bdeEfFgGosxX%]?", re.ASCII)


@dataclass(frozen=True, slots=True)
class Slot:
    """Literal `text`, followed by the value of `column` in `format`; the last slot may have no column."""

    text: str
    column: str
    format: str

    def fits(self, sample: float | str) -> bool:
        """Return whether `format` can be applied to a value of this kind; a text takes none."""
        if isinstance(sample, str):
            return not self.format
        try:
            return bool(format(sample, self.format))
        except ValueError:
            return False


def parse(template: str) -> tuple[Slot, ...]:
    """Return the slots of a template; `ValueError` with the reason if it is malformed."""
    if len(template) > MAX_TEMPLATE:
        raise ValueError(f"a template of more than {MAX_TEMPLATE} characters")
    slots = []
    for text, column, form, conversion in string.Formatter().parse(template):
        if column is not None and (not column or conversion or not _FORMAT.fullmatch(form or "")):
            raise ValueError(f"{{{column}}} is not {{column}} or {{column:format}}")
        slots.append(Slot(text, column or "", form or ""))
    return tuple(slots)
