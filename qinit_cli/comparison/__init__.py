"""Runs beside each other: their scores, over source sets, with intervals."""
