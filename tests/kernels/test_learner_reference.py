"""The plain learners and explorations against answers worked out by hand, in halves: alpha and gamma are 1/2."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
import reference
from learner_reference import EXPLORATIONS, LEARNERS, Learner, flipped

from qinit_cli.learners import LEARNERS as OURS
from qinit_cli.learners.exploration import Boltzmann, Ucb
from qinit_cli.learners.one_step import DoubleQ, ExpectedSarsa, QLearner, Sarsa, Still
from qinit_cli.learners.optimistic import DelayedQ, RMax
from qinit_cli.learners.traces import QLambda, SarsaLambda
from qinit_cli.learning import Learning
from qinit_cli.schedules import ByVisits, Linear

Steps = Iterable[
    tuple[int, int, float, int | None]
]  # state, action, reward, the state after; None: the episode ended
CHAIN = [(0, 0, 0.0, 1), (1, 0, 0.0, 2), (2, 0, 1.0, None)]
HALF_UNLIKE = [[0.0, 0.0], [0.25, 1.0]]  # what acts in state 1 matters


def zeros(states: int = 3, actions: int = 2) -> list[list[float]]:
    return [[0.0] * actions for _ in range(states)]


def made(
    learner: Any, q: list[list[float]], potential: Any = None, coins: Any = None, **settings: Any
) -> Learner:
    usual: dict[str, Any] = {"alpha": 0.5, "gamma": 0.5, "epsilon": 0.5, "episodes": 9, "horizon": 9}
    learning = Learning(**{**usual, "start": "fixed", "learner": learner, **settings})
    explore = EXPLORATIONS[learning.explore.name](learning, q)
    return LEARNERS[learner.name](learning, q, potential, explore, coins)


def walk(learner: Learner, steps: Steps, episode: int = 0) -> None:
    """An episode of steps that are given."""
    learner.begin(episode)
    learner.explore.begin(episode)
    for state, action, reward, after in steps:
        learner.chose(state, action)
        learner.explore.took(state, action)
        learner.step(state, action, reward, after)
    learner.end()


def test_there_is_a_plain_one_of_every_learner() -> None:
    assert set(LEARNERS) == set(OURS)


def test_q_learning_carries_the_goal_back_a_state_an_episode() -> None:
    learner = made(QLearner(), zeros())
    for _ in range(3):
        walk(learner, CHAIN)
    assert [row[0] for row in learner.q] == [1 / 32, 1 / 4, 7 / 8]
    assert [row[0] for row in learner.visits] == [3, 3, 3]
    # errors of 1, 1/2 and 1/4
    assert learner.td_var[2][0] == pytest.approx(0.01 * (0.99**2 + 0.99 / 4 + 1 / 16))


@pytest.mark.parametrize(
    ("learner", "value"),
    [
        (QLearner(), 0.5 * (0.5 * 1.0)),  # of the largest
        (Sarsa(), 0.5 * (0.5 * 0.25)),  # of the action taken
        (SarsaLambda(lambda_=0.0), 0.5 * (0.5 * 0.25)),
        (QLambda(lambda_=0.0), 0.5 * (0.5 * 1.0)),
        (ExpectedSarsa(), 0.5 * (0.5 * (0.5 * 0.625 + 0.5 * 1.0))),  # of all, or of the largest, by halves
        (Still(), 0.0),
    ],
    ids=lambda given: getattr(given, "name", None),
)
def test_what_follows_a_step_is_what_the_learner_says(learner: Any, value: float) -> None:
    plain = made(learner, [list(row) for row in HALF_UNLIKE])
    walk(plain, [(0, 0, 0.0, 1), (1, 0, 0.0, None)])
    assert plain.q[0][0] == value


@pytest.mark.parametrize("learner", [Sarsa(), SarsaLambda()])
def test_where_sarsa_is_cut_off_all_actions_that_might_follow_count(learner: Any) -> None:
    plain = made(learner, [list(row) for row in HALF_UNLIKE])
    walk(plain, [(0, 0, 0.0, 1)])
    assert plain.q[0][0] == 0.5 * (0.5 * (0.5 * 0.625 + 0.5 * 1.0))


def test_sarsa_takes_the_following_value_as_it_is_when_the_action_is_chosen() -> None:
    """From a state to itself: the update of the first step comes before that of the second."""
    learner = made(Sarsa(), [[1.0, 0.0]])
    walk(learner, [(0, 0, 0.0, 0), (0, 0, 0.0, None)])
    assert learner.q[0][0] == 0.5 * (1 + 0.5 * (0.5 - 1))


def test_double_q_learning_judges_one_tables_action_by_the_other() -> None:
    learner = made(DoubleQ(), [[0.0, 0.0], [0.5, 0.25]], coins=iter([0, 1, 0, 0, 1]))
    walk(learner, [(0, 0, 0.0, 1)])
    assert learner.q[0][0] == 0.5 * 0.125  # A: 0.5 (0.5 B(1, 0)); B as it was
    walk(learner, [(1, 0, 1.0, None)])
    assert learner.q[1][0] == 0.5 * (0.5 + 0.75)
    walk(learner, [(1, 1, 1.0, None)])
    assert [table[1] for table in learner.tables] == [[0.5, 0.625], [0.75, 0.25]]
    walk(learner, [(0, 0, 0.0, 1)])  # A would take action 1, which B holds for 0.25
    assert learner.tables[0][0][0] == 0.125 + 0.5 * (0.5 * 0.25 - 0.125)
    walk(learner, [(0, 0, 0.0, 1)])  # B would take action 0, which A holds for 0.5
    assert learner.tables[1][0][0] == 0.5 * (0.5 * 0.5)
    assert learner.visits[0][0] == 3


def test_a_draw_is_63_coins_its_lowest_bit_first() -> None:
    coins = flipped(iter([1 << 63 | 6, 1]))
    assert [next(coins) for _ in range(65)] == [0, 1, 1, *[0] * 60, 1, 0]


@pytest.mark.parametrize("kind", [QLambda, SarsaLambda])
def test_traces_bring_the_goal_to_the_whole_way_at_once(kind: Any) -> None:
    learner = made(kind(lambda_=0.5), zeros())
    walk(learner, CHAIN)
    assert [row[0] for row in learner.q] == [1 / 32, 1 / 8, 1 / 2]
    assert [row[0] for row in learner.visits] == [1, 1, 1]


@pytest.mark.parametrize("kind", [QLambda, SarsaLambda])
@pytest.mark.parametrize(("traces", "trace"), [("replacing", 1.0), ("accumulating", 1 + 1 / 4 + 1 / 16)])
def test_a_pair_met_again_has_a_trace_of_one_or_one_more(kind: Any, traces: str, trace: float) -> None:
    learner = made(kind(lambda_=0.5, traces=traces), zeros(1))
    walk(learner, [(0, 0, 0.0, 0), (0, 0, 0.0, 0), (0, 0, 1.0, None)])
    assert learner.q[0][0] == 0.5 * trace


@pytest.mark.parametrize("kind", [QLambda, SarsaLambda])
def test_a_trace_below_the_least_is_dropped(kind: Any) -> None:
    learner = made(kind(lambda_=0.5, least=0.1), zeros())
    walk(learner, CHAIN)
    assert [row[0] for row in learner.q] == [0, 1 / 8, 1 / 2]


@pytest.mark.parametrize(("kind", "first"), [(QLambda, 1 / 8), (SarsaLambda, 1 / 32)])
def test_an_action_that_is_not_greedy_cuts_watkins_traces_alone(kind: Any, first: float) -> None:
    learner = made(kind(lambda_=0.5), [[0.0, 0.0], [0.0, 0.5], [0.0, 0.0]])
    walk(learner, CHAIN)  # action 0 in state 1, whose action 1 is worth more
    assert [row[0] for row in learner.q] == [first, 1 / 8, 1 / 2]


def test_traces_end_with_their_episode() -> None:
    learner = made(QLambda(), zeros())
    walk(learner, [(0, 0, 0.0, 1)])
    walk(learner, [(1, 0, 1.0, None)])
    assert learner.q[0][0] == 0


def test_delayed_q_learning_lowers_a_value_after_m_steps_and_rests_until_another_changes() -> None:
    learner = made(DelayedQ(m=2, epsilon1=1 / 16), [[1.0], [1.0]])
    lost, other = [(0, 0, 0.0, None)], [(1, 0, 0.0, None)]
    walk(learner, lost)
    assert learner.q[0] == [1.0]
    walk(learner, lost)  # step 2
    assert learner.q[0] == [1 / 16]
    walk(learner, lost)
    walk(learner, lost)  # step 4: lower by 1/16 alone, and nothing has changed since step 2
    assert not learner.learns[0, 0]
    walk(learner, lost)
    assert not learner.learns[0, 0]
    walk(learner, other)
    walk(learner, other)  # step 7
    assert learner.q[1] == [1 / 16]
    walk(learner, lost)  # hears of it, and does not count
    assert learner.learns[0, 0]
    assert learner.l[0, 0] == 0
    assert learner.visits == [[6], [2]]


def test_r_max_plans_with_what_it_knows() -> None:
    learner = made(RMax(known=2), [[1.0], [1.0]])
    walk(learner, [(0, 0, 0.0, 1), (1, 0, 1.0, None)])
    assert learner.q == [[1.0], [1.0]]
    walk(learner, [(0, 0, 0.0, 1)])
    assert learner.q == [[0.5], [1.0]]
    walk(learner, [(1, 0, 0.0, None)])  # the goal and a loss: 1/2, and what is before it 1/4
    assert learner.q == [[0.25], [0.5]]
    walk(learner, [(1, 0, 0.0, None)])  # nothing is added to what is known
    assert learner.q == [[0.25], [0.5]]


def test_r_max_goes_round_a_circle_until_less_than_the_tolerance_changes() -> None:
    learner = made(RMax(known=1, tolerance=0.1), [[1.0]])
    walk(learner, [(0, 0, 0.0, 0)])
    assert learner.q == [[1 / 16]]  # 1/2, 1/4, 1/8, and 1/16 is less than 0.1 from that


def test_shaping_pays_the_difference_of_potentials_and_an_end_has_none() -> None:
    learner = made(QLearner(), [[0.0], [0.5]], potential=np.array([0.25, 0.5]))
    walk(learner, [(0, 0, 0.0, 1), (1, 0, 1.0, None)])
    assert learner.q == [[0.5 * (0.25 + 0.25 - 0.25)], [0.5 + 0.5 * (1 - 0.5 - 0.5)]]


def test_one_over_the_visits_makes_a_mean() -> None:
    learner = made(QLearner(), [[7.0]], alpha=ByVisits(1.0))
    for reward in (1.0, 0.0, 1.0, 1.0):
        walk(learner, [(0, 0, reward, None)])
    assert learner.q[0][0] == pytest.approx(0.75)


def test_a_linear_step_size_is_that_of_its_episode() -> None:
    learner = made(QLearner(), zeros(), alpha=Linear(1.0, 0.5, 2))
    for episode in range(3):
        walk(learner, [(episode, 0, 1.0, None)], episode)
    assert [row[0] for row in learner.q] == [1.0, 0.75, 0.5]


@pytest.mark.parametrize(
    ("one", "other", "settings"),
    [
        (QLambda(0.0), QLearner(), {}),
        (QLambda(0.0, "accumulating"), QLearner(), {}),
        (SarsaLambda(0.0), Sarsa(), {}),
        (SarsaLambda(0.0, "accumulating"), Sarsa(), {}),
        (ExpectedSarsa(), QLearner(), {"epsilon": 0.0}),  # never exploring
    ],
    ids=[
        "q-lambda",
        "q-lambda, accumulating",
        "sarsa-lambda",
        "sarsa-lambda, accumulating",
        "expected-sarsa",
    ],
)
def test_some_learners_are_others_where_a_setting_is_zero(
    one: Any, other: Any, settings: dict[str, Any]
) -> None:
    def learned(learner: Any) -> reference.Outcome:
        words = np.random.SeedSequence(5).generate_state(36, np.uint64)
        usual: dict[str, Any] = {"alpha": 0.1, "gamma": 0.9, "epsilon": 0.3, "episodes": 60, "horizon": 20}
        learning = Learning(**{**usual, "start": "anywhere", "learner": learner, **settings})
        world = reference.Gridworld(4, 15, 0.8, None, reference.xoshiro(words[32:]))
        return reference.learn(
            world, learning, np.zeros((16, 4)), reference.in_lanes(words[:32].reshape(4, 8))
        )

    assert learned(one) == learned(other)
    assert any(learned(one).reached)


def test_boltzmann_takes_actions_by_their_weight() -> None:
    """A temperature at which a value of 1 has three times the weight of 0: quarters."""
    explore = made(Still(), [[0.0, 1.0]], explore=Boltzmann(1 / math.log(3))).explore
    assert [explore.action(int(share * 2**32), 0) for share in (0.0, 0.24, 0.26, 0.99)] == [0, 0, 1, 1]
    assert explore.expected(0) == pytest.approx(0.75)


def test_ucb_tries_everything_and_then_weighs_what_it_took_least() -> None:
    """After 1 and 3 steps the bounds are c sqrt(ln 4) = 1.177 c, and 1/2 + c sqrt(ln 4 / 3) = 1/2 + 0.680 c."""
    for c, best in ((1.0, 1), (1.1, 0)):
        explore = made(Still(), [[0.0, 0.5]], explore=Ucb(c)).explore
        assert explore.expected(0) == 0.25
        assert [explore.action(draw, 0) for draw in (0, 4095)] == [0, 1]
        explore.took(0, 0)
        assert explore.action(0, 0) == 1
        for _ in range(3):
            explore.took(0, 1)
        assert explore.action(0, 0) == best
        assert explore.expected(0) == 0.5 * best
