"""All that a plug-in may import of qinit, with `qinit_cli.plugin.kernels`; docs/plugins.md teaches it.

These names stay. Here are those that cost nothing to import: a plug-in's modules are loaded to show help, so numpy, Numba and
`qinit_cli.plugin.kernels` are imported inside its functions.
"""

from qinit_cli.environments.bases import NeutralFamily, TableFamily
from qinit_cli.environments.family import Family
from qinit_cli.errors import NotAllowed
from qinit_cli.fitted import FittedTables as Fit
from qinit_cli.learners.learner import Learner
from qinit_cli.learning import Learning
from qinit_cli.learning import Learning as QLearning  # its name before there were other learners
from qinit_cli.methods.method import Initialisation, Look, Method
from qinit_cli.methods.plus import Plus
from qinit_cli.methods.targets import Targets
from qinit_cli.options import check, option

__all__ = [
    "Family",
    "Fit",
    "Initialisation",
    "Learner",
    "Learning",
    "Look",
    "Method",
    "NeutralFamily",
    "NotAllowed",
    "Plus",
    "QLearning",
    "TableFamily",
    "Targets",
    "check",
    "option",
]
