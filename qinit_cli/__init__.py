"""qinit: initial values for new tasks from solved ones, in tabular reinforcement learning."""

__version__ = "0.1.0"
