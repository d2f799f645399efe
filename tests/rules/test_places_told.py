"""Places of frames that were picked from a capture: what findings say of them."""

import numpy as np
import pytest

from analyzer.decode.places import Places
from analyzer.rules.runs import OccurrenceRun, Shown


@pytest.mark.parametrize(
    ("texts", "told"),
    [
        (True, "frame 106 repeats frames 110 and 12, 7 frames late"),
        (False, "frame 1 repeats frames 2 and 12, 7 frames late"),
    ],
)
def test_texts_of_rules_name_places_and_those_of_a_vehicle_file_stay_as_they_are(texts: bool, told: str) -> None:
    places = Places()
    places.add(100, np.array([5, 9]))
    shown = Shown(0, 0, "frame 1 repeats frames 2 and 12, 7 frames late", "", (0, 1), ())
    run = OccurrenceRun((0, 0), (1, 1), 2, [shown]).placed(places, texts=texts)
    assert (run.first, run.last) == ((0, 105), (1, 109))
    assert (run.examples[0].text, run.examples[0].frame, run.examples[0].frames) == (told, 105, (105, 109))
