import numpy as np

from qinit_cli.analysis.fallback import filled, largest_known

VALUES = np.array([[0.2, np.nan], [0.7, np.nan]])


def test_unknown_entries_get_the_fallback_and_are_counted() -> None:
    table, unknown = filled(VALUES, ~np.isnan(VALUES), 0.0)
    np.testing.assert_array_equal(table, [[0.2, 0.0], [0.7, 0.0]])
    assert unknown == 2


def test_the_optimistic_fallback_is_the_largest_known_value() -> None:
    assert largest_known(VALUES, ~np.isnan(VALUES)) == 0.7


def test_where_nothing_is_known_even_optimism_is_nought() -> None:
    assert largest_known(VALUES, np.zeros((2, 2), dtype=bool)) == 0.0
