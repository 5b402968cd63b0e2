"""Taylor's human as a tree: twelve points, eleven segments, 2^11 = 2048 flips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.cameras import ScaledOrthographicCamera
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.linkages import Linkage, SpanningTree, load_linkage, span
from posekit.recovery.taylor_figure.completion import MIDDLE_POINTS, Completion
from posekit.skeleton import JOINT, segment_name
from posekit.tree import BranchState, Check, InterpretationTree, Leaves
from posekit.tree.bits import path_of
from posekit.validators.linkage import closure

N_FLIPS = 1 << 11
"""Two for each of the eleven segments (Taylor 2000, §4)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Human:
    """The tree of Taylor's human, for frames whose segments may each have lengths of their own.

    Parameters
    ----------
    linkage : Linkage
        Twelve points named as posekit's joints, the middles of both girdles, and the spine between them.

    Raises
    ------
    InputError
        Where the linkage is another object.
    """

    linkage: Linkage

    def __post_init__(self) -> None:
        missing = [name for name in MIDDLE_POINTS if name not in self.linkage.nodes]
        unknown = [name for name in self.linkage.points if name not in JOINT]
        if missing or unknown or len(self.linkage.points) != 12:
            raise InputError(
                f"linkage {self.linkage.name}: not Taylor's human; expected his 12 points and "
                f"{', '.join(MIDDLE_POINTS)}"
            )

    @cached_property
    def spanned(self) -> SpanningTree:
        """The linkage's tree, from the first point."""
        return span(self.linkage)

    @property
    def points(self) -> tuple[str, ...]:
        """The names of the tree's points: the twelve, and the two middles."""
        return self.spanned.tree.joints

    @cached_property
    def joints(self) -> NDArray[np.intp]:
        """The index in `posekit.skeleton.JOINTS` of each of the twelve points (12,)."""
        return np.array([JOINT[name] for name in self.linkage.points])

    @cached_property
    def closing(self) -> list[Check]:
        """The checks that hold both middles in the middle: they leave one flip a segment."""
        return closure(self.spanned)

    def lengths_of(self, figure: Figure) -> Array:
        """Return a figure's lengths of the eleven segments (S,), metres; its spine is drawn straight."""
        named = dict(figure.lengths)
        spine = Completion(figure=figure, points=self.points).spine
        lengths = []
        for a, b in self.linkage.segments:
            ends = (self.linkage.nodes[a], self.linkage.nodes[b])
            lengths.append(spine if set(ends) == set(MIDDLE_POINTS) else named[_named(ends)])
        return np.array(lengths)

    def measure(self, points: Array) -> Array:
        """Measure the eleven segments (F, S) of the twelve points (F, 12, 3)."""
        nodes = self.linkage.place_nodes(points)
        start, end = np.array(self.linkage.segments).T
        return np.asarray(np.linalg.norm(nodes[:, end] - nodes[:, start], axis=-1))

    def bound(self, image: Array, lengths: Array) -> Array:
        r"""Return the least s (F,) at which every segment is long enough for its image (F, 12, 2).

        :math:`s \ge \sqrt{\Delta u^2 + \Delta v^2} / l` for every segment (Taylor 2000, eq. 3, which is printed
        upside down).
        """
        nodes = self.linkage.place_nodes(image)
        start, end = np.array(self.linkage.segments).T
        seen = np.linalg.norm(nodes[:, end] - nodes[:, start], axis=-1)
        return np.asarray((seen / lengths).max(axis=1))

    def tree(self, lengths: Array) -> InterpretationTree:
        """Make the tree of segments of given lengths, metres: (S,), or (F, S) for one set a frame."""
        whole = np.array(self.linkage.lengths)
        of_joint = np.array(self.spanned.segments[1:])
        share = self.spanned.tree.lengths[1:] / whole[of_joint]
        lifted = np.moveaxis(lengths[..., of_joint] * share, -1, 0)
        # A length a frame broadcasts against the candidates of that frame.
        lifted = lifted[..., None] if lifted.ndim == 2 else lifted
        return replace(self.spanned.tree, lengths=np.concatenate([np.zeros((1, *lifted.shape[1:])), lifted]))

    def grow(self, image: Array, lengths: Array, scale: Array, checks: Sequence[Check] = ()) -> Leaves:
        """Grow the trees of F images of twelve points (F, 12, 2), pixels, at scales s (F,), pixels a metre.

        The middle of the body's image is the origin; the first point is at depth zero. A segment that is too short
        for its image lies flat: its end is where it is seen, and no nearer and no farther than its start.

        Parameters
        ----------
        image : array (F, 12, 2)
            His twelve points, pixels.
        lengths : array (S,) or (F, S)
            Metres.
        scale : array (F,)
            Pixels a unit of length, a frame each.
        checks : sequence of Check
            Asked beside those that hold the middles.
        """
        camera = ScaledOrthographicCamera(scale=scale)
        placed = self.spanned.place_image(image - image.mean(axis=1, keepdims=True))
        root = np.concatenate([camera.unproject(placed[:, 0]), np.zeros((len(image), 1))], axis=1)
        return self.tree(lengths).grow(camera, root, placed, [*self.closing, *checks], tolerance=np.inf)

    def code(self, leaves: Leaves, truth: Array, *, mirrored: bool = False) -> NDArray[np.int32]:
        """Return the branch code (F,) that takes the true flip at every segment, or the other one at every one.

        Parameters
        ----------
        leaves : Leaves
            Their candidates tell which segments have no foreshortening left, and so one flip only.
        truth : array (F, 12, 3)
            Camera frame: the sign of each segment's depth is what counts.
        mirrored : bool
            Take all depths the other way: the mirror image, which has the same image.
        """
        depth = self.linkage.place_nodes(truth)[:, list(self.spanned.nodes), 2] * (-1.0 if mirrored else 1.0)
        rows = np.arange(len(truth))
        parents = self.spanned.tree.parents
        bits: dict[int, NDArray[np.int32]] = {}
        code = np.zeros(len(truth), dtype=np.int32)
        for joint in range(1, len(parents)):
            path = np.zeros(len(truth), dtype=np.int32)
            for ancestor in path_of(parents[joint], parents):
                path = path << 1 | bits[ancestor]
            far = (depth[:, joint] > depth[:, parents[joint]]).astype(np.int32)
            state = leaves.candidates.branches[joint][rows, path << 1 | 1]
            bits[joint] = np.where(state == BranchState.COINCIDENT, 0, far).astype(np.int32)
            code = code << 1 | bits[joint]
        return code

    def twelve(self, postures: Array) -> Array:
        """Put postures of the tree (N, 14, 3) in the linkage's order (N, 12, 3), middles left out."""
        return self.spanned.points(postures)


def taylor_human() -> Human:
    """Return Taylor's human."""
    return Human(linkage=load_linkage("taylor_human"))


def _named(ends: tuple[str, ...]) -> str:
    return segment_name((JOINT[ends[0]], JOINT[ends[1]]))
