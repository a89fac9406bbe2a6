"""The file of `qinit start METHOD FIT -o start.npz` as a function of continuous states, with numpy alone."""

import numpy as np


class StartFunction:
    """Action values (N, A) of states (N, D) in the environment's units; a state beyond the box has those of its edge."""

    def __init__(self, path):
        with np.load(path) as file:
            self._held = dict(file)
        self.low, self.high = self._held["low"], self._held["high"]  # (D,)
        self.actions, self.gamma = self._held["action"].tolist(), float(self._held["gamma"])
        if np.isnan(self.low).any():
            raise ValueError(
                f"{path} has coordinates that are no bins of one width; it is no function of states"
            )

    def __call__(self, states):
        states = np.atleast_2d(np.asarray(states, np.float64))
        if not np.isfinite(states).all():
            raise ValueError("a state is not finite")
        return self._of_tiles(states) if "weights" in self._held else self._of_bins(states)

    def _of_bins(self, states):
        table = self._held["start"]  # (*bins, A)
        bins = np.array(table.shape[:-1])
        places = (states - self.low) / (self.high - self.low) * bins
        return table[tuple(np.clip(places, 0, bins - 1).astype(int).T)]

    def _of_tiles(self, states):
        weights, tilings, tiles = (self._held[name] for name in ("weights", "tilings", "tiles"))  # (T, A)
        dimension, grid = np.arange(len(self.low))[:, None], np.arange(tilings)
        along = tiles + (tilings > 1)  # tiles of a grid along each dimension
        shifts = (2 * dimension + 1) * grid % tilings / tilings  # (D, tilings), in tiles
        inside = np.clip((states - self.low) * (tiles / (self.high - self.low)), 0, np.nextafter(tiles, 0.0))
        places = (inside[:, :, None] + shifts).astype(int)  # (N, D, tilings)
        active = (places * along ** dimension[::-1]).sum(axis=1) + grid * along ** len(dimension)
        return weights[active].sum(axis=1)
