"""Gymnasium's MountainCar-v0 with the push of `qinit train-sources mountain-car`: added to the position on the right hill."""

import gymnasium
import numpy as np
from gymnasium.envs.classic_control.mountain_car import MountainCarEnv


class PushedCar(MountainCarEnv):
    """A task is one push; -1 a step until the flag is reached, as with `--reward step`."""

    def __init__(self, push=0.0):
        super().__init__()
        self.push = push

    def step(self, action):
        pushed = self.push * (self.state[0] >= 0.0)
        _, reward, _, truncated, told = super().step(action)
        position, velocity = self.state
        position = min(max(position + pushed, self.min_position), self.max_position)
        self.state = (position, velocity)
        done = position >= self.goal_position and velocity >= self.goal_velocity
        return np.array(self.state, np.float32), reward, done, truncated, told


gymnasium.register("PushedCar-v0", PushedCar, max_episode_steps=200)
