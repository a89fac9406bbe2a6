"""The compiled loops: arrays and scalars in, arrays written in place, many tasks a call."""
