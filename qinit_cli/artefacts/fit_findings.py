"""What the statistics of a fit amount to: shares, medians and means over its state-actions and held-out sources.

Made from a fit's arrays alone, so that a fit that was finished long ago tells the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.analysis.permutation import LEVEL
from qinit_cli.fitted import EOPL_TESTS, TESTS, FitOptions

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats

Arrays = Mapping[str, Any]
Findings = dict[str, Any]  # plain values, None where there is no number


def findings(arrays: Arrays, options: FitOptions) -> Findings:
    """What each group of statistics in the `arrays` of a fit amounts to; groups not asked for are absent.

    `arrays` holds the names along the axes `distribution` and `initialisation` as well.
    """
    told: Findings = {}
    if "normality_p" in arrays:
        told["normality"] = _normality(arrays, "normality", TESTS[options.normality])
    if "eopl_normality_p" in arrays:
        told["eopl_normality"] = _normality(arrays, "eopl_normality", EOPL_TESTS[options.eopl_normality])
    if "alternative_aic" in arrays:
        told["alternatives"] = _alternatives(arrays)
    if "held_out_task" in arrays:
        told["holdout"] = _held_out(arrays)
    if "theory_n" in arrays:
        told["theory"] = _theory(arrays)
    return told


def rejected(p: Floats) -> dict[str, float | None]:
    """Share of the testable state-actions rejected at 5 %: by the raw p, and as Benjamini-Hochberg and -Yekutieli have it.

    The state-actions depend on each other: Benjamini-Yekutieli's alone holds whatever the dependence.
    """
    from qinit_cli.analysis.multiplicity import benjamini_hochberg, benjamini_yekutieli

    corrections: dict[str, Callable[[Floats], Floats]] = {
        "raw": np.asarray,
        "benjamini_hochberg": benjamini_hochberg,
        "benjamini_yekutieli": benjamini_yekutieli,
    }
    tested = p[np.isfinite(p)]
    return {
        f"rejected_{name}": _plain(np.mean(corrected(tested) < LEVEL)) if tested.size else None
        for name, corrected in corrections.items()
    }


def _normality(arrays: Arrays, prefix: str, test: str) -> Findings:
    n, p = arrays[f"{prefix}_n"], arrays[f"{prefix}_p"]
    tested = np.isfinite(p)
    n_tested = n[tested] if tested.any() else np.zeros(1, n.dtype)
    return {
        "test": test,
        "level": LEVEL,
        "state_actions": int(p.size),
        "tested": int(tested.sum()),
        "not_testable": int((~tested).sum()),
        "n_least": int(n_tested.min()),
        "n_most": int(n_tested.max()),
        **rejected(p),
        "median_statistic": _median(arrays[f"{prefix}_w"]),
        "median_skewness": _median(arrays[f"{prefix}_skewness"]),
        "median_kurtosis": _median(arrays[f"{prefix}_kurtosis"]),
    }


def _alternatives(arrays: Arrays) -> Findings:
    from qinit_cli.analysis.alternatives import Alternatives

    names = _texts(arrays["distribution"])
    aic, score = arrays["alternative_aic"], arrays["alternative_log_score"]
    by_aic = Alternatives(names, aic).shares(larger_wins=False)
    by_score = Alternatives(names, score).shares(larger_wins=True)
    behind = score - score[names.index("lognormal")]
    return {
        "state_actions": int(aic[0].size),
        "tested": int(np.isfinite(score).any(axis=0).sum()),
        "distributions": [
            {
                "distribution": name,
                # the empirical distribution has no AIC
                "aic_wins": by_aic[name] if np.isfinite(aic[row]).any() else None,
                "log_score_wins": by_score[name],
                "median_log_score": _median(score[row]),
                "median_gain_on_lognormal": _median(behind[row]),
            }
            for row, name in enumerate(names)
        ],
    }


def _held_out(arrays: Arrays) -> Findings:
    """Means over the held-out tasks, each with its standard error; `behind` is paired with the nearest by mean |error|."""
    names = _texts(arrays["initialisation"])
    errors = {
        name: arrays[f"held_out_{name}"]
        for name in ("absolute", "squared", "bias", "logarithmic", "log_share")
    }
    absolute = errors["absolute"]
    mean = absolute.mean(axis=1)
    errors["behind"] = absolute - absolute[np.where(np.isnan(mean), np.inf, mean).argmin()]
    nearest = np.bincount(np.nanargmin(absolute, axis=0), minlength=len(names)) / absolute.shape[1]
    rows = [
        {"initialisation": start, "nearest": float(nearest[row])}
        | {key: value for name, values in errors.items() for key, value in _mean(name, values[row]).items()}
        for row, start in enumerate(names)
    ]
    return {"tasks": absolute.shape[1], "initialisations": rows}


def _mean(name: str, values: Floats) -> Findings:
    """The mean of the known values and its standard error."""
    known = values[np.isfinite(values)]
    return {
        name: _plain(known.mean()) if known.size else None,
        f"{name}_error": _plain(known.std(ddof=1) / np.sqrt(known.size)) if known.size > 1 else None,
    }


def _theory(arrays: Arrays) -> Findings:
    from qinit_cli.analysis.theory import pooled_share

    explained = arrays["theory_explained"]
    forms = [
        {"form": form}
        | {
            f"median_{name}": _median(arrays[f"theory_{form}_{name}"])
            for name in ("bias", "spread", "mean_ratio")
        }
        for form in ("product", "length")
    ]
    return {
        "state_actions": int(explained.size),
        "compared": int((arrays["theory_n"] > 0).sum()),
        "varying": int(np.isfinite(explained).sum()),
        "forms": forms,
        "explained_pooled": _plain(pooled_share(explained, arrays["theory_n"] * arrays["theory_variance"])),
        "explained_median": _median(explained),
        "explained_by_gamma_pooled": _plain(
            pooled_share(arrays["theory_explained_by_gamma"], arrays["theory_n"] * arrays["theory_variance"])
        ),
        "explained_by_gamma_median": _median(arrays["theory_explained_by_gamma"]),
    }


def _texts(names: Any) -> tuple[str, ...]:
    return tuple(name.decode() for name in names.tolist())


def _median(values: Floats) -> float | None:
    known = values[np.isfinite(values)]
    return _plain(np.median(known)) if known.size else None


def _plain(value: Any) -> float | None:
    import math

    number = float(value)
    return number if math.isfinite(number) else None
