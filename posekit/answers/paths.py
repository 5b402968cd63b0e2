"""One answer of a whole sequence, of all the paths that it can be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.answers.answer import DISTINCT_METRES, REPRESENTED_PROBABILITY, Answer, answers_of
from posekit.answers.cover import cover, held_by, most_held
from posekit.answers.listed_bodies import ListedBodies
from posekit.following.following import Following
from posekit.geometry import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class PathAnswer:
    """The answer of a sequence: its likeliest path, how sure it is, and what else it can be.

    Parameters
    ----------
    rows : int array (K,)
        The representatives: paths that differ by 5 cm in some joint of some frame, so few that with what is within 5 cm
        of them they hold 95 % of the probability. Rows of the paths, the likeliest first.
    probability : array (K,)
        Of each representative and what it stands for; 0.95 or more together.
    frames : tuple of Answer (T,)
        Of each frame, over all paths; what the frame does not list is left out of their probabilities.
    """

    rows: NDArray[np.intp]
    probability: NDArray[np.float64]
    frames: tuple[Answer, ...]

    def __post_init__(self) -> None:
        self.rows.flags.writeable = self.probability.flags.writeable = False

    def __len__(self) -> int:
        """Count the representatives."""
        return len(self.rows)

    def __repr__(self) -> str:
        """Say how sure the first is, of how many paths and frames."""
        each = ", ".join(f"{p:.3g}" for p in self.probability.tolist())
        return f"PathAnswer(probability=[{each}], frames={len(self.frames)})"


def distinct_paths(joints: Array, share: Array) -> tuple[NDArray[np.intp], Array]:
    """Choose few of the paths (K, T, 14, 3), metres, that stand for all; K at most.

    Parameters
    ----------
    joints : array (K, T, 14, 3)
        Of the paths, metres; NaN where a joint is not known.
    share : array (K,)
        Their probabilities: 1 together.

    Returns
    -------
    tuple of int array (D,) and array (D,)
        The rows of paths that differ by 5 cm in some joint of some frame and hold 95 % of the probability, the
        likeliest first, and what each holds with those that it stands for.
    """
    one = np.zeros(len(joints), dtype=np.intp)
    points = joints.reshape(len(joints), -1, 3)
    held = held_by(cover(points, one, share, within=DISTINCT_METRES, hold=REPRESENTED_PROBABILITY), share)
    rows = most_held(held, REPRESENTED_PROBABILITY)
    return rows, held[rows]


def path_answer(following: Following) -> PathAnswer:
    """Say of the paths of a sequence what `posekit.answers.answers_of` says of the bodies of a frame.

    Joints that a path bridges are not known there: their regions and near and far are not either.
    """
    frames = following.joints.shape[1]
    share = np.asarray(following.share, dtype=np.float64)
    unlisted = [0.0] * frames if following.unlisted is None else following.unlisted.tolist()
    rows, probability = distinct_paths(following.joints, share)
    variance = np.where(np.isfinite(following.deviation), following.deviation, np.nan) ** 2
    return PathAnswer(
        rows=rows,
        probability=probability,
        frames=tuple(
            answers_of(
                [
                    ListedBodies(
                        joints=following.joints[:, t],
                        probability=share,
                        uncertainty=variance[:, t, :, None, None] * np.eye(3),
                        unlisted=unlisted[t],
                    )
                    for t in range(frames)
                ]
            )
        ),
    )
