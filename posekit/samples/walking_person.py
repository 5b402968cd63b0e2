"""Somebody 1.75 m tall who walks: in space, and with mistakes as files of motion have them."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from posekit.body import Figure, load_figure
from posekit.body.anthropometry import lengths_from_proportions
from posekit.formats.motion.bvh import write_bvh
from posekit.formats.motion.motion import Motion
from posekit.formats.motion.npz import write_npz
from posekit.geometry import Array
from posekit.skeleton import DOFS, POINTS
from posekit.synthesis import Walker

PERSON_STATURE: Final = 1.75
"""Metres; the proportions are de Leva's (1996)."""
WALK_RATE: Final = 30.0
"""Frames a second."""
WALK_SECONDS: Final = 3.0
ANKLE_HEIGHT: Final = 0.08
"""Metres, of the lowest ankle above the ground: the figure has no feet."""
WALK_UP: Final = "+y"
ELBOW_BENT_BACK: Final = slice(30, 36)
"""Frames whose right elbow is bent backward, by 25 degrees."""
JUMPED_FROM: Final = 70
"""From this frame on everything is 30 cm further to the side: two takes, cut together."""


def figure() -> Figure:
    """Return the person's figure."""
    return load_figure().scaled(lengths_from_proportions("de-leva", PERSON_STATURE).lengths)


def times() -> Array:
    """Return the times (T,) of the frames, seconds."""
    return np.arange(round(WALK_SECONDS * WALK_RATE)) / WALK_RATE


def configurations(person: Figure) -> Array:
    """Return the walk (T, nq): x ahead, y up, z to the right, the ground at y = 0, metres and radians."""
    walker = Walker(figure=person)
    time = times()
    q = walker.configurations(walker.phase(time))
    q[:, :3] += walker.travel(time)
    ankles = person.forward_kinematics(q)[:, [POINTS.index(f"{side}_ankle") for side in ("right", "left")]]
    q[:, 1] += ANKLE_HEIGHT - ankles[..., 1].min()
    return q


def write_walk(path: Path, person: Figure, q: Array) -> None:
    """Write the walk as points in an NPZ."""
    write_npz(
        path,
        Motion(names=POINTS, points=person.forward_kinematics(q), time=times(), rate=WALK_RATE, up=WALK_UP),
    )


def write_defective_walk(path: Path, person: Figure, q: Array) -> None:
    """Write the walk as a BVH with two mistakes: an elbow that bends backward, and a cut between two takes."""
    q = q.copy()
    elbow = person.angle_index[DOFS.index("right_elbow.flexion")]
    q[ELBOW_BENT_BACK, elbow] = np.radians(-25.0)
    q[JUMPED_FROM:, 2] += 0.3
    write_bvh(path, person, q, times(), up=WALK_UP)
