"""Artefacts: what each kind holds, the settings it was made with, and opening it."""
