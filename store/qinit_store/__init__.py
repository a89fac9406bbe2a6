"""Artefacts on disk: immutable, verified HDF5 files.

Nothing is imported here on purpose: ``qinit_store.errors`` must cost neither numpy nor h5py. The parts:

    qinit_store.work      open_work: learn, save part by part, publish whole
    qinit_store.reading   open_artefact, describe: read what was published, verified
    qinit_store.catalog   Store: names, references and lists
    qinit_store.schema    Axis, Column, Schema: what an artefact holds
    qinit_store.kinds     register: the kinds that a program keeps
"""
