"""The options of a Gymnasium environment, for the families that take them: each declared once."""

from __future__ import annotations

from qinit_cli.environments.gym_spaces import DEFAULT_BINS
from qinit_cli.options import option

PANEL = "Environment"
NAMES = ("set", "bins", "range", "wrap", "state", "goal", "returns")
SET = option(
    None,
    "An argument or number of the environment, the same for all tasks; may be given several times.",
    metavar="NAME=VALUE",
    default_text="as the environment has it",
    panel=PANEL,
)
BINS = option(
    None,
    "Bins along each dimension of a Box: one number, or one for each dimension.",
    metavar="N[,N...]",
    default_text=str(DEFAULT_BINS),
    panel=PANEL,
)
RANGE = option(
    None,
    "What the bins or tiles of a dimension cover; needed where the environment has no bounds; may be given several times.",
    metavar="DIM=LOW:HIGH",
    default_text="the environment's bounds",
    panel=PANEL,
)
WRAP = option(
    None,
    "What is put around the environment: a function or class of a module that takes it and gives it back wrapped; may be "
    "given several times, from the inside out.",
    metavar="MODULE:FACTORY",
    default_text="nothing",
    panel=PANEL,
)
STATE = option(
    None,
    "Attributes that are the state in the place of what the environment observes, such as agent_pos,agent_dir; --range "
    "gives what each number covers.",
    metavar="ATTRIBUTE[,...]",
    default_text="what is observed",
    panel=PANEL,
)
GOAL = option(
    None,
    "Which end is the goal: terminated (every one), a rule such as reward>0 (of the last step), or survived "
    "(the horizon is the goal, and every end a failure).",
    metavar="RULE",
    default_text="the ends that pay best, if there is a table; else it must be given",
    panel=PANEL,
)
RETURNS = option(
    None,
    "The least and the largest discounted return with --reward native; needed where there is no table.",
    metavar="LOW:HIGH",
    default_text="from the rewards of the environment's table",
    panel=PANEL,
)
