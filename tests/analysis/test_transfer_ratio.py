from __future__ import annotations

import numpy as np
import pytest

from qinit_cli.analysis.intervals import over_targets
from qinit_cli.analysis.transfer_ratio import transfer_ratio


def test_an_exact_multiple_has_that_ratio_and_no_width() -> None:
    zero = np.random.default_rng(0).uniform(1, 2, (40, 1))
    found = transfer_ratio(3 * zero, zero, np.random.default_rng(1))
    assert found.defined[0]
    for end in (found.ratio.estimate, found.ratio.low, found.ratio.high):
        assert end[0] == pytest.approx(3)


def test_the_difference_is_the_paired_interval_of_the_same_generator() -> None:
    rng = np.random.default_rng(2)
    zero, values = rng.uniform(0, 1, (40, 2)), rng.uniform(0, 2, (40, 2))
    found = transfer_ratio(values, zero, np.random.default_rng(3)).difference
    known = over_targets(values - zero, np.random.default_rng(3))
    np.testing.assert_allclose([found.low, found.high], [known.low, known.high], rtol=1e-9)


def test_where_learning_from_zero_earns_nothing_there_is_no_ratio() -> None:
    rng = np.random.default_rng(4)
    zero = np.zeros((50, 2))
    zero[0, 0] = 1e-3  # one lucky target: the interval of the mean touches 0
    found = transfer_ratio(rng.uniform(1, 2, (50, 2)), zero, rng)
    assert not found.defined.any()
    for end in (found.ratio.estimate, found.ratio.low, found.ratio.high):
        assert np.isnan(end).all()
    assert (found.difference.low > 1).all()
