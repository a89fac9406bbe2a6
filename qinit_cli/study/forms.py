"""The forms that a study is exported to, and the file names that tell them."""

from __future__ import annotations

from typing import Literal

Form = Literal["make", "snakemake", "sh", "sbatch"]
BY_NAME: dict[str, Form] = {"Makefile": "make", "Snakefile": "snakemake"}
ENDINGS: dict[str, Form] = {".mk": "make", ".smk": "snakemake", ".sh": "sh", ".sbatch": "sbatch"}
