"""An environment of one's own: a walk along a ledge, from whose edge the wind pushes back to the start."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

LENGTH, LANES = 10, 3
MOVES = ((-1, 0), (1, 0), (0, -1), (0, 1))  # back, on, to the edge, to the wall


class Ledge(gymnasium.Env[int, int]):
    """States are numbered along the lanes; `wind` is the chance of being pushed towards the edge."""

    def __init__(self, wind: float = 0.2) -> None:
        self.wind = wind
        self.observation_space = gymnasium.spaces.Discrete(LENGTH * LANES)
        self.action_space = gymnasium.spaces.Discrete(len(MOVES))
        self._place = (0, LANES - 1)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[int, dict[str, Any]]:
        super().reset(seed=seed)
        self._place = (0, LANES - 1)
        return self._state(), {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        along, lane = (at + by for at, by in zip(self._place, MOVES[action], strict=True))
        if self.np_random.random() < self.wind:
            lane -= 1
        self._place = (0, LANES - 1) if lane < 0 else (min(max(along, 0), LENGTH - 1), min(lane, LANES - 1))
        done = self._place[0] == LENGTH - 1
        return self._state(), float(done), done, False, {}

    def _state(self) -> int:
        return int(np.ravel_multi_index(self._place, (LENGTH, LANES)))


gymnasium.register("Ledge-v0", Ledge)
