"""Columns as Rerun's chunks: many rows at once, never a call a point. Nothing else here knows Rerun's components."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import pyarrow as pa
import rerun as rr
from rerun.chunk import Chunk

from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from analyzer.plot.moments import Moments, PlotClock
    from dissectors.kit import Array

_SCALAR = ("rerun.archetypes.Scalars", "Scalars:scalars", "rerun.components.Scalar")
_STATE = ("rerun.archetypes.StateChange", "StateChange:state", "rerun.components.Text")
_TEXT = ("rerun.archetypes.TextLog", "TextLog:text", "rerun.components.Text")
_MARKER = 4.0
_LEVEL = ("rerun.archetypes.TextLog", "TextLog:level", "rerun.components.TextLogLevel")


def path(*parts: str) -> str:
    """Return an entity path; what is special in a name is escaped."""
    return "/" + "/".join(map(_escaped, parts))


@lru_cache(maxsize=1 << 14)
def _escaped(part: str) -> str:
    return str(rr.escape_entity_path_part(part or "_"))


@lru_cache(maxsize=1 << 15)
def _field(entity: str, component: tuple[str, str, str], kind: pa.DataType) -> pa.Field:
    archetype, name, of = component
    about = {
        rr.SORBET_ENTITY_PATH: entity,
        rr.SORBET_ARCHETYPE_NAME: archetype,
        rr.SORBET_COMPONENT: name,
        rr.SORBET_COMPONENT_TYPE: of,
    }
    return pa.field(f"{entity}:{name}", kind, metadata=about)


def _made(columns: Sequence[tuple[pa.Field, pa.Array]], moments: Moments, clock: PlotClock) -> list[Chunk]:
    """Make chunks of columns that share their rows, one an entity."""
    found: list[Chunk] = []
    for rows in clock.parts(moments):
        part = moments[rows]
        times = clock.timelines(part)
        if not len(part) or not times:
            continue
        whole = isinstance(rows, slice)
        arrays = [array for _, array in times]
        arrays += [array if whole else array.take(pa.array(rows)) for _, array in columns]
        fields = [pa.field(name, array.type) for name, array in times] + [one for one, _ in columns]
        batch = pa.RecordBatch.from_arrays(arrays, schema=pa.schema(fields))
        found += Chunk.from_record_batch(batch, index=[name for name, _ in times])
    return found


def scalars(lines: Iterable[tuple[str, Array]], moments: Moments, clock: PlotClock) -> list[Chunk]:
    """Make points of lines that share their rows: values (f64) by entity path."""
    columns = [(_field(entity, _SCALAR, pa.float64()), pa.array(values)) for entity, values in lines]
    return _made(columns, moments, clock)


def states(entity: str, values: Sequence[str], moments: Moments, clock: PlotClock) -> list[Chunk]:
    """Make changes of a state, each with its name."""
    return _made([(_field(entity, _STATE, pa.string()), pa.array(values, pa.string()))], moments, clock)


def texts(
    entity: str, values: Sequence[str], levels: Sequence[str], moments: Moments, clock: PlotClock
) -> list[Chunk]:  # fmt: skip
    """Make lines of a log; levels are ERROR, WARN, INFO."""
    columns = [
        (_field(entity, _TEXT, pa.string()), pa.array(values, pa.string())),
        (_field(entity, _LEVEL, pa.string()), pa.array(levels, pa.string())),
    ]
    return _made(columns, moments, clock)


@dataclass(frozen=True, slots=True)
class Style:
    """The name and the looks of an entity: components without a time, each a list of values."""

    entity: str
    components: Mapping[tuple[str, str, str], pa.Array]


def line_style(entity: str, name: str, colour: int, width: float) -> Style:
    """Return a line's name, colour (0xRRGGBBAA) and width."""
    of = "rerun.archetypes.SeriesLines"
    return Style(
        entity,
        {
            (of, "SeriesLines:names", "rerun.components.Name"): pa.array([name], pa.string()),
            (of, "SeriesLines:colors", "rerun.components.Color"): pa.array([colour], pa.uint32()),
            (of, "SeriesLines:widths", "rerun.components.StrokeWidth"): pa.array([width], pa.float32()),
        },
    )


def point_style(entity: str, name: str, colour: int) -> Style:
    """Return the style of points instead of a line."""
    of = "rerun.archetypes.SeriesPoints"
    return Style(
        entity,
        {
            (of, "SeriesPoints:names", "rerun.components.Name"): pa.array([name], pa.string()),
            (of, "SeriesPoints:colors", "rerun.components.Color"): pa.array([colour], pa.uint32()),
            (of, "SeriesPoints:marker_sizes", "rerun.components.MarkerSize"): pa.array([_MARKER], pa.float32()),
        },
    )


def state_style(entity: str, values: Sequence[str], colours: Sequence[int]) -> Style:
    """Return the colours of states."""
    of = "rerun.archetypes.StateConfiguration"
    return Style(
        entity,
        {
            (of, "StateConfiguration:values", "rerun.components.Text"): pa.array(values, pa.string()),
            (of, "StateConfiguration:colors", "rerun.components.Color"): pa.array(colours, pa.uint32()),
        },
    )


def styled(styles: Iterable[Style]) -> list[Chunk]:
    """Make styles of many entities at once."""
    fields, arrays = list[pa.Field](), list[pa.Array]()
    for style in styles:
        for component, values in style.components.items():
            array = pa.ListArray.from_arrays(pa.array([0, len(values)], pa.int32()), values)
            fields.append(_field(style.entity, component, array.type))
            arrays.append(array)
    if not arrays:
        return []
    return Chunk.from_record_batch(pa.RecordBatch.from_arrays(arrays, schema=pa.schema(fields)), index=None)


def start(ns: int) -> Chunk:
    """Make the start of the recording, in ns since 1970."""
    return Chunk.from_columns("/__properties", [], rr.archetypes.RecordingInfo.columns(start_time=[ns]))


def document(entity: str, markdown: str) -> Chunk:
    """Make a page that has no time."""
    return Chunk.from_columns(entity, [], rr.TextDocument.columns(text=[markdown], media_type=["text/markdown"]))
