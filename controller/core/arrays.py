"""The one array type of all numeric code. Importing it imports numpy, which nothing at program start may need."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""An array of 64-bit floats; the docstring that uses it gives the shape."""
