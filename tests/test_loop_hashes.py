"""The bits that the learning loops make: every method in every kind of world, by the content hash of its run.

Made by the library, whose hashes are those of the commands, in less time. A hash that is changed on purpose is changed here, in
the commit that says why.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import pytest

import qinit_cli as qinit
from qinit_cli.environments import FAMILIES
from qinit_cli.errors import NotAllowed
from qinit_cli.methods import METHODS

EXAMPLE = Path(__file__).parent / "example_plugin"
ENTRY = "[qinit.families]\ncorridor = qinit_corridor.corridor:Corridor\n"
SHORT = "ShortPole-v0"  # CartPole, which is cut off after 12 steps
POLE = {"bins": "1,3,4,3", "range": ("1=-2:2", "3=-2:2"), "vary": "gravity=normal:9.8,2"}
ANYWHERE = {"start": "anywhere"}


@dataclass(frozen=True)
class World:
    """A family, how many sources and targets of it are learned and how, and what a shift changes."""

    name: str
    family: dict[str, Any]
    sources: dict[str, Any]
    targets: dict[str, Any]
    shift: dict[str, str | float]
    evaluate_every: int = 15


def _world(
    name: str, family: dict[str, Any], tasks: tuple[int, int], episodes: tuple[int, int], **more: Any
) -> World:
    both = [{"tasks": count, "episodes": length} for count, length in zip(tasks, episodes, strict=True)]
    return World(name, family, both[0] | more.pop("sources", {}), both[1] | more.pop("targets", {}), **more)


# tasks of sources and targets: fewer and more than there are lanes (four of gridworlds, one of Python's, eight of others)
WORLDS = {
    "grid": _world(
        "gridworld", {"size": 6, "variance": 2}, (9, 11), (300, 40), shift={"p_low": 0.8}, targets=ANYWHERE
    ),
    "windy": _world("windy-gridworld", {"size": 6}, (5, 3), (300, 40), shift={"p": 0.9}),
    "mixture": _world(
        "mixture-gridworld",
        {"size": 8, "means": "2:2,5:5"},
        (4, 1),
        (300, 60),
        shift={"p_high": 0.7},
        evaluate_every=0,
    ),
    "point": _world("mountain-car", {"bins": 8}, (11, 11), (1000, 40), shift={"hill": 0.1}),
    "valley": _world(
        "mountain-car", {"bins": 7, "target_start": "valley"}, (3, 3), (1000, 40), shift={"noise": 0.015}
    ),
    "gusts": _world(
        "mountain-car",
        {"bins": 8, "noise_per": "step", "noise": 0.005},
        (3, 2),
        (1000, 40),
        shift={"noise": 0.002},
    ),
    "anywhere": _world(
        "mountain-car", {"bins": 8}, (2, 9), (1000, 40), shift={"hill": -0.1}, targets=ANYWHERE
    ),
    "lake": _world(
        "gym",
        {"env_id": "FrozenLake-v1", "vary": "success_rate=uniform:0.4,0.9"},
        (9, 11),
        (600, 80),
        shift={"vary": "success_rate=uniform:0.7,0.9"},
        evaluate_every=0,
    ),
    "taxi": _world(
        "gym",
        {"env_id": "Taxi-v4", "set": "is_rainy=True", "vary": "rainy_probability=uniform:0.7,0.9"},
        (3, 3),
        (2000, 60),
        shift={"vary": "rainy_probability=uniform:0.5,0.6"},
        targets=ANYWHERE,
    ),
    "pole": _world(
        "gym",
        {"env_id": "CartPole-v1", "goal": "survived", **POLE},
        (2, 3),
        (80, 20),
        shift={"vary": "gravity=normal:12,1"},
        sources={"horizon": 20},
        evaluate_every=0,
    ),
    "cut": _world(
        "gym",
        {"env_id": SHORT, "goal": "terminated", **POLE},
        (3, 2),
        (80, 20),
        shift={"vary": "gravity=normal:12,1"},
    ),
    "corridor": _world("corridor", {"length": 8}, (9, 11), (200, 40), shift={"slip": 0.4}),
}
# a run -> the method, its options
RUNS: dict[str, tuple[str, dict[str, Any]]] = {
    **{name: (name, {}) for name in METHODS},
    "ptrs+": ("ptrs", {"init": "logqinit-median"}),
    "drs+": ("drs", {"init": "logqinit-mean"}),
    "ops-tl+": ("ops-tl", {"init": "ucoi"}),
    "ops-tl-exploring": ("ops-tl", {"explore_while_following": True, "rho": 0.999}),
    "posterior-unfrozen": ("posterior", {"freeze": 0, "evidence": "bounded"}),
    "posterior-geometric": ("posterior", {"mixing": "geometric", "evidence": "centred"}),
    "shifted": ("logqinit-median", {}),
}
HASHES = """
run                 grid   windy  mixture point  valley gusts  anywhere lake   taxi   pole   cut    corridor
sources             97ca2f 6dfb8d c1b838  a0f1c4 4b6332 4e0bf8 d7f481   6cc4ba 5a101f a45898 85232c e4d8cc
zero                9e0920 cd66c4 05f980  fe0222 2e55d9 db26af d0a676   6509db 588e0b 39994a f4397c 18d92c
mean                a5980f bc3489 9a063a  dec10e 66b68e 512282 360b44   9da4fd 65b4d0 430716 f200c3 5298e0
maxqinit            7543dc 8a8d20 f635af  147592 c872bb a1c776 5e355b   2d4dc1 fdbd8d 15ec84 947b67 bf2807
ucoi                cbde05 bf4ba4 55f889  937b2e a8be74 872481 572ec1   2dfae0 924dc7 01f900 25f7a3 dcce16
logqinit-median     16c4ba 369d1e c70819  e7b790 d1bd6f 98fb92 58463a   2bf3ad 4a002e cab7c1 1e5731 eeb300
logqinit-mean       c15923 586c11 35fcbf  58b75f 4614a2 e1b0cd a88c02   522a27 806078 13b01a c728c2 b2704f
logqinit-quantile   1f9b5c 4e9dd5 e691e5  ca253b 55230c c213be 2db901   cab89e ce6219 2c1ba9 f53d3b 83fd8b
optimal             3d692c 04f980 df58fa  38b5e6 5ee2ed 44f527 090f0d   37d14c fce775 0949e4 cfbc4b cdb4d8
ptrs                5896f7 bf0a5b f17ac2  6a0cee 5517de 46058c f2ee81   cfed5c 11d7e4 3f44cd 59cff7 5d14ab
drs                 b2a133 01caf0 273ed4  70a798 a206af 1af478 6c6160   -      -      -      -      -
ops-tl              251300 88c68d 76e0f9  859d6e f247e6 b5b152 742eb7   7aa230 85332f 7497a2 8f0b37 912b77
posterior           24f6fd 404be3 e97bd3  9b0a41 ee605c 2846e3 30869b   7c9ffa f4a28c 92679a 74119a 71c23b
ptrs+               60acf8 c056f1 e55082  4f26ab 558d1e bc57df 1ee3f3   39be36 2eb655 1cac10 d4afa5 f244d7
drs+                530840 8bed44 97b2ac  28a520 35f9ba f10cfc 31d553   -      -      -      -      -
ops-tl+             54e9f6 831565 5d01c5  df5930 d16944 7623e8 443c0a   ec4758 b23b72 858891 9432a9 08cfef
ops-tl-exploring    fd5207 14e1de e84814  878fda 07ff00 846723 983c2c   ad1e16 5f7c33 76abd2 5e3b1a 851e04
posterior-unfrozen  081403 70398e 901e97  4167c6 26b51c 2f1bc6 b72515   5c18f5 10a75f 176070 5c897c f49ef4
posterior-geometric 6fc02a ad6d76 bb6a74  a9a462 12c4bd a5a90f ad3063   9d8155 446c3c 59a727 9f48f5 f3bfd4
shifted             436dff 54c61a 5ef013  ea57f6 2838bc 0f46ac 6ad0d7   c38074 228986 7249a2 06dd6a 3360cd
"""


@pytest.fixture(autouse=True)
def corridor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The example plug-in, found as if it were installed, and a CartPole that is soon cut off."""
    about = tmp_path / "qinit_corridor-0.1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: qinit-corridor\nVersion: 0.1.0\n")
    (about / "entry_points.txt").write_text(ENTRY)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.syspath_prepend(EXAMPLE)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    gymnasium.register(SHORT, "gymnasium.envs.classic_control:CartPoleEnv", max_episode_steps=12)
    FAMILIES.forget()
    yield
    FAMILIES.forget()
    del gymnasium.registry[SHORT]


def made(world: World, jobs: int = 1) -> dict[str, str]:
    """The first six digits of the hashes of the sources, and of a run of every method; - where the family does not allow it."""
    sources = qinit.train_sources(FAMILIES[world.name](**world.family), jobs=jobs, **world.sources)
    fit, found = qinit.fit(sources), {"sources": sources.digest[:6]}
    given = {**world.targets, "keep_q": True, "evaluate_every": world.evaluate_every, "jobs": jobs}
    for run, (method, options) in RUNS.items():
        shift = world.shift if run == "shifted" else {}
        try:
            found[run] = qinit.transfer(METHODS[method](**options), fit, shift=shift, **given).digest[:6]
        except NotAllowed:
            found[run] = "-"
    return found


def pinned(world: str) -> dict[str, str]:
    head, *rows = (line.split() for line in HASHES.strip().splitlines())
    return {row[0]: row[head.index(world)] for row in rows}


@pytest.mark.parametrize("world", WORLDS)
def test_every_method_makes_the_same_bits_as_ever(world: str) -> None:
    assert made(WORLDS[world]) == pinned(world)
