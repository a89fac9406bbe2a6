"""The paper's claims, each judged by one statistic: section 7 of the paper, C1 to C13.

`registry` has all of them; it stands apart because claims compute, and help must not wait for what computes.
"""
