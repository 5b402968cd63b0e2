"""The prior of people: the directions of postures of several sources, each counting the same, and each of its actions.

    python -m benchmarks.studies.people_prior CAPTURE.npz PYBULLET.whl -o people.toml

Files are motion as `benchmarks/people.py` reads it, one a source. The weights of terms are those of the built-in prior:
`benchmarks.studies.calibration` fits them to views of which the prior knows no action.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.people import people
from benchmarks.studies.prior_fitting import fit_prior
from posekit.ranking import load_prior, write_prior
from posekit.ranking.posture_prior import Prior
from posekit.skeleton import JOINTS
from posekit.synthesis import Capture

FRAMES_A_SECOND = 12.0
"""Of each clip that are taken: nearer ones are nearly the same."""


def action_of(name: str) -> str:
    """Name an action as all sources do."""
    plain = name.removeprefix("humanoid3d_")
    return {"run": "running", "walk": "walking", "jump": "jumping"}.get(plain, plain)


def prior_of_people(
    captures: Sequence[Capture], kept: Sequence[NDArray[np.bool_]] | None = None, name: str = "people"
) -> Prior:
    """Fit the directions of the motion of some captures, and take the rest from a built-in prior.

    Parameters
    ----------
    captures : sequence of Capture
        Each a source.
    kept : sequence of bool array, optional
        Of each, the clips that are known to the prior; all if not given.
    name : str
        The built-in prior.
    """
    joints, ups, weights = [], [], []
    for k, capture in enumerate(captures):
        told = np.isfinite(capture.points[:, : len(JOINTS)]).all(axis=(1, 2))
        known = np.flatnonzero(told if kept is None else told & kept[k][capture.clip])
        every = np.maximum(1, np.round(capture.fps[capture.clip[known]] / FRAMES_A_SECOND)).astype(int)
        rows = known[np.arange(len(known)) % every == 0]
        _, action = np.unique(
            np.array(list(map(action_of, capture.actions)))[capture.clip[rows]], return_inverse=True
        )
        count = np.bincount(action)
        joints.append(capture.points[rows, : len(JOINTS)])
        ups.append(np.broadcast_to(capture.up, (len(rows), 3)))
        weights.append(1.0 / count[action] / len(count))
    fitted = fit_prior(np.concatenate(joints), np.concatenate(ups), np.concatenate(weights))
    built_in = load_prior(name)
    return replace(built_in, blocks=fitted.blocks, balance=fitted.balance, contact=fitted.contact)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sources", type=Path, nargs="*")
    parser.add_argument("-o", "--output", type=Path, default=Path("people.toml"))
    given = parser.parse_args()
    if not given.sources:
        print("no motion given: python -m benchmarks.studies.people_prior FILE [FILE ...] -o PRIOR.toml")
        return
    write_prior(given.output, prior_of_people([people(path) for path in given.sources]))
    print(f"written: {given.output}")


if __name__ == "__main__":
    main()
