"""The type of every numpy array of the product."""

from __future__ import annotations

from typing import Any

import numpy.typing as npt

# Numbers of any type and shape: what a column holds is said where it stands.
Array = npt.NDArray[Any]
