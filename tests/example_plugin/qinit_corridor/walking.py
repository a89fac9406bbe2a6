"""How one walks; a file of its own, to show that compiled code is made anew when any file of a plug-in changes."""

from qinit_cli.plugin.kernels import inlined


@inlined
def walked(cell, steps, length):
    """The cell that so many steps lead to: the walls stop."""
    return min(max(cell + steps, 0), length - 1)
