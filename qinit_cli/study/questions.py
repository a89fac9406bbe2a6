"""The questions that `qinit study init` has an example for."""

from __future__ import annotations

from typing import Literal

Question = Literal["methods", "sources", "settings"]
