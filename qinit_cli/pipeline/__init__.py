"""The stages of the pipeline, without IO: each takes plain values and arrays and yields arrays."""
