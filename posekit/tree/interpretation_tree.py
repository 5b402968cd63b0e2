"""The binary interpretation tree (Lee & Chen 1985, §3.1), grown level by level over many frames at once.

A node holds no positions, only its frame and its branch code. What a check says about a node depends on the
branches of the few joints that the check reads; so each check is asked once for every different choice of
*those* branches that is still alive, and its answer serves all nodes that share it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from posekit.cameras import Camera
from posekit.compiled.compiling import is_fast
from posekit.geometry import Array
from posekit.tree import plain
from posekit.tree.check import Check
from posekit.tree.leaves import Leaves
from posekit.tree.lifting import Lifting


@dataclass(frozen=True, kw_only=True)
class InterpretationTree:
    """The tree of one articulated object.

    Parameters
    ----------
    joints : tuple of str (J,)
        Names, the root first, each after its parent.
    parents : tuple of int (J,)
        Parent of each joint; -1 for the root.
    lengths : array (J,) or (J, F, 1)
        Length of the segment to each joint's parent, metres, maybe of each frame; the root's is ignored.
    """

    joints: tuple[str, ...]
    parents: tuple[int, ...]
    lengths: Array

    def grow(
        self,
        camera: Camera,
        root: Array,
        image: Array,
        checks: Sequence[Check],
        *,
        given: Array | None = None,
        tolerance: float = 0.0,
    ) -> Leaves:
        """Grow the tree over F frames, pruning each branch at the first level where a check can judge it.

        Parameters
        ----------
        camera : Camera
            Projects and lifts; its first axis counts frames.
        root : array (F, 3)
            The root joint, camera frame, metres.
        image : array (F, J, 2)
            Image points; NaN where a joint was not seen.
        checks : sequence of Check
            Asked in this order at each level.
        given : array (F, G, 3), optional
            Further points, known beforehand, that checks may read as points J, J + 1, …; unknown where absent.
        tolerance : float
            Metres by which a segment may be too short for its image and count as tangent to its ray.

        Returns
        -------
        Leaves
            What survived, and why the rest did not.
        """
        by_level: list[list[Check]] = [[] for _ in self.joints]
        for check in checks:
            level = self._level(check)
            if level < len(by_level):
                by_level[level].append(check)
        lifting = Lifting(
            joints=self.joints,
            parents=self.parents,
            camera=camera,
            root=root,
            image=image,
            lengths=self.lengths,
            given=given,
            tolerance=tolerance,
        )
        if is_fast(len(root)):
            from posekit.tree import fast

            grown = fast.grow(lifting, by_level)
            if grown is not None:
                return grown
        leaves = lifting.roots()
        for joint in range(1, len(self.joints)):
            leaves = plain.branch(leaves, joint)
            for check in by_level[joint]:
                leaves = plain.apply(leaves, check)
        return leaves

    def prune(self, leaves: Leaves, checks: Sequence[Check]) -> Leaves:
        """Judge leaves by further checks: the motion model's, after the physical ones."""
        for check in checks:
            leaves = plain.apply(leaves, check)
        return leaves

    def _level(self, check: Check) -> int:
        """Return the first level at which all joints that a check reads are known, at least 1."""
        return max([1, *(point for point in check.points if point < len(self.joints))])
