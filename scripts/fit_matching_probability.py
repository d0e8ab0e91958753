#!/usr/bin/env python3
"""Fits the weights of MatchingProbability (src/antipode/pose/two_view_pose.cc) by logistic regression.

usage: fit_matching_probability.py PAIRS.csv [PAIRS.csv ...]

Each file is the pairs.csv of `antipode evaluate --method auto` on validation objects. A pair counts as right if
the rotation of matching is within 15 degrees of the truth. Needs numpy.
"""
import csv
import sys

import numpy as np

RIGHT_BELOW_DEG = 15
WEAK_PRIOR = 1e-2  # keeps the weights finite where the classes separate


def read(paths):
    for path in paths:
        with open(path, newline="", encoding="utf-8") as file:
            yield from (row for row in csv.DictReader(file) if row["matching_error_deg"])


def features_of(row, with_prior):
    inliers, matches = float(row["inliers"]), float(row["matches"])
    deviation = min(max(float(row["rotation_deviation_deg"]), 0.01), 180)
    disagreement = float(row["translation_disagreement_deg"])
    features = [1, np.log1p(inliers), inliers / max(1, matches), np.log(deviation), np.log1p(disagreement)]
    if with_prior:
        mass = min(max(float(row["prior_mass"]), 1e-6), 1 - 1e-6)
        features.append(np.log(mass / (1 - mass)))
    return features


def fit(x, y):
    """Newton's method on the penalised log likelihood."""
    weights = np.zeros(x.shape[1])
    for _ in range(50):
        p = 1 / (1 + np.exp(-x @ weights))
        gradient = x.T @ (y - p) - WEAK_PRIOR * weights
        hessian = (x * (p * (1 - p))[:, None]).T @ x + WEAK_PRIOR * np.eye(len(weights))
        weights += np.linalg.solve(hessian, gradient)
    return weights


def main(paths):
    if not paths:
        sys.exit(__doc__)
    rows = list(read(paths))
    y = np.array([float(row["matching_error_deg"]) < RIGHT_BELOW_DEG for row in rows], dtype=float)
    print(f"{len(rows)} pairs, {int(y.sum())} of them right")
    names = ["constant", "log(1 + inliers)", "inliers / matches", "log(deviation)", "log(1 + disagreement)",
             "log odds of the prior's mass"]
    for with_prior in (True, False):
        x = np.array([features_of(row, with_prior) for row in rows])
        weights = fit(x, y)
        p = 1 / (1 + np.exp(-x @ weights))
        loss = -np.mean(y * np.log(p + 1e-12) + (1 - y) * np.log(1 - p + 1e-12))
        print("with the prior" if with_prior else "without a prior", f"(loss {loss:.3f})")
        for name, weight in zip(names, weights):
            print(f"  {weight:8.3f}  {name}")


if __name__ == "__main__":
    main(sys.argv[1:])
