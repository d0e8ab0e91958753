#!/usr/bin/env python3
"""Fits the confidences of poses that use matching (src/antipode/pose/two_view_pose.cc) by logistic regression.

usage: fit_confidence.py matching|auto PAIRS.csv [PAIRS.csv ...]

Each file is the pairs.csv of `antipode evaluate --method matching` or `--method auto` on validation objects. A pair of
`matching` counts as right if its rotation is within 15 degrees of the truth, one of `auto` within 30. Needs numpy.
"""
import csv
import sys

import numpy as np

LEAST_SHARE, TELLING_SUPPORT = 1e-2, 10  # as in two_view_pose.cc
WEAK_PRIOR = 1e-2  # keeps the weights finite where the classes separate


def log_odds(probability):
    probability = min(max(probability, 1e-6), 1 - 1e-6)
    return np.log(probability / (1 - probability))


def matching_features(row):
    inliers, matches = float(row["inliers"]), float(row["matches"])
    deviation = min(max(float(row["rotation_deviation_deg"]), 0.01), 180)
    disagreement = float(row["translation_disagreement_deg"])
    return {"constant": 1, "log(1 + inliers)": np.log1p(inliers), "inliers / matches": inliers / max(1, matches),
            "log(deviation)": np.log(deviation), "log(1 + disagreement)": np.log1p(disagreement)}


def auto_features(row):
    share = min(max(float(row["share"]), LEAST_SHARE), 1 - LEAST_SHARE)
    by_itself = np.exp(-max(float(row["support"]), 0) / TELLING_SUPPORT)
    return {"constant": 1, "log odds of the share": log_odds(share),
            "log odds of the prior's confidence": by_itself * log_odds(float(row["prior_confidence"])),
            "by itself": by_itself}


METHODS = {"matching": (matching_features, "rotation_deviation_deg", 15), "auto": (auto_features, "share", 30)}


def read(paths, needed):
    for path in paths:
        with open(path, newline="", encoding="utf-8") as file:
            yield from (row for row in csv.DictReader(file) if row[needed])


def fit(x, y):
    """Newton's method on the penalised log likelihood."""
    weights = np.zeros(x.shape[1])
    for _ in range(50):
        p = 1 / (1 + np.exp(-x @ weights))
        gradient = x.T @ (y - p) - WEAK_PRIOR * weights
        hessian = (x * (p * (1 - p))[:, None]).T @ x + WEAK_PRIOR * np.eye(len(weights))
        weights += np.linalg.solve(hessian, gradient)
    return weights


def main(arguments):
    if len(arguments) < 2 or arguments[0] not in METHODS:
        sys.exit(__doc__)
    features_of, needed, right_below_deg = METHODS[arguments[0]]
    rows = list(read(arguments[1:], needed))
    y = np.array([float(row["rotation_error_deg"]) < right_below_deg for row in rows], dtype=float)
    features = [features_of(row) for row in rows]
    x = np.array([list(feature.values()) for feature in features])
    weights = fit(x, y)
    p = 1 / (1 + np.exp(-x @ weights))
    loss = -np.mean(y * np.log(p + 1e-12) + (1 - y) * np.log(1 - p + 1e-12))
    print(f"{len(rows)} pairs, {int(y.sum())} of them right, loss {loss:.3f}")
    for name, weight in zip(features[0], weights):
        print(f"  {weight:8.3f}  {name}")


if __name__ == "__main__":
    main(sys.argv[1:])
