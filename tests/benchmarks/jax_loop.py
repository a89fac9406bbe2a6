"""Tabular Q-learning in JAX: one scan over the steps of a task, vmap over tasks, in its own float32, on one core."""

from __future__ import annotations

import os

os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
os.environ["JAX_PLATFORMS"] = "cpu"

from functools import partial  # JAX reads its flags when it is imported
from typing import Any

import jax
import jax.numpy as jnp

SIZE, GOAL, P = 30, 20 * 30 + 20, 0.75
HORIZON, EPSILON = 1_000, 0.5
TASKS, CHUNKS, CHUNK = (
    64,
    40,
    500,
)  # a turn's tasks, and the steps of each: chunks bound the memory of the draws


def gridworld() -> float:
    """Steps taken in a turn."""
    return _run(_gridworld_task)


def mountain_car() -> float:
    """Steps taken in a turn."""
    return _run(_car_task)


def _run(task: Any) -> float:
    task(jax.random.split(jax.random.key(0), TASKS)).block_until_ready()
    return float(TASKS * CHUNKS * CHUNK)


def _action(row: Any, draws: Any) -> Any:
    """Epsilon-greedy, drawn among equals."""
    among = jnp.where(draws[0] < EPSILON, jnp.ones(len(row), bool), row == row.max())
    pick = jnp.floor(draws[1] * among.sum())
    return jnp.argmax(jnp.cumsum(among) > pick)


def _updated(q: Any, state: Any, action: Any, target: Any, alpha: float) -> Any:
    return q.at[state, action].add(alpha * (target - q[state, action]))


def _anywhere(draw: Any) -> Any:
    cell = jnp.floor(draw * (SIZE * SIZE - 1)).astype(int)
    return cell + (cell >= GOAL)


def _gridworld_step(carried: Any, draws: Any) -> tuple[Any, None]:
    q, cell, time = carried
    action = _action(q[cell], draws)
    slip = (1 - P) / 3
    move = (action + (draws[2] >= P) + (draws[2] >= P + slip) + (draws[2] >= P + 2 * slip)) % 4
    row = jnp.clip(cell // SIZE + jnp.array([-1, 0, 1, 0])[move], 0, SIZE - 1)
    after = row * SIZE + jnp.clip(cell % SIZE + jnp.array([0, 1, 0, -1])[move], 0, SIZE - 1)
    done = after == GOAL
    q = _updated(q, cell, action, jnp.where(done, 1.0, 0.95 * q[after].max()), 0.1)
    ended = done | (time + 1 == HORIZON)
    return (q, jnp.where(ended, _anywhere(draws[3]), after), jnp.where(ended, 0, time + 1)), None


def _bin(position: Any, velocity: Any) -> Any:
    row = jnp.minimum(((position + 1.2) * SIZE / 1.8).astype(int), SIZE - 1)
    return row * SIZE + jnp.minimum(((velocity + 0.07) * SIZE / 0.14).astype(int), SIZE - 1)


def _car_step(carried: Any, draws: Any) -> tuple[Any, None]:
    q, position, velocity, time = carried
    state = _bin(position, velocity)
    action = _action(q[state], draws)
    velocity = jnp.clip(velocity + (action - 1) * 0.001 - 0.0025 * jnp.cos(3 * position), -0.07, 0.07)
    position = jnp.clip(position + velocity, -1.2, 0.6)
    velocity = jnp.where((position == -1.2) & (velocity < 0), 0.0, velocity)
    done = (position >= 0.5) & (velocity >= 0)
    target = jnp.where(done, 1.0, 0.99 * q[_bin(position, velocity)].max())
    q = _updated(q, state, action, target, 0.05)
    ended = done | (time + 1 == HORIZON)
    position = jnp.where(ended, -1.2 + 1.7 * draws[2], position)
    velocity = jnp.where(ended, -0.07 + 0.14 * draws[3], velocity)
    return (q, position, velocity, jnp.where(ended, 0, time + 1)), None


@partial(jax.jit, static_argnums=(0, 1))
def _tasks(step: Any, actions: int, keys: Any) -> Any:
    def task(key: Any) -> Any:
        first, *others = jax.random.split(key, CHUNKS + 1)
        draws = jax.random.uniform(first, (2,))
        start = (jnp.zeros((SIZE * SIZE, actions)),)
        start += (_anywhere(draws[0]),) if actions == 4 else (-1.2 + 1.7 * draws[0], -0.07 + 0.14 * draws[1])

        def chunk(carried: Any, key: Any) -> tuple[Any, None]:
            return jax.lax.scan(step, carried, jax.random.uniform(key, (CHUNK, 4)))

        return jax.lax.scan(chunk, (*start, 0), jnp.stack(others))[0][0]

    return jax.vmap(task)(keys)


_gridworld_task = partial(_tasks, _gridworld_step, 4)
_car_task = partial(_tasks, _car_step, 3)
