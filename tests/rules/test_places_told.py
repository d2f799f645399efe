"""Places of frames that were picked from a capture: what findings say of them."""

import copy
import pickle
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from analyzer.decode.places import Places
from analyzer.rules.diagnosis.causes import Cause, late_copy, wrong_id
from analyzer.rules.found.runs import OccurrenceRun, Shown
from dissectors.frame_text import FrameNumber, FrameText, filled, listed

TEXT = "frame {frame} repeats frames {others}, {late} frames late {{}} {name!r:>5}"
VALUES = {"frame": FrameNumber.at(0), "others": listed((1, 11), " and "), "late": 7, "name": "n"}
SAID = "frame 1 repeats frames 2 and 12, 7 frames late {} "


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (filled(TEXT, VALUES), "frame 106 repeats frames 110 and 12, 7 frames late {} "),
        (SAID, SAID),  # somebody's own words
    ],
)
def test_texts_of_rules_name_places_and_plain_ones_stay_as_they_are(text: str, told: str) -> None:
    places = Places()
    places.add(100, np.array([5, 9]))
    assert text.startswith(SAID)
    shown = Shown(0, 0, text, "", (0, 1), ())
    run = OccurrenceRun((0, 0), (1, 1), 2, [shown]).placed(places)
    assert (run.first, run.last) == ((0, 105), (1, 109))
    assert run.examples[0].text.startswith(told)
    assert (run.examples[0].frame, run.examples[0].frames) == (105, (105, 109))


@pytest.mark.parametrize(
    "values", [VALUES, {**VALUES, "frame": "gone"}, {**VALUES, "others": "x"}, {**VALUES, "frame": 3, "others": 4}]
)
def test_they_read_as_any_text(values: Mapping[str, Any]) -> None:
    text = "{frame} {others} {late:04d} {frame:>6} {name!r:>5}"
    assert filled(text, values) == text.format_map(values)


@pytest.mark.parametrize(
    ("cause", "detail"),
    [
        (late_copy([4]), " of frame 5"),
        (late_copy([4, 6]), " of frames 5, 7"),
        (wrong_id([4, 6]), " in frame 5 or 7"),
    ],
)
def test_causes_know_their_frames(cause: Cause, detail: str) -> None:
    assert cause.detail == detail
    assert isinstance(cause.detail, FrameText)
    assert "15" in FrameText(": ", cause.detail, "!").moved(lambda place: place + 10)


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda told: pickle.loads(pickle.dumps(told))])
def test_copies_know_them_too(again: Any) -> None:
    told = again(FrameText("frame ", FrameNumber.at(6), " came late"))
    assert told == "frame 7 came late"
    assert told.moved(lambda place: place + 1) == "frame 8 came late"
