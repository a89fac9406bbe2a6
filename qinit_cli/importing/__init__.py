"""Tables and learning curves of other programs, made artefacts: files in, nothing executed."""
