"""What a picture's points are lifted into: the stick figure's own tree, or another with its proportions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from posekit.body import Figure
from posekit.geometry import Array
from posekit.settings import RecoverSettings, Tolerance
from posekit.skeleton import JOINTS, PARENTS, RIGID_SEGMENTS, SEGMENTS, TREE_SEGMENTS, segment_name
from posekit.tree import Check, InterpretationTree, Leaves
from posekit.validators import CheckOptions, Ranges, chosen_checks, load_ranges, make_checks
from posekit.validators.options import LEVEL_CAMERA_UP
from posekit.validators.walking import thresholds_of

if TYPE_CHECKING:
    from posekit.linkages import Linkage


def ranges_of(settings: RecoverSettings) -> Ranges:
    """Return the joint ranges that are asked for, loaded where only their name is given."""
    given = settings.ranges
    return given if isinstance(given, Ranges) else load_ranges(str(given))


def loaded(settings: RecoverSettings) -> RecoverSettings:
    """Return settings with their ranges loaded and their checks in the order in which they are applied.

    Raises
    ------
    InputError
        Where a check is unknown, or the ranges cannot be loaded.
    """
    return settings.changed(checks=chosen_checks(settings.checks), ranges=ranges_of(settings))


def suite_of(
    settings: RecoverSettings, figure: Figure, tolerance: Tolerance, *, exact: bool = False
) -> list[Check]:
    """Make the checks of a figure that settings ask for, with every distance measured where `exact`."""
    options = CheckOptions(
        ranges=ranges_of(settings),
        rigid_tolerance=tolerance.distances,
        rigid_mode="placement" if tolerance.placement else "side",
        angle_tolerance=tolerance.angle,
        rules=tuple(settings.rules),
        thresholds=thresholds_of(settings.walkers),
        contact_margin=settings.contact_margin,
        exact=exact,
        up=LEVEL_CAMERA_UP,
    )
    return make_checks(figure, settings.checks, options)


class LiftedBody(Protocol):
    """A tree over points of the body, and the way from its leaves to the figure's joints."""

    @property
    def figure(self) -> Figure:
        """The person's figure, which certifies the postures."""
        ...

    @property
    def tree(self) -> InterpretationTree:
        """The tree; its first joint is the root."""
        ...

    @property
    def linkage(self) -> Linkage:
        """The same as a linkage: all segments whose length is known, for the scale of an uncalibrated picture."""
        ...

    @property
    def stature(self) -> float:
        """The person's height, metres."""
        ...

    @property
    def overlap(self) -> float:
        """How deep bodies may be in each other because of the body's own proportions, metres; zero or negative."""
        ...

    @property
    def inferred(self) -> tuple[str, ...]:
        """The joints of the figure that the tree has not, and that are completed."""
        ...

    @property
    def evidence(self) -> Sequence[tuple[tuple[int, int], float]]:
        """Distances (m) between two of the tree's joints that lift nothing: they show that points are exact."""
        ...

    def image(self, seen: Array) -> Array:
        """Pick the image points (F, J, 2) of the tree's joints from those of the figure's (F, 14, 2)."""
        ...

    def points(self, leaves: Leaves) -> Array:
        """Place the figure's joints and head (N, 19, 3) in leaves, metres."""
        ...

    def checks(self, settings: RecoverSettings, tolerance: Tolerance) -> Sequence[Check]:
        """Make the checks that prune the tree."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class FigureBody:
    """The stick figure itself: 14 joints from the neck, 13 segments, and the four distances of torso and hips.

    Where some image points are `derived` from others, distances come out right by construction, and are no evidence.
    """

    figure: Figure
    stature: float
    inferred: tuple[str, ...] = ()
    derived: tuple[str, ...] = ()
    overlap: float = 0.0

    @cached_property
    def tree(self) -> InterpretationTree:
        """The tree of Lee & Chen (1985, section 2.2)."""
        lengths = [0.0, *(self.figure.lengths[segment_name(segment)] for segment in TREE_SEGMENTS)]
        return InterpretationTree(joints=JOINTS, parents=PARENTS, lengths=np.array(lengths))

    @cached_property
    def linkage(self) -> Linkage:
        """All 17 lengths: torso and hips are closed loops."""
        from posekit.linkages import Linkage

        return Linkage(
            name="figure",
            points=JOINTS,
            segments=SEGMENTS,
            lengths=np.array([self.figure.lengths[segment_name(segment)] for segment in SEGMENTS]),
            unit=1.0,
        )

    @property
    def evidence(self) -> Sequence[tuple[tuple[int, int], float]]:
        """The four distances inside torso and hips; none where joints are derived."""
        if self.derived:
            return ()
        return [(segment, self.figure.lengths[segment_name(segment)]) for segment in RIGID_SEGMENTS]

    def image(self, seen: Array) -> Array:
        """Take them as they are."""
        return seen

    def points(self, leaves: Leaves) -> Array:
        """Put the head beside the joints."""
        return np.concatenate([leaves.postures(), leaves.given[leaves.frame]], axis=1)

    def checks(self, settings: RecoverSettings, tolerance: Tolerance) -> Sequence[Check]:
        """Make the figure's own checks."""
        return suite_of(settings, self.figure, tolerance)
