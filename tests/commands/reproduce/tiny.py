"""`qinit` with a quick scale of seconds instead of minutes, on fewer distributions; nothing else is changed.

python tiny.py reproduce fig6 --scale quick -o DIR
"""

from __future__ import annotations

from qinit_cli.__main__ import main
from qinit_cli.paper import experiments
from qinit_cli.paper.experiments import Scale, ScaleSizes

SCALES = {
    "quick": Scale(
        "quick",
        {"gridworld": ScaleSizes(12, 300, 4, 40), "mountain-car": ScaleSizes(10, 300, 4, 30)},
        optimal=2,
        floor=3,
        floor_seeds=2,
        changes={"gridworld": {"size": 6}, "mountain-car": {"bins": 10}},
    )
}
SHRUNKEN = {"SCALES": SCALES, "VARIANCES": (7.0,), "NOISES": (0.01,)}

if __name__ == "__main__":
    for name, value in SHRUNKEN.items():
        setattr(experiments, name, value)
    main()
