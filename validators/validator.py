"""The validator of whole postures: every check at once, no tree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.body import Figure, with_head
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.robots import Robot
from posekit.robots.joint_map import JointMap
from posekit.robots.scaling import segment_lengths
from posekit.settings.check import check_settings
from posekit.skeleton import HEAD_POINTS, JOINTS
from posekit.tree import Check
from posekit.validators.joint_range import TOLERANCE
from posekit.validators.ranges import load_ranges
from posekit.validators.registry import PHYSICAL, AnyCheck, chosen_checks, make_checks
from posekit.validators.robot.figure import FigureConfigurations
from posekit.validators.robot.load import STICK_FIGURE, load_subject
from posekit.validators.robot.report import Report
from posekit.validators.robot.robot_validator import RobotValidator, Verdict
from posekit.validators.robot.settings import LENGTHS, ROBOT_DEFAULT, Bodies, Lengths, RobotSettings
from posekit.validators.suite import judge
from posekit.validators.walking import DEFAULT_RULES, thresholds_of

RIGID_TOLERANCE = 0.03
"""Metres: measured torsos give by some centimetres (docs, "Tolerances")."""

FARTHEST = 1e9
"""Metres: no body is there, and well beyond it squares overflow, to findings that are undecided."""


class Validator:
    """Judges postures against a human figure, or any robot.

    Parameters
    ----------
    urdf : str, path, Figure or Robot, optional
        ``"stick_figure"`` (the default), the built-in figure; the path of a figure's URDF; or a figure: these are
        judged in closed form. Or the name of a robot of example-robot-data (``"human"``, ``"g1"``, …), the path of its
        URDF, or a `posekit.robots.Robot`: these are judged by inverse kinematics (docs, "Validate").
    checks : sequence of str, Check or CheckSettings, optional
        Of a figure some of ``rigid-parts``, ``joint-range``, ``collision``, ``walking``, the first three unless told
        otherwise, and your own (docs, "Write your own check"); of a robot some of ``reach``, ``rigid-parts``,
        ``joint-range``, ``collision``, ``balance``, the first four.
    ranges : str
        ``urdf``, ``table1`` (figures alone) or the path of a TOML table.
    rules : sequence of int
        Rules of walking.
    walkers : {"paper", "people"}
        Whose thresholds those have: by the paper's word, or as real walkers keep them.
    rigid_tolerance : float
        Metres by which distances inside rigid parts, the lengths of the limbs, and the fit of a robot may be off.
    angle_tolerance : float
        Degrees by which the direction of a segment may be off, or a robot's joint outside its limits.
    contact_margin : float
        Metres that bodies must keep from each other; negative allows penetration.
    lengths : {"model", "median", "each"}, optional
        Whose segment lengths the model has: its own (figures unless told otherwise), the medians of the postures
        (robots unless told otherwise), or each posture's own (robots alone, slow).
    joint_map : str or JointMap, optional
        Which frames of a robot stand for the joints; found by their names where not given.
    bodies : {"auto", "urdf", "visual", "capsules"}
        What collides, of a robot: its collision bodies, its visual bodies, or capsules that are made up; ``auto``
        makes them up where no two collision bodies can touch.
    srdf, package_dirs, untrusted
        See `posekit.robots.load_robot`.
    up : array (3,)
        Against gravity, in the frame of the postures: for ``balance``.

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
        *,
        checks: Sequence[AnyCheck] | None = None,
        ranges: str = "urdf",
        rules: Sequence[int] = DEFAULT_RULES,
        walkers: str = "paper",
        rigid_tolerance: float = RIGID_TOLERANCE,
        angle_tolerance: float = TOLERANCE,
        contact_margin: float = 0.0,
        lengths: Lengths | None = None,
        joint_map: str | JointMap | None = None,
        bodies: Bodies = "auto",
        srdf: str | Path | None = None,
        package_dirs: Sequence[str | Path] = (),
        untrusted: bool | None = None,
        up: ArrayLike = (0.0, 0.0, 1.0),
    ) -> None:
        thresholds = thresholds_of(walkers)
        subject = load_subject(
            STICK_FIGURE if urdf is None else urdf,
            srdf=srdf,
            package_dirs=package_dirs,
            untrusted=untrusted,
            visuals=bodies == "visual",
        )
        self.robot = subject if isinstance(subject, Robot) else None
        self._figure = subject if isinstance(subject, Figure) else None
        if isinstance(subject, Robot):
            settings = RobotSettings(
                checks=tuple(
                    ROBOT_DEFAULT if checks is None else (check_settings(one).name for one in checks)
                ),
                ranges=ranges,
                joint_map=joint_map,
                lengths=lengths or "median",
                bodies=bodies,
                rigid_tolerance=rigid_tolerance,
                angle_tolerance=angle_tolerance,
                contact_margin=contact_margin,
                up=up,
            )
            self.checks, self.lengths = settings.checks, settings.lengths
            self._robot = RobotValidator(robot=subject, settings=settings)
            _ = self._robot.models.limits
            return
        self.lengths = lengths or "model"
        for option, given, known in (
            ("--lengths", self.lengths, LENGTHS[:2]),
            ("--bodies", bodies, ("auto", "urdf")),
            ("--joint-map", joint_map, (None,)),
        ):
            if given not in known:
                raise InputError(
                    f"{option} {given}: the stick figure has its own; expected a robot, as --urdf human"
                )
        self._chosen = chosen_checks(PHYSICAL if checks is None else checks)
        self.checks = tuple(one.name for one in self._chosen)
        if not self.checks:
            raise InputError("--checks: none is given, so nothing would be judged; expected one or more")
        self._options: dict[str, Any] = {
            "ranges": load_ranges(ranges),
            "rigid_tolerance": rigid_tolerance,
            "angle_tolerance": angle_tolerance,
            "rules": rules,
            "thresholds": thresholds,
            "contact_margin": contact_margin,
            "up": tuple(np.asarray(up, dtype=np.float64).tolist()),
        }
        self._suite = self._make_suite(subject)

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
    ) -> Report:
        """Judge postures, given by their joints or as configurations.

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
            Configurations in Pinocchio's order, instead of postures; they are taken as they are.
        sequence : int array (N,), optional
            Which sequence in time each posture belongs to: a robot's fit then starts from the one before.
        lengths : mapping, optional
            Segment lengths in place of the postures' medians, metres: those of a whole file that is judged in parts.
        behind : bool, optional
            Likewise, whether the shoulders lie behind the line from neck to pelvis.

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
        joints = _points("postures", postures, len(JOINTS))
        points = with_head(joints)
        if head is not None:
            points[:, len(JOINTS) :] = _points("head", head, len(HEAD_POINTS), len(joints))
        if self._figure is None:
            which = None if sequence is None else _sequence(sequence, len(joints))
            return _report(self._robot.judge_postures(points, sequence=which, lengths=lengths, behind=behind))
        figure, suite = self._figure, self._suite
        if self.lengths == "median" and len(joints):
            figure = figure.scaled(lengths or segment_lengths(joints))
            suite = self._make_suite(figure)
        configurations, distance = figure.configurations(points)
        return Report(
            judgements=judge(suite, points),
            complete=np.asarray(np.isfinite(joints).all(axis=(1, 2))),
            q=configurations,
            fk_distance=distance,
        )

    def describe(self) -> dict[str, Any]:
        """List what decides the verdicts besides the options, as reports have it."""
        if self._figure is None:
            return self._robot.models.describe()
        return {"figure": self._figure.hash, "checks": list(self.checks)}

    @property
    def configuration_names(self) -> tuple[str, ...]:
        """A name for each entry of q, in the order in which `check` takes it."""
        return self.robot.configuration_names if self.robot is not None else self.figure.configuration_names

    def _check_configurations(self, q: ArrayLike) -> Report:
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

    @cached_property
    def _configurations(self) -> FigureConfigurations:
        options = self._options
        return FigureConfigurations(
            figure=self.figure,
            checks=self.checks,
            ranges=options["ranges"],
            suite=self._suite,
            angle_tolerance=options["angle_tolerance"],
            contact_margin=options["contact_margin"],
        )

    def _make_suite(self, figure: Figure) -> list[Check]:
        return make_checks(
            figure,
            self._chosen,
            rigid_mode="distances",
            limbs=True,
            exact=True,
            directions=True,
            **self._options,
        )


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
        if "collision" in verdict.models[0].settings.checks
        else (),
    )


def _largest(residual: Array) -> Array:
    """Return the largest known distance (N,); NaN where none is known."""
    return np.asarray(np.fmax.reduce(residual, axis=1))


def _sequence(given: ArrayLike, count: int) -> NDArray[np.intp]:
    which = np.asarray(given)
    if which.shape != (count,) or which.dtype.kind not in "iu":
        raise InputError(f"sequence: {which.dtype} of shape {which.shape}; expected whole numbers ({count},)")
    return which.astype(np.intp)


def _points(name: str, given: ArrayLike | None, count: int, postures: int | None = None) -> Array:
    """Make an array (N, count, 3) of what was given, or refuse it."""
    expected = f"({'N' if postures is None else postures}, {count}, 3)"
    try:
        points = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: not an array of numbers; expected {expected}, metres") from error
    if points.ndim != 3 or points.shape[1:] != (count, 3) or postures not in (None, len(points)):
        raise InputError(f"{name}: the shape is {points.shape}; expected {expected}, metres")
    far = np.abs(points) > FARTHEST
    if far.any():
        raise InputError(
            f"{name}: a coordinate is {points[far][0]:g} m; expected finite ones within {FARTHEST:g} m, "
            "NaN where unknown"
        )
    return points
