"""The array types that annotations speak of; shapes stand beside each use."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]
Tasks = NDArray[np.void]  # (B,), one field per task parameter
