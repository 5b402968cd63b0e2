"""What the joints of many trees are lifted with, for NumPy and for the compiled loops."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from posekit.cameras import Camera, PinholeCamera
from posekit.geometry import Array
from posekit.tree.candidates import Candidates, lift_all, rays_of
from posekit.tree.leaves import Leaves


@dataclass(frozen=True, kw_only=True, eq=False)
class Lifting:
    """The views of F frames, and the segments of the object that is in them.

    Parameters
    ----------
    joints : tuple of str (J,)
        Names of the joints, the root first, each after its parent.
    parents : tuple of int (J,)
        Parent of each joint; -1 for the root.
    camera, root, image, lengths, given, tolerance
        See `posekit.tree.candidates.lift_all`.
    """

    joints: tuple[str, ...]
    parents: tuple[int, ...]
    camera: Camera
    root: Array
    image: Array
    lengths: Array
    given: Array | None
    tolerance: float

    def roots(self, *, lifted: bool = True) -> Leaves:
        """Return the roots of the trees; their joints are yet to be lifted where not `lifted`."""
        if not lifted:
            candidates = Candidates.start(self.root, self.parents, self.given)
        else:
            candidates = lift_all(
                self.camera,
                self.root,
                self.image,
                parents=self.parents,
                lengths=self.lengths,
                tolerance=self.tolerance,
                given=self.given,
            )
        return Leaves.start(self.joints, self.parents, candidates, self.given, self.root)

    def arrays(self, candidates: Candidates) -> tuple[Any, ...]:
        """Return what `posekit.compiled.tree_kernels.lift` takes after the frames."""
        pinhole = self.camera if isinstance(self.camera, PinholeCamera) else None
        # By joint and frame, though mostly every frame has the same.
        lengths = np.empty((len(self.parents), len(self.image)))
        lengths[:] = self.lengths.reshape(len(self.parents), -1)
        return (
            np.empty((0, 0, 3)) if pinhole is None else np.ascontiguousarray(rays_of(pinhole, self.image)),
            np.ascontiguousarray(np.isnan(self.image).any(axis=-1)),
            np.array(self.parents, dtype=np.int64),
            np.array(candidates.first, dtype=np.int64),
            lengths,
            float(self.tolerance),
            candidates.table,
            candidates.states,
            candidates.reach,
        )
