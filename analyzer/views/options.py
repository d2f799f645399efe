"""The wishes for a view: plain data, for whoever only hands it on."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True, slots=True)
class WriterOptions:
    """A view as somebody asks for it.

    `form` is text, fields, json, jsonl or csv. Of a text: `time` is the form of times as tshark has it, `signed` says
    that some are before zero, `only` names the types that are shown in detail, `dumps` asks for the bytes, `foreign`
    for every frame that is not DroneCAN. `frame_list` asks for frames instead of transfers, `follow` for each at once,
    `count` for so many of them. `wireshark` numbers frames as Wireshark does. With `colour`, `colours` is a file of
    colour rules in place of the user's own, or `off`. `comments` of somebody, by frame from 0, stand
    below the transfers of these frames. Of a view for programs `derived` asks for units and computed values.
    """

    form: str = "text"
    fields: tuple[str, ...] = ()
    time: str = "r"
    details: bool = False
    only: tuple[str, ...] | None = None
    summary: bool = False
    dumps: bool = False
    signed: bool = False
    colour: bool = False
    colours: str | None = None
    foreign: bool = False
    frame_list: bool = False
    follow: bool = False
    count: int | None = None
    wireshark: bool = False
    derived: bool = False
    comments: Mapping[int, str] = field(default_factory=dict)
