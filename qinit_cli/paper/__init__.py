"""The paper: its settings and experiments as data, and its claims judged."""
