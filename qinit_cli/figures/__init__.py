"""Drawing, and nothing else: arrays in, a matplotlib figure out."""
