from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from statsmodels.stats.multitest import multipletests

from qinit_cli.analysis.multiplicity import benjamini_hochberg, benjamini_yekutieli, holm


@pytest.mark.parametrize(
    ("adjust", "name"), [(holm, "holm"), (benjamini_hochberg, "fdr_bh"), (benjamini_yekutieli, "fdr_by")]
)
def test_adjusted_p_equals_that_of_statsmodels(adjust: Callable[[np.ndarray], np.ndarray], name: str) -> None:
    rng = np.random.default_rng(0)
    for size in (1, 2, 37, 3600):
        p = np.round(rng.random(size) ** 3, 3)  # with ties
        np.testing.assert_allclose(adjust(p), multipletests(p, method=name)[1], rtol=1e-12)


def test_what_is_not_testable_is_not_counted() -> None:
    p = np.array([[0.01, np.nan], [np.nan, 0.04]])
    np.testing.assert_allclose(holm(p), [[0.02, np.nan], [np.nan, 0.04]])
    np.testing.assert_allclose(benjamini_hochberg(p), [[0.02, np.nan], [np.nan, 0.04]])
    np.testing.assert_allclose(benjamini_yekutieli(p), [[0.03, np.nan], [np.nan, 0.06]])
    assert np.isnan(holm(np.full(3, np.nan))).all()
