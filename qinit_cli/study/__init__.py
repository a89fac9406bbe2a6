"""A study: distributions, methods and settings in one file, from which artefacts, tables, pictures and a report are made."""
