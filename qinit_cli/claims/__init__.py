"""The paper's claims, each judged by one statistic: section 7 of the paper, C1 to C13."""
