"""A DQN of stable-baselines3 on mountain cars that no source met: from scratch, and in two ways with a start of qinit."""

import argparse

import gymnasium
import numpy as np
import pushed_car  # noqa: F401  registers PushedCar-v0
import torch
from gymnasium.wrappers import RescaleObservation
from stable_baselines3 import DQN
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.dqn.policies import DQNPolicy, QNetwork
from start_function import StartFunction

WAYS = ("scratch", "regression", "prior")
NOISE = 0.005  # standard deviation of a task's push, as of the sources
WINDOW = 1000  # steps of a row
EPISODES = 20  # of the start's own policy, without learning
RESAMPLES = 10_000
LAYERS = [64, 64]
SETTINGS = {
    "learning_rate": 1e-4,
    "n_steps": 5,
    "buffer_size": 50_000,
    "learning_starts": 1000,
    "batch_size": 128,
    "train_freq": 4,
    "gradient_steps": 1,
    "target_update_interval": 1000,
    "exploration_final_eps": 0.05,
}
# from scratch: without exploring no goal is met
EXPLORING = {"exploration_initial_eps": 1.0, "exploration_fraction": 0.3}
FOLLOWING = {"exploration_initial_eps": 0.05}  # with a start: else random steps would hide it


class Observed:
    """The start as torch has it: (N, A) of observations (N, D), which are scaled to -1 to 1."""

    def __init__(self, start):
        self._start = start
        values = start(np.random.default_rng(0).uniform(start.low, start.high, (10_000, len(start.low))))
        self.centre, self.scale = float(values.mean()), float(values.std())

    def __call__(self, observed):
        low, high = self._start.low, self._start.high
        return torch.from_numpy(self._start(low + (observed.numpy() + 1.0) / 2 * (high - low))).float()


class NetworkOverPrior(QNetwork):
    """Q = prior + network, which begins at 0; targets have the prior too, as the target network is one of these."""

    def __init__(self, *given, prior, **named):
        super().__init__(*given, **named)
        self._prior = prior
        torch.nn.init.zeros_(self.q_net[-1].weight)
        torch.nn.init.zeros_(self.q_net[-1].bias)

    def forward(self, observed):
        return super().forward(observed) + self._prior(observed)


class PolicyOverPrior(DQNPolicy):
    """A policy whose networks stand over a prior."""

    def __init__(self, *given, prior, **named):
        self._prior = prior
        super().__init__(*given, **named)

    def make_q_net(self):
        told = self._update_features_extractor(self.net_args, features_extractor=None)
        return NetworkOverPrior(**told, prior=self._prior)


class Acting(DQN):
    """A DQN that acts by its network from the first step on; the library's acts at random until `learning_starts`."""

    def _sample_action(self, learning_starts, *given):
        return super()._sample_action(0, *given)


def regress(network, prior, seed, steps=2000, batch=512):
    """Brings the network to the prior over the whole box; returns the root mean squared error of the last batch."""
    rng = torch.Generator().manual_seed(seed)
    optimiser = torch.optim.Adam(network.parameters(), 3e-3)
    slower = torch.optim.lr_scheduler.LinearLR(optimiser, 1.0, 0.02, steps)
    for _ in range(steps):
        observed = 2 * torch.rand(batch, network.features_dim, generator=rng) - 1
        wanted = (prior(observed) - prior.centre) / prior.scale
        loss = torch.nn.functional.mse_loss(network(observed), wanted)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        slower.step()
    # differences between actions are small beside the values: only the last layer has their scale
    with torch.no_grad():
        last = network.q_net[-1]
        last.weight *= prior.scale
        last.bias.mul_(prior.scale).add_(prior.centre)
    return loss.item() ** 0.5 * prior.scale


def car(seed):
    """The target task of that seed, and its push."""
    push = np.random.default_rng([1, seed]).normal(0.0, NOISE)
    return gymnasium.make("PushedCar-v0", push=push)


def followed(start, seed):
    """Mean return of the start's own greedy policy."""
    env, returns = car(seed), []
    for episode in range(EPISODES):
        state, _ = env.reset(seed=episode)
        earned, done = 0.0, False
        while not done:
            state, reward, terminated, truncated, _ = env.step(int(start(state)[0].argmax()))
            earned, done = earned + reward, terminated or truncated
        returns.append(earned)
    return np.mean(returns)


def learned(way, start, seed, steps):
    """Mean returns of the episodes that ended in each window of a DQN's steps, (W,)."""
    env = Monitor(RescaleObservation(car(seed), np.float32(-1), np.float32(1)))
    prior = Observed(start)
    policy, networks = "MlpPolicy", {"net_arch": LAYERS}
    if way == "prior":
        policy, networks["prior"] = PolicyOverPrior, prior
    exploring = EXPLORING if way == "scratch" else FOLLOWING
    dqn = Acting(
        policy,
        env,
        gamma=start.gamma,
        seed=seed,
        device="cpu",
        policy_kwargs=networks,
        **SETTINGS,
        **exploring,
    )
    if way == "regression":
        regress(dqn.q_net, prior, seed)
        dqn.q_net_target.load_state_dict(dqn.q_net.state_dict())
    dqn.learn(steps)
    windows = (np.cumsum(env.get_episode_lengths()) - 1) // WINDOW
    returns = np.array(env.get_episode_rewards())
    return [returns[windows == window].mean() for window in range(steps // WINDOW)]


def interval(values):
    """Mean and 95 % bootstrap interval over seeds (N,)."""
    picks = np.random.default_rng(0).integers(len(values), size=(RESAMPLES, len(values)))
    low, high = np.quantile(np.asarray(values)[picks].mean(axis=1), (0.025, 0.975))
    return f"{np.mean(values):.0f} [{low:.0f}, {high:.0f}]"


if __name__ == "__main__":
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("start", metavar="START.npz", help="of qinit start")
    asked.add_argument("--seeds", type=int, default=8, help="target tasks, one for each seed (8)")
    asked.add_argument(
        "--steps", type=int, default=10_000, help=f"of each DQN, a multiple of {WINDOW} (10000)"
    )
    options = asked.parse_args()
    if options.seeds < 2 or options.steps < WINDOW or options.steps % WINDOW:
        asked.error(f"--seeds must be 2 or more, --steps a multiple of {WINDOW}")
    torch.set_num_threads(1)
    start, seeds = StartFunction(options.start), range(options.seeds)
    print(f"start alone, without learning: {interval([followed(start, seed) for seed in seeds])}")
    curves = {way: np.array([learned(way, start, seed, options.steps) for seed in seeds]) for way in WAYS}
    print("steps", *WAYS, sep="\t")
    for window in range(options.steps // WINDOW):
        print((window + 1) * WINDOW, *(interval(curves[way][:, window]) for way in WAYS), sep="\t")
