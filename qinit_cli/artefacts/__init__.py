"""Artefacts: what each kind holds, the settings it was made with, and opening it."""

from qinit_cli.artefacts import kinds as kinds  # the store learns of ours
