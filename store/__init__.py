"""Artefacts on disk: sources, fits and runs as immutable, verified HDF5 files.

Nothing is imported here on purpose: ``store.errors`` must cost neither numpy nor h5py. The parts:

    store.work      open_work: learn, save part by part, publish whole
    store.reading   open_artefact, describe: read what was published, verified
    store.catalog   Store: names, references and lists
    store.schema    Axis, Column, Schema and the three kinds
"""
