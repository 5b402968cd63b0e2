"""The validator of whole postures: every check at once, no tree."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from posekit.body import Figure, with_head
from posekit.body.measured import LIMB_NAMES, MeasuredPerson, figure_of, measured_person
from posekit.display.short_repr import ShortRepr, short
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.robots import Robot
from posekit.robots.kinematics import Kinematics
from posekit.settings import ValidateSettings
from posekit.skeleton import HEAD_POINTS, JOINTS
from posekit.tree import Check
from posekit.validators.given_points import points_of, sequence_of
from posekit.validators.measured import Allowance
from posekit.validators.motion.profile import with_profile
from posekit.validators.ranges import load_ranges
from posekit.validators.registry import PHYSICAL_CHECKS, chosen_checks, make_checks
from posekit.validators.robot.collision import SelfCollision
from posekit.validators.robot.figure import FigureConfigurations
from posekit.validators.robot.load import STICK_FIGURE, load_subject
from posekit.validators.robot.report import Report
from posekit.validators.robot.robot_validator import RobotValidator, Verdict
from posekit.validators.robot.settings import robot_settings
from posekit.validators.robot.subject import Subject
from posekit.validators.suite import judge
from posekit.validators.walking import thresholds_of

NO_NOISE_METRES = 1e-6
"""Metres that noise may change a distance by: less is rounding, and a robot is judged as without."""


class Validator(ShortRepr):
    """Judges postures against a human figure, or any robot.

    Parameters
    ----------
    urdf : str, path, Figure or Robot, optional
        ``"stick_figure"`` (the default), the built-in figure; the path of a figure's URDF; or a figure: these are
        judged in closed form. Or the name of a robot of example-robot-data (``"human"``, ``"g1"``, …), the path of its
        URDF, or a `posekit.robots.Robot`: these are judged by inverse kinematics (docs, "Validate").
    settings : ValidateSettings, optional
        What postures are judged by, and with which tolerances; the usual if not given.
    **changes
        Single settings that are other than those, by the names of the fields of `posekit.ValidateSettings`, as
        ``contact_margin=0.01``.

    Examples
    --------
    >>> import numpy as np, posekit
    >>> standing = posekit.load_figure().neutral_points[:14]
    >>> posekit.Validator().check(standing[None]).verdicts
    ['valid']
    >>> posekit.Validator("human").check(standing[None]).verdicts
    ['valid']
    """

    def __init__(
        self,
        urdf: str | Path | Figure | Robot | None = None,
        settings: ValidateSettings | None = None,
        **changes: Any,
    ) -> None:
        asked = (settings or ValidateSettings()).changed(**changes)
        subject = load_subject(
            STICK_FIGURE if urdf is None else urdf,
            srdf=asked.srdf,
            package_dirs=asked.package_dirs,
            untrusted=asked.untrusted,
            visuals=asked.bodies == "visual",
        )
        asked, self.profile = with_profile(asked)
        self.settings = asked
        self.robot = subject if isinstance(subject, Robot) else None
        self._figure = subject if isinstance(subject, Figure) else None
        if isinstance(subject, Robot):
            own = robot_settings(asked)
            self.checks, self.lengths = own.check_names, own.lengths
            self._check_asked()
            self.settings = asked.changed(ranges=own.ranges)
            self._robot = RobotValidator(robot=subject, settings=own)
            self._noisy_robot: RobotValidator | None = None
            _ = self._robot.models.limits
            return
        # A figure that somebody gives is the body that they mean; the built-in one stands for anybody.
        anybody = not asked.strict and urdf in (None, STICK_FIGURE)
        self.lengths = asked.lengths or ("median" if anybody else "model")
        for option, given, known in (
            ("--lengths", self.lengths, ("model", "median")),
            ("--bodies", asked.bodies, ("auto", "urdf")),
            ("--joint-map", asked.joint_map, (None,)),
        ):
            if given not in known:
                raise InputError(
                    f"{option} {given}: the stick figure has its own; expected a robot, as --urdf human"
                )
        self._chosen = chosen_checks(PHYSICAL_CHECKS if asked.checks is None else asked.checks)
        self.checks = tuple(one.name for one in self._chosen)
        self._check_asked()
        self._options: dict[str, Any] = {
            "ranges": load_ranges(asked.ranges) if isinstance(asked.ranges, str) else asked.ranges,
            "angle_tolerance": asked.angle,
            "rules": asked.rules,
            "thresholds": thresholds_of(asked.walkers),
            "up": asked.up,
        }
        self._own_suite = self._make_suite(subject, Allowance(settings=asked.changed(strict=True)))
        self._person: tuple[tuple[Any, ...], Figure, list[Check]] | None = None

    def _check_asked(self) -> None:
        """Refuse to judge by nothing."""
        if not self.checks and not self.profile.checks:
            raise InputError("--checks: none is given, so nothing would be judged; expected one or more")

    def _facts(self) -> list[str]:
        body = short(self._figure.source) if self.robot is None and self._figure else short(self.robot)
        return [body, f"checks={short(self.checks)}", f"lengths={self.lengths!r}"]

    @property
    def figure(self) -> Figure:
        """The stick figure that is judged by.

        Raises
        ------
        InputError
            Where it is a robot.
        """
        if self._figure is None:
            raise InputError("the validator judges a robot; expected a stick figure; ask for .robot")
        return self._figure

    def check(
        self,
        postures: ArrayLike | None = None,
        head: ArrayLike | None = None,
        *,
        q: ArrayLike | None = None,
        sequence: ArrayLike | None = None,
        lengths: Mapping[str, float] | None = None,
        behind: bool | None = None,
        person: MeasuredPerson | None = None,
        configured: bool = True,
    ) -> Report:
        """Judge postures, given by their joints or as configurations.

        Postures are taken for frames of one person, whose lengths and measuring noise they tell
        (`posekit.body.measured`), unless the settings are strict or say otherwise.

        Of the stick figure rigid parts, collision, walking and projected ranges judge the posture as it is given; the
        URDF's ranges judge the configuration made from it, and `Report.fk_distance` says how far the two are apart.
        Of a robot all but rigid parts judge the configuration that comes nearest.

        Parameters
        ----------
        postures : array (N, 14, 3)
            Joints in tree order, metres, any right-handed frame; NaN where unknown.
        head : array (N, 5, 3), optional
            Nose, eyes and ears; without them the neck is undecided and no arm collides with the head.
        q : array (N, nq), optional
            Configurations in Pinocchio's order, instead of postures; they are taken as they are, and nothing is decided
            of those that hold NaN.
        sequence : int array (N,), optional
            Which sequence in time each posture belongs to: a robot's fit then starts from the one before.
        lengths : mapping, optional
            Segment lengths in place of the postures' medians, metres: those of a whole file that is judged in parts.
        behind : bool, optional
            Likewise, whether the shoulders lie behind the line from neck to pelvis.
        person : MeasuredPerson, optional
            All of that, and the measuring noise, of whose recording the postures are a part.
        configured : bool
            Whether the configurations of a stick figure's postures are wanted, and how far these are off; verdicts do
            not depend on them.

        Returns
        -------
        Report

        Raises
        ------
        InputError
            Where a shape is wrong, a coordinate is no number, infinite or absurd, or q is no configuration.
        """
        if (postures is None) == (q is None):
            raise InputError("give either postures or q; expected one of the two")
        if q is not None:
            return self._check_configurations(q)
        joints = points_of("postures", postures, len(JOINTS))
        points = with_head(joints)
        if head is not None:
            points[:, len(JOINTS) :] = points_of("head", head, len(HEAD_POINTS), len(joints))
        if self._figure is None:
            which = None if sequence is None else sequence_of(sequence, len(joints))
            if person is not None and self.lengths == "median":
                lengths, behind = person.lengths, person.behind
            robot = self._robot_for(person or measured_person(joints))
            return _report(robot.judge_postures(points, sequence=which, lengths=lengths, behind=behind))
        figure, suite = self.figure_and_suite(joints, lengths=lengths, behind=behind, person=person)
        configurations, distance = (
            figure.configurations(points)
            if configured
            else (np.full((len(points), figure.model.nq), np.nan), np.full(len(points), np.nan))
        )
        return Report(
            judgements=judge(suite, points),
            complete=np.asarray(np.isfinite(joints).all(axis=(1, 2))),
            q=configurations,
            fk_distance=distance,
        )

    def figure_and_suite(
        self,
        joints: Array,
        *,
        lengths: Mapping[str, float] | None = None,
        behind: bool | None = None,
        person: MeasuredPerson | None = None,
    ) -> tuple[Figure, Sequence[Check]]:
        """Return the stick figure by which postures are judged, and its checks.

        Parameters
        ----------
        joints : array (N, 14, 3)
            The postures, metres: frames of one person, whose lengths the figure gets.
        lengths, behind, person
            As `check` takes them.

        Returns
        -------
        figure : Figure
        suite : sequence of Check

        Raises
        ------
        InputError
            Where a robot judges.
        """
        found = person or measured_person(joints)
        found = found if lengths is None else replace(found, lengths=lengths)
        return self._judging(found if behind is None else replace(found, behind=behind))

    def describe(self) -> dict[str, Any]:
        """List what decides the verdicts besides the options, as reports have it."""
        if self._figure is None:
            return self._robot.models.describe()
        return {"figure": self._figure.hash, "checks": list(self.checks)}

    @property
    def configuration_names(self) -> tuple[str, ...]:
        """A name for each entry of q, in the order in which `check` takes it."""
        return self.robot.configuration_names if self.robot is not None else self.figure.configuration_names

    @property
    def kinematics(self) -> Kinematics | None:
        """The joints of a robot, by its joint map; None of the stick figure, and of a robot that has none."""
        return self._robot.models.known_kinematics if self.robot is not None else None

    def _check_configurations(self, q: ArrayLike) -> Report:
        """Judge configurations; of those with NaN nothing is decided, and Pinocchio sees a neutral one instead."""
        try:
            given = np.asarray(q)
        except ValueError:  # rows of different lengths: refused with what was expected
            return self._check_known(q)
        if given.ndim != 2 or given.dtype.kind != "f" or not np.isnan(given).any():
            return self._check_known(q)
        rows = np.asarray(np.isnan(given).any(axis=1))
        neutral = pin.neutral(self.configured[0].model)
        if given.shape[1] == len(neutral):
            given = np.where(rows[:, None], neutral, given)
        return self._check_known(given).without(rows)

    def _check_known(self, q: ArrayLike) -> Report:
        if self._figure is None:
            return _report(self._robot.judge_configurations(q))
        checked, judgements = self._configurations.judge(q)
        return Report(
            judgements=judgements,
            complete=np.ones(len(checked), dtype=np.bool_),
            q=checked,
            fk_distance=np.zeros(len(checked)),
            colliders=(self._configurations.collision,) if "collision" in self.checks else (),
        )

    @property
    def configured(self) -> tuple[Subject, SelfCollision | None]:
        """The model whose configurations are judged, and what judges its collisions where they are asked about."""
        judged = self._configurations if self._figure is not None else self._robot.models.own
        return judged.subject, judged.collision if "collision" in self.checks else None

    @cached_property
    def _configurations(self) -> FigureConfigurations:
        options = self._options
        return FigureConfigurations(
            figure=self.figure,
            checks=self.checks,
            ranges=options["ranges"],
            suite=self._own_suite,
            angle_tolerance=options["angle_tolerance"],
            contact_margin=self.settings.contact_margin,
        )

    def told_of(self, person: MeasuredPerson) -> dict[str, Any]:
        """Say by what a person's postures are judged, as reports do: whose body, and what is allowed in it."""
        if self._figure is None:
            settings = self._robot_for(person).settings
            noise = self.settings.noise if self.settings.noise is not None else round(person.noise, 6)
            return {
                "noise": noise if math.isfinite(noise) else None,
                "angle_tolerance": round(settings.angle, 4),
                "rigid_tolerance": f"{100 * settings.rigid:.3g}cm",
                "contact_margin": f"{100 * settings.contact_margin:.3g}cm",
            }
        figure = self._judging(person)[0]
        return {
            **Allowance(settings=self.settings, person=person).told(figure),
            "shoulders": figure.shoulder_side,
            "moved_lengths": dict(figure.moved_lengths),
        }

    def _robot_for(self, person: MeasuredPerson) -> RobotValidator:
        """Return what judges a robot's postures, with what the measuring noise of a person allows; the last is kept."""
        allowed = Allowance(settings=self.settings, person=person)
        if self.settings.strict or allowed.off() < NO_NOISE_METRES:
            return self._robot
        settings = allowed.of_robot(self._robot.settings, made_up=self._robot.models.bodies == "capsules")
        if self._noisy_robot is None or self._noisy_robot.settings != settings:
            self._noisy_robot = replace(self._robot, settings=settings)
        return self._noisy_robot

    def _judging(self, person: MeasuredPerson) -> tuple[Figure, list[Check]]:
        """Return figure and checks for a person; the last are kept, for a recording that is judged in parts."""
        allowed = Allowance(settings=self.settings, person=person)
        noise = tuple(map(allowed.off, ("", *LIMB_NAMES)))
        body = tuple(person.lengths.items()), person.behind
        key = body, str(person.hips_forward), noise
        if self._person is None or self._person[0] != key:
            figure = self.figure
            if self._person is not None and self._person[0][0] == body:
                figure = self._person[1]
            elif self.lengths == "median" and person.lengths:
                figure = figure_of(figure, person.lengths, person.behind)
            self._person = key, figure, self._make_suite(figure, allowed)
        return self._person[1:]

    def _make_suite(self, figure: Figure, allowed: Allowance) -> list[Check]:
        made = make_checks(
            figure,
            self._chosen,
            rigid_mode="side",
            limbs=True,
            exact=True,
            directions=True,
            rigid_tolerance=allowed.rigid(figure),
            contact_margin=allowed.contact_margin,
            **{**self._options, "ranges": allowed.ranges(self._options["ranges"])},
        )
        return allowed.applied(made, figure)


def _report(verdict: Verdict) -> Report:
    residual = verdict.residual
    return Report(
        judgements=verdict.judgements,
        complete=verdict.complete,
        q=verdict.q,
        fk_distance=_largest(residual) if verdict.points else np.zeros(len(verdict.q)),
        points=verdict.points,
        residual=residual,
        colliders=tuple(model.collision for model in verdict.models)
        if "collision" in verdict.models[0].settings.check_names
        else (),
    )


def _largest(residual: Array) -> Array:
    """Return the largest known distance (N,); NaN where none is known."""
    return np.asarray(np.fmax.reduce(residual, axis=1))
