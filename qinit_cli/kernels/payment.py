# mypy: allow-untyped-defs, allow-untyped-calls
"""What steps pay, compiled. A reward of 1 at the goal alone adds no instruction to a step."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from qinit_cli.kernels.parts import body, part
from qinit_cli.rewards import Payment

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats


class AtTheGoal(NamedTuple):
    """1 on reaching the goal, which is kept as what entering it is worth."""


class EachStep(NamedTuple):
    """The same for every step."""

    reward: float
    lost: float  # what having ended elsewhere is worth


class AsTheWorldSays(NamedTuple):
    """What the world notes of each step, and the discounted return of each episode."""

    lost: float
    low: float  # the least return
    width: float  # the largest less the least
    paid: Any  # f8 (L,) the reward of each lane's last step, which the world notes
    discount: Any  # f8 (L,) of the coming reward
    gained: Any  # f8 (L,) return of the episode so far
    returns: Any  # f8 (B, E) of the episodes
    evaluated: Any  # f8 (B, R) of the greedy episodes


def new_payment(
    payment: Payment | None, world: Any, batch: int, episodes: int, evaluations: int
) -> AtTheGoal | EachStep | AsTheWorldSays:
    """What steps pay as the loop reads it; ValueError where the world notes no rewards."""
    if payment is None:
        return AtTheGoal()
    if payment.step is not None:
        return EachStep(payment.step, payment.lost)
    paid: Floats | None = getattr(world, "paid", None)
    if paid is None:
        raise ValueError(f"{type(world).__name__} notes no rewards")
    return AsTheWorldSays(
        lost=payment.lost,
        low=payment.bounds.low,
        width=payment.bounds.width,
        paid=paid,
        discount=np.ones(len(paid)),
        gained=np.zeros(len(paid)),
        returns=np.zeros((batch, episodes)),
        evaluated=np.zeros((batch, evaluations)),
    )


@part
def worth_of_end(payment, end):
    """What an end is worth beyond its reward: 0 is the goal, 1 being lost."""
    return 1.0 - end


@body(worth_of_end, EachStep, AsTheWorldSays)
def _worth_of_end(payment, end):
    return payment.lost * end


@part
def reward_of(payment, lane):
    """What the lane's last step paid, where the world tells it."""
    return 0.0


@body(reward_of, AsTheWorldSays)
def _reward_of(payment, lane):
    return payment.paid[lane]


@part
def with_reward(payment, reward, worth):
    """The reward of a step, as `reward_of` told it, and what the step led to."""
    return worth


@body(with_reward, EachStep)
def _with_each(payment, reward, worth):
    return worth + payment.reward


@body(with_reward, AsTheWorldSays)
def _with_told(payment, reward, worth):
    return worth + reward


@part
def begin_gaining(payment, lane):
    """An episode begins."""


@body(begin_gaining, AsTheWorldSays)
def _begin_gaining(payment, lane):
    payment.discount[lane], payment.gained[lane] = 1.0, 0.0


@part
def gain(payment, lane, gamma):
    """The lane's last step adds to the return of its episode."""


@body(gain, AsTheWorldSays)
def _gain(payment, lane, gamma):
    payment.gained[lane] += payment.discount[lane] * payment.paid[lane]
    payment.discount[lane] *= gamma


@part
def note_return(payment, lane, task, episode):
    """An episode of the task has ended."""


@body(note_return, AsTheWorldSays)
def _note_return(payment, lane, task, episode):
    if episode < payment.returns.shape[1]:  # after the last one nothing counts
        payment.returns[task, episode] = payment.gained[lane]


@part
def note_evaluation(payment, lane, task, number):
    """A greedy episode of the task has ended."""


@body(note_evaluation, AsTheWorldSays)
def _note_evaluation(payment, lane, task, number):
    payment.evaluated[task, number] = payment.gained[lane]


@part
def share_of_episode(payment, lane, length, reached, gamma):
    """The share of the attainable return that the lane's last episode gained."""
    return gamma ** np.float64(length - 1) if reached else 0.0


@body(share_of_episode, EachStep)
def _share_of_steps(payment, lane, length, reached, gamma):
    return gamma ** np.float64(length) if reached else 0.0


@body(share_of_episode, AsTheWorldSays)
def _share_of_gained(payment, lane, length, reached, gamma):
    return (payment.gained[lane] - payment.low) / payment.width
