"""The exact tree and brute force on the same views: survivors, and the time of `recover`.

    python -m benchmarks.tree [--views 20] [--batch 2000]

Brute force computes all 8192 leaves of a view in one NumPy batch and judges every leaf that has a solution with every
check. Pinocchio's pool tests the collisions of whole configurations, without the head, because the views show no head
points. The survivors must equal those of `posekit.recover`. The neck is given. Times are processor times of one run.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import posekit
from benchmarks.common import least, parser, table, timed
from benchmarks.solver import noisy_view, one_by_one
from posekit.body import Figure, load_figure
from posekit.cameras import View
from posekit.geometry import Array
from posekit.settings import EXACT, RecoverSettings
from posekit.skeleton import PARENTS, SEGMENT_NAMES
from posekit.tree.candidates import DEPTH
from posekit.validators.judge import chosen_checks, judge_postures

SETTINGS = RecoverSettings()


def leaves(view: View, frame: int, figure: Figure) -> Array:
    """Return the joints of all 8192 leaves (8192, 14, 3), metres, camera frame; NaN for leaves without a solution."""
    camera: Any = view.camera  # of a pinhole, without distortion
    K, image = camera.K, view.image[frame]
    rays = np.linalg.solve(K, np.concatenate([image, np.ones((len(image), 1))], axis=1).T).T
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    far = (np.arange(1 << DEPTH)[:, None] >> np.arange(DEPTH)[::-1]) & 1
    joints = np.full((len(far), len(PARENTS), 3), np.nan)
    joints[:, 0] = view.root[frame]
    for j in range(1, len(PARENTS)):
        start = joints[:, PARENTS[j]]
        along = start @ rays[j]
        across = ((start - along[:, None] * rays[j]) ** 2).sum(axis=1)
        square = figure.lengths[SEGMENT_NAMES[j - 1]] ** 2 - across
        root = np.sqrt(np.where(square >= 0, square, np.nan))
        joints[:, j] = (along + np.where(far[:, j - 1] == 1, root, -root))[:, None] * rays[j]
    joints[~(joints[..., 2] > 0).all(axis=1)] = np.nan
    return joints


def brute_force(view: View, frame: int, figure: Figure, pool: pin.GeometryPool) -> NDArray[np.intp]:
    """Judge all leaves of one view and return the codes of the survivors."""
    joints = leaves(view, frame, figure)
    code = np.flatnonzero(np.isfinite(joints).all(axis=(1, 2)))
    head = np.full((len(code), 5, 3), np.nan)
    points = np.concatenate([joints[code], head], axis=1)
    checks = [
        one for one in chosen_checks(SETTINGS, of_robot=False, in_time=False) if one.name != "collision"
    ]
    alive = np.ones(len(code), dtype=np.bool_)
    for found in judge_postures(points, checks, figure, SETTINGS, tolerance=EXACT).values():
        alive &= ~found.violated.any(axis=1)
    q = np.asfortranarray(figure.configurations(points).q.T)
    alive &= ~np.asarray(pin.computeCollisionsInParallel(1, pool, q, True)).astype(bool)
    return code[alive]


def main() -> None:
    made = parser(__doc__)
    made.add_argument("--views", type=int, default=20)
    made.add_argument("--batch", type=int, default=2000)
    given = made.parse_args()
    figure = load_figure()
    bodies = figure.geometry.copy()
    bodies.removeGeometryObject(next(one.name for one in bodies.geometryObjects if "head" in one.name))
    pool = pin.GeometryPool(figure.model, bodies, 1)
    view = noisy_view(max(given.batch, given.views), 0.0, given.seed)
    result = posekit.recover(view)
    expected: list[NDArray[np.intp]] = []
    brute = timed(lambda: expected.extend(brute_force(view, k, figure, pool) for k in range(given.views)))
    branch = np.asarray(result.survivors.branch)
    same = sum(
        sorted(f"{code:0{DEPTH}b}" for code in expected[k]) == sorted(branch[result.rows(k)].tolist())
        for k in range(given.views)
    )
    print(f"survivors identical to brute force: {same} of {given.views} views")
    ways = {
        "a batch": (len(view), lambda: posekit.recover(view)),
        "a batch, answered": (len(view), lambda: posekit.recover(view).answer),
        "one view a call": (given.views, lambda: one_by_one(view, given.views)),
    }
    spent = least({name: way for name, (_, way) in ways.items()}, 3)
    each = {"brute force": brute / given.views} | {name: spent[name] / ways[name][0] for name in ways}
    rows = [(name, f"{1000 * t:.3f}", f"{each['brute force'] / t:.0f}") for name, t in each.items()]
    print(table(("way", "ms a view", "times faster than brute force"), rows))


if __name__ == "__main__":
    main()
