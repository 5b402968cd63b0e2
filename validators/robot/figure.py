"""Configurations of the stick figure, judged as those of any robot, under the names that its findings have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from posekit.body import Figure
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.robots import check_configurations
from posekit.skeleton import DOFS, urdf_joint_name
from posekit.tree import Check
from posekit.validators.ranges import Ranges
from posekit.validators.robot.collision import SelfCollision
from posekit.validators.robot.configurations import judge_quickly
from posekit.validators.robot.subject import Subject
from posekit.validators.suite import Judgement, judge


@dataclass(frozen=True, kw_only=True, eq=False)
class FigureConfigurations:
    """Judges configurations of a figure.

    Parameters
    ----------
    figure : Figure
        The stick figure, whose closed form gives configurations.
    checks : sequence of str
        Those of the stick figure. Rigid parts have nothing to say: the lengths are the figure's own.
    ranges : Ranges
        Projected ones judge the figure's joints at q.
    suite : sequence of Check
        The figure's checks of postures, for projected ranges and for walking.
    angle_tolerance, contact_margin : float
        Degrees; metres.
    """

    figure: Figure
    checks: tuple[str, ...]
    ranges: Ranges
    suite: Sequence[Check]
    angle_tolerance: float
    contact_margin: float

    def judge(self, q: ArrayLike, source: str = "q") -> tuple[Array, Sequence[Judgement]]:
        """Return the checked configurations (N, nq), and what is said about them.

        Raises
        ------
        InputError
            Where they are none of the figure's, or no check is left to judge them.
        """
        checked = check_configurations(self.figure.model, q, source)
        checked.flags.writeable = False  # its margins may be asked for later
        if set(self.checks) == {"rigid-parts"}:
            raise InputError(
                "--checks: rigid-parts: a configuration's lengths are the figure's own, so nothing would be judged; "
                "expected joint-range, collision or walking"
            )
        limits = "joint-range" in self.checks and not self._of_postures
        quick = judge_quickly(
            self.subject,
            self.collision if "collision" in self.checks else None,
            checked,
            tolerance=self.angle_tolerance if limits else None,
        )
        named = quick.renamed(self._under_its_names)
        of_points = [check for check in self.suite if not check.of_configuration]
        if not of_points:
            return checked, named
        found = {one.check: one for one in judge(of_points, self.figure.forward_kinematics(checked))}
        found |= {one.check: one for one in named}
        order = dict.fromkeys(check.name for check in self.suite)
        return checked, [found[name] for name in order if name in found]

    @cached_property
    def subject(self) -> Subject:
        """The figure's model, limits and bodies."""
        figure, ranges = self.figure, self.ranges.of(self.figure)
        if ranges.kind == "configuration" and ranges.limits:
            limits = ranges.limits.items()
            figure = figure.with_limits({dof: (np.radians(a), np.radians(b)) for dof, (a, b) in limits})
        model = figure.model
        return Subject(
            model=model,
            lower=np.where(model.lowerPositionLimit < -1e100, -np.inf, model.lowerPositionLimit),
            upper=np.where(model.upperPositionLimit > 1e100, np.inf, model.upperPositionLimit),
            geometry=figure.geometry,
        )

    @cached_property
    def collision(self) -> SelfCollision:
        """What judges collisions."""
        return SelfCollision(subject=self.subject, contact_margin=self.contact_margin)

    @property
    def _of_postures(self) -> bool:
        """Whether ranges are of postures, and not only limits of single angles."""
        return self.ranges.kind != "configuration" or self.ranges.anatomy is not None

    @staticmethod
    def _under_its_names(judgement: Judgement) -> Judgement:
        """Return a judgement with the figure's names of its angles."""
        dofs = {urdf_joint_name(dof): dof for dof in DOFS}
        return replace(judgement, where=tuple(dofs.get(name, name) for name in judgement.where))
