"""Taylor's human as what an uncalibrated picture is lifted into: his twelve points, completed by neck and pelvis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from posekit.body import Figure, with_head
from posekit.geometry import Array
from posekit.linkages import Linkage
from posekit.recovery.body import ranges_of
from posekit.recovery.taylor_figure.completion import COMPLETED_FROM, Completion, taylor_checks
from posekit.recovery.taylor_figure.human import Human, taylor_human
from posekit.recovery.taylor_figure.proportions import TABLE_1, figure_of
from posekit.settings import RecoverSettings, Tolerance
from posekit.tree import Check, InterpretationTree, Leaves
from posekit.validators import collision, judge


@dataclass(frozen=True, kw_only=True, eq=False)
class TaylorBody:
    """Table 1's proportions at a stature; see `posekit.recovery.body.Body`.

    Parameters
    ----------
    figure : Figure
        The figure of the same proportions, which certifies.
    stature : float
        Metres.
    """

    figure: Figure
    stature: float
    inferred: tuple[str, ...] = tuple(COMPLETED_FROM)

    @staticmethod
    def of(stature: float, figure: Figure) -> TaylorBody:
        """Make the body of a person of this stature (m), with the limits and bodies of a figure."""
        return TaylorBody(figure=figure_of(stature, figure), stature=stature)

    @cached_property
    def linkage(self) -> Linkage:
        """His eleven segments, in metres."""
        relative = self._relative.linkage
        unit = self.stature / TABLE_1["height"]
        return replace(relative, lengths=relative.lengths * unit, unit=1.0, height=self.stature)

    @cached_property
    def tree(self) -> InterpretationTree:
        """The tree of his twelve points and both girdles' middles."""
        return self._human.spanned.tree

    @property
    def evidence(self) -> Sequence[tuple[tuple[int, int], float]]:
        """Nothing: every one of his segments lifts a point."""
        return ()

    def image(self, seen: Array) -> Array:
        """Pick his twelve points, and put the middles between them."""
        return self._human.spanned.place_image(seen[:, self._human.joints])

    def points(self, leaves: Leaves) -> Array:
        """Complete neck and pelvis; the head is not known."""
        return with_head(self._completion.complete(leaves.postures()))

    def checks(self, settings: RecoverSettings, tolerance: Tolerance) -> Sequence[Check]:
        """Make the checks that hold the middles, and the figure's on the completed joints."""
        judging = taylor_checks(
            self.figure,
            self.tree.joints,
            settings.checks,
            ranges=ranges_of(settings),
            tolerance=tolerance,
            contact_margin=settings.contact_margin + self.overlap,
        )
        return [*self._human.closing, *judging]

    @cached_property
    def overlap(self) -> float:
        """How deep bodies are in each other where the figure stands with hanging arms, metres; zero or negative.

        Table 1's hips are as wide as a body and its forearms reach to the fingers: where they overlap in standing they
        may overlap in any posture.
        """
        standing = self.figure.neutral_points[None]
        pairs = judge(collision(self.figure, exact=True), standing)
        return min(0.0, *(float(one.worst[0]) for one in pairs))

    @cached_property
    def _relative(self) -> Human:
        return taylor_human()

    @cached_property
    def _human(self) -> Human:
        return Human(linkage=self.linkage)

    @cached_property
    def _completion(self) -> Completion:
        return Completion(figure=self.figure, points=self.tree.joints)
