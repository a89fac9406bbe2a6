"""Runs handed to experiment trackers, after the fact: one file a tracker, each imported only where it is asked for.

A tracker's module has `log(record, project, where)`, which writes the record once and gives back where it is.
"""
