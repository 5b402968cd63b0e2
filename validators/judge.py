"""`validate_motion`, `Validator` and `assert_valid`: apply the chosen checks to a body and return a report."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import fields, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike

from posekit.body import Figure, load_figure, with_head
from posekit.errors import InputError, PosekitError, names_checked, refusal, shown
from posekit.geometry import Array, numbers
from posekit.motion.motion import Motion
from posekit.settings import Settings, Tolerance, ValidateSettings
from posekit.skeleton import JOINTS, POINTS
from posekit.tree.steps import Step
from posekit.validators.body import Body
from posekit.validators.check import Check, Judgement, NotAskedError, find_check, judged, message_of
from posekit.validators.collision import Collision
from posekit.validators.joint_range import JointRange
from posekit.validators.motion.profile import MOTION_CHECKS, load_profile
from posekit.validators.motion.remarks import hints, rate_doubts
from posekit.validators.motion.standing import balance
from posekit.validators.report import NUMBERS, Report, joined
from posekit.validators.rigid_parts import RigidParts
from posekit.validators.robot import CONFIGURATION_CHECKS, order_doubts, sole_points
from posekit.validators.walking import WalkingRules

if TYPE_CHECKING:
    from posekit.robots import Robot

#: Checks of positions by name.
POSTURE_CHECKS: Final[dict[str, Check]] = {
    one.name: one for one in (RigidParts(), JointRange(), Collision(), WalkingRules(), balance)
}

#: Checks of a robot's configurations by name.
ROBOT_CHECKS: Final[dict[str, Check]] = {one.name: one for one in (*CONFIGURATION_CHECKS, balance)}

USUAL_POSTURE_CHECKS: Final = ("rigid-parts", "joint-range", "collision")
USUAL_ROBOT_CHECKS: Final = ("reach", "joint-range", "joint-travel", "mimic", "collision")

#: Default checks that apply to some robots only. Reports list them as "not asked" only if the user named them.
OF_SOME_ROBOTS: Final = ("reach", "joint-travel", "mimic", "joint-velocity", "swap")

#: All checks that come with posekit.
KNOWN: Final[dict[str, Check]] = {**POSTURE_CHECKS, **ROBOT_CHECKS, **MOTION_CHECKS}


class InvalidError(PosekitError, AssertionError):
    """`assert_valid` found invalid postures; the message lists the first findings."""


def chosen_checks(settings: Settings, *, of_robot: bool, in_time: bool) -> list[Check]:
    """Return the checks that settings select, in the order in which reports list them.

    Parameters
    ----------
    settings : Settings
        Settings whose field ``checks`` lists checks or their names. If the field is None, the default checks are
        selected and, for motion, the checks of the profile.
    of_robot : bool
        Whether the checks judge configurations of a robot.
    in_time : bool
        Whether the frames are successive in time.

    Raises
    ------
    InputError
        If a name belongs to no check, or ``checks`` is empty.
    """
    own = ROBOT_CHECKS if of_robot else POSTURE_CHECKS
    profile = load_profile(settings.profile) if isinstance(settings, ValidateSettings) else ()
    names = USUAL_ROBOT_CHECKS if of_robot else USUAL_POSTURE_CHECKS
    usual = [*(own[name] for name in names), *(profile if in_time else ())]
    if settings.checks is None:
        return usual
    if not settings.checks:
        raise refusal("checks", "", "none", "one or more", f"choose among {', '.join(KNOWN)}")
    over_time = {**MOTION_CHECKS, **{one.name: one for one in profile}}
    asked = [one for given in settings.checks for one in (usual if given == "usual" else [given])]
    found = {one.name: one for one in (find_check(one, {**KNOWN, **over_time, **own}) for one in asked)}
    # Users' checks come after checks of postures and before checks of motion.
    rank = {name: place for place, name in enumerate((*own, "", *over_time))}
    return sorted(found.values(), key=lambda one: rank.get(one.name, rank[""]))


def early_checks(settings: Settings) -> list[Check]:
    """Return the checks of postures for the binary tree search of `posekit.recover`.

    A check with a member `parts` is replaced by these smaller checks. Each part reads few points, so that the search
    applies it early.
    """
    asked = chosen_checks(settings, of_robot=False, in_time=False)
    postures = [check for check in asked if not getattr(check, "over_time", False)]
    return [part for check in postures for part in getattr(check, "parts", (check,))]


class PostureJudge:
    """Applies checks to postures (N, 14, 3) or (N, 19, 3) of a figure for the binary tree search.

    Parameters
    ----------
    figure : Figure
        Figure of the postures.
    settings : Settings
        Ranges, walking rules and contact margin.
    tolerance : Tolerance or None
        Allowed differences from the figure; None if the postures were measured on people.
    up : array (3,), optional
        Unit vector against gravity in the frame of the postures.
    """

    def __init__(
        self, figure: Figure, settings: Settings, tolerance: Tolerance | None, up: Array | None = None
    ) -> None:
        self.figure, self.settings = figure, _validate_settings(settings)
        self.tolerance, self.up = tolerance, up

    def __call__(self, check: Check, points: Array) -> Judgement:
        """Return the judgement of a check, without columns if the check does not apply."""
        found = judge_postures(
            points, [check], self.figure, self.settings, tolerance=self.tolerance, up=self.up
        )
        return found.get(check.name) or Judgement((), np.empty((len(points), 0)))

    def steps(self, check: Any) -> list[Step] | None:
        """Return a check in the form for the C++ tree search; None if it has no such form."""
        if not hasattr(check, "steps"):
            return None
        return _steps(check, self.figure, self._unnamed, self.tolerance)

    @cached_property
    def _unnamed(self) -> ValidateSettings:
        """Settings without ``checks``, for the cache of `_steps`, because users' checks may not be hashable."""
        return replace(self.settings, checks=None)


@lru_cache(maxsize=128)
def _steps(
    check: Any, figure: Figure, settings: ValidateSettings, tolerance: Tolerance | None
) -> list[Step] | None:
    """Return a check of postures in the form for the C++ tree search."""
    none = np.empty((0, len(JOINTS), 3))
    body = Body(joints=none, base=figure, settings=settings, tolerance=tolerance, motion=False)
    found: list[Step] | None = check.steps(body)
    return found


def judge_postures(
    points: Array,
    checks: Iterable[Check],
    figure: Figure,
    settings: Settings | None = None,
    *,
    tolerance: Tolerance | None = None,
    up: Array | None = None,
) -> dict[str, Judgement]:
    """Apply checks to postures (N, 14, 3) or (N, 19, 3) of a figure.

    Returns
    -------
    dict
        The judgement of each check that applies, by the check's name.
    """
    body = Body(
        joints=points[:, : len(JOINTS)],
        head=points[:, len(JOINTS) :],
        base=figure,
        up=up,
        settings=_validate_settings(settings or ValidateSettings()),
        tolerance=tolerance,
        motion=False,
    )
    return {name: judgement for name, (_, judgement) in _asked(checks, body)[0].items()}


def _asked(checks: Iterable[Check], body: Body) -> tuple[dict[str, tuple[Check, Judgement]], dict[str, str]]:
    """Return by name the applicable checks with their judgements, and the reasons why other checks do not apply."""
    found, not_asked = {}, {}
    for check in checks:
        try:
            found[check.name] = check, judged(check, body)
        except NotAskedError as reason:
            not_asked[check.name] = str(reason)
    return found, not_asked


def _validate_settings(settings: Settings) -> ValidateSettings:
    if isinstance(settings, ValidateSettings):
        return settings
    return ValidateSettings(**{one.name: getattr(settings, one.name) for one in fields(Settings)})


def validate_motion(
    motion: Motion,
    settings: ValidateSettings | None = None,
    *,
    robot: Robot | None = None,
    figure: Figure | None = None,
    tolerance: Tolerance | None = None,
) -> Report:
    """Judge the frames of a motion.

    Parameters
    ----------
    motion : Motion
        Joint positions, or configurations of a robot.
    settings : ValidateSettings, optional
        Checks, ranges and tolerances.
    robot : Robot, optional
        The robot of the configurations in `motion`. If `motion` has positions only, inverse kinematics fits the robot
        to them.
    figure : Figure, optional
        The figure that positions are compared with. It is scaled to measured people.
    tolerance : Tolerance, optional
        Allowed differences from `figure` for postures of this figure. By default positions are of measured people.

    Returns
    -------
    Report

    Raises
    ------
    InputError
        If there is no such check, or the configurations do not belong to the robot.
    """
    asked = settings or ValidateSettings()
    if not len(motion):
        raise refusal(motion.source or "motion", "", "no frame", "at least one", "give frames")
    checks = chosen_checks(asked, of_robot=robot is not None, in_time=motion.in_time)
    if robot is not None and motion.q is not None and motion.q.shape[1] != robot.model.nq:
        got = f"{motion.q.shape[1]} entries per row"
        raise refusal(
            motion.source or "motion", "q", got, f"{robot.model.nq} of {robot.name}", "name the robot"
        )
    # Forward kinematics of all points costs as much as all checks except collision.
    placed = motion.in_time or any("joints" in check.reads for check in checks)
    reports = []
    for name, recording in motion.recordings():
        part, used, residual = recording, robot, None
        if robot is not None and part.q is None:
            used, part, residual = _fitted(robot, part, asked)
        body = Body.of(
            part, asked, base=figure, robot=used, tolerance=tolerance, residual=residual, placed=placed
        )
        legs = placed and body.motion and not np.isfinite(body.feet).any()
        if legs and used is not None and body.q is not None:
            body = replace(body, feet=sole_points(used, body.q))
        reports.append(_report(body, checks, part, name))
    return reports[0] if len(reports) == 1 else joined(reports)


def _fitted(robot: Robot, motion: Motion, settings: ValidateSettings) -> tuple[Robot, Motion, Array]:
    """Fit a robot to joint positions by inverse kinematics.

    Returns the robot, scaled to the person unless settings are strict; the motion with configurations; and the
    distances (T, 14) between the robot's joints and the given joints, metres.
    """
    joints = motion.figure_joints
    used = robot if settings.strict else robot.scaled(joints)
    known = np.isfinite(joints).any(axis=(1, 2))
    q = np.full((len(joints), robot.model.nq), np.nan)
    residual = np.full(joints.shape[:2], np.nan)
    if known.any():
        q[known], _ = used.configurations(joints[known])
        residual[known] = np.linalg.norm(used.points(q[known]) - joints[known], axis=-1)
    note = f"{robot.name} is fitted to these positions; judge people without --urdf"
    fitted = replace(motion, q=q, q_names=used.configuration_names, robot=robot.name)
    return used, replace(fitted, notes=(*motion.notes, note)), residual


def _report(body: Body, checks: Sequence[Check], motion: Motion, name: str) -> Report:
    """Apply checks to one recording and return the report."""
    by_name, not_asked = _asked(checks, body)
    found = list(by_name.values())
    quiet = OF_SOME_ROBOTS if "usual" in (body.settings.checks or ("usual",)) else ()
    count = len(body)
    places = tuple(dict.fromkeys(place for _, one in found for place in one.places))
    place_at = {place: k for k, place in enumerate(places)}
    shares = [np.fmin.reduce(one.share, axis=1, initial=np.nan) for _, one in found]
    margins = np.array(shares, dtype=np.float64).reshape(len(found), count).T
    of_postures = [not getattr(check, "over_time", False) for check, _ in found]
    silent = np.isnan(margins) & np.array(of_postures, dtype=np.bool_)
    margins = np.where(np.isinf(margins), np.nan, margins)
    parts = [np.empty((len(WHOLE) + len(NUMBERS), 0))]
    for k, (_, one) in enumerate(found):
        row, place = np.nonzero(one.violated)
        at = np.array([place_at[name] for name in one.places], dtype=np.intp)[place]
        low, high = (np.where(np.isinf(ends), np.nan, ends)[row, place] for ends in (one.low, one.high))
        numbers = (one.value[row, place], low, high, one.margin[row, place])
        parts.append(np.stack([row, np.full(len(row), k), at, *numbers]))
    cells = np.concatenate(parts, axis=1)
    cells = cells[:, np.lexsort((cells[1], cells[0]))]
    findings = {
        name: column.astype(np.intp if name in WHOLE else np.float64)
        for name, column in zip((*WHOLE, *NUMBERS), cells, strict=True)
    }
    known = body.joints if body.q is None else body.q
    batch = not motion.in_time and np.isnan(np.asarray(motion.time)).all()  # its frames are its rows
    return Report(
        clip=np.zeros(count, dtype=np.intp),
        frame=np.arange(count) if batch else np.asarray(motion.frame),
        time=np.asarray(motion.time),
        files=(motion.source,),
        names=(name,),
        checks=tuple(by_name),
        units=tuple(check.unit for check, _ in found),
        places=places,
        findings=findings,
        margins=margins,
        silent=silent,
        incomplete=np.asarray(~np.isfinite(known.reshape(count, -1)).all(axis=1)),
        messages={check.name: message_of(check) for check, _ in found},
        not_asked={one: reason for one, reason in not_asked.items() if one not in quiet},
        settings={**body.settings.to_json(), **body.allowed()},
        notes=(
            *motion.notes,
            *hints(body, {check: one for check, (_, one) in by_name.items()}, np.asarray(motion.frame)),
        ),
        warnings=(*motion.warnings, *rate_doubts(body), *order_doubts(body)),
    )


#: Columns of a report's findings with integer values.
WHOLE: Final = ("row", "check", "place")


class Validator:
    """Judges postures and motion of a figure or of a robot.

    Parameters
    ----------
    urdf : str, path, Figure or Robot
        A figure: ``figure`` (the default), the path of a figure's URDF, or a `Figure`. Its joint positions are judged
        by closed-form inverse kinematics. Or a robot: a name of example-robot-data (``human``, ``g1``, …), the path of
        a URDF, or a `posekit.robots.Robot`.
    settings : ValidateSettings, optional
        Checks, ranges and tolerances.
    checks, ranges, profile, ground, strict : optional
        Fields of `ValidateSettings`; they override `settings`.

    Examples
    --------
    >>> import posekit
    >>> figure = posekit.load_figure()
    >>> posekit.Validator().check(figure.neutral_points[:14]).ok
    array([ True])
    >>> posekit.Validator("figure").check(figure.neutral).ok
    array([ True])
    """

    @names_checked
    def __init__(
        self,
        urdf: Any = "figure",
        settings: ValidateSettings | None = None,
        *,
        checks: Any = None,
        ranges: str | None = None,
        profile: str | None = None,
        ground: str | float | None = None,
        strict: bool | None = None,
    ) -> None:
        self.settings = ValidateSettings.of(
            settings, checks=checks, ranges=ranges, profile=profile, ground=ground, strict=strict
        )
        self.robot = _loaded(urdf, self.settings)
        chosen_checks(self.settings, of_robot=self.figure is None, in_time=True)

    def __repr__(self) -> str:
        return f"Validator({self.robot!r})"

    @property
    def figure(self) -> Figure | None:
        """The figure of the validator; None if the validator has another robot."""
        return self.robot if isinstance(self.robot, Figure) else None

    @property
    def model(self) -> Any:
        """Pinocchio's model of the figure or robot."""
        return self.robot.model

    @property
    def configuration_names(self) -> tuple[str, ...]:
        """Name of each entry of q."""
        return self.robot.configuration_names

    def check(
        self, given: Motion | ArrayLike, *, head: ArrayLike | None = None, tolerance: Tolerance | None = None
    ) -> Report:
        """Judge postures.

        Parameters
        ----------
        given : array or Motion
            Joint positions (14, 3) or (N, 14, 3), or with head points (N, 19, 3), metres, NaN where unknown. Or
            configurations (nq,) or (N, nq). Configurations (N, nq - 7) omit the free root, which then has its neutral
            pose. All postures are of one person. The order of the root's quaternion is x, y, z, w. The report warns if
            a batch of robots is upright only in the order w, x, y, z.
        head : array (N, 5, 3), optional
            Positions of nose, eyes and ears, metres.
        tolerance : Tolerance, optional
            Allowed differences from the figure for postures of this figure. By default positions are of measured
            people.

        Returns
        -------
        Report

        Raises
        ------
        InputError
            If a shape is wrong, a number is infinite, or a coordinate is over 1000 km.
        """
        motion = given if isinstance(given, Motion) else self.motion(given, head)
        figure = self.figure
        robot = None if figure is not None else self.robot
        if figure is not None and motion.joints is None and motion.q is not None:
            if self.settings.ranges in ("auto", "urdf"):
                robot = figure
            else:
                motion = replace(motion, joints=figure.points(motion.q), joint_names=JOINTS)
        return validate_motion(motion, self.settings, robot=robot, figure=figure, tolerance=tolerance)

    def motion(self, given: ArrayLike, head: ArrayLike | None = None) -> Motion:
        """Return an array of postures as a motion whose frames are not successive in time.

        Raises
        ------
        InputError
            If a shape is wrong, a number is infinite, or a coordinate is over 1000 km.
        """
        count = len(self.configuration_names)
        expected = f"joints (N, {len(JOINTS)}, 3), or configurations (N, {count})"
        remedy = "give one posture per row; files, and points of another layout, to posekit.validate"
        values = numbers(given, "postures", "", expected, remedy)
        if values.ndim == 1 or values.shape in ((len(JOINTS), 3), (len(POINTS), 3)):
            values = values[None]
        still: dict[str, Any] = {"frame": np.zeros(len(values), dtype=np.intp)} if len(values) > 1 else {}
        if values.shape[1:] in ((len(JOINTS), 3), (len(POINTS), 3)):
            if np.nanmax(np.abs(values), initial=0.0) > MOST_METRES:
                raise refusal("postures", "", "a coordinate over 1000 km", "metres", "scale them")
            points = with_head(values, None if head is None else np.asarray(head, dtype=np.float64))
            return Motion(joints=points, joint_names=POINTS, **still)
        body = self.robot
        if body.free_flyer and values.shape[1:] == (count - 7,):  # angles only: the root is at neutral
            root = np.broadcast_to(body.neutral[:7], (len(values), 7))
            values = np.concatenate([root, values], axis=1)
        if values.shape[1:] == (count,):
            values = values.copy()
            known = np.isfinite(values).all(axis=1)
            values[known] = body.checked(values[known])
            name = "figure" if self.figure is not None else body.name
            return Motion(q=values, q_names=self.configuration_names, robot=name, **still)
        raise refusal("postures", "", f"shape {values.shape}", expected, remedy)


#: Largest plausible coordinate, metres; even coordinates in a wrong unit of length are smaller.
MOST_METRES: Final = 1e6


def _loaded(urdf: Any, settings: ValidateSettings) -> Robot:
    """Load the figure or the robot that a name or a URDF stands for."""
    from posekit.robots import Robot, load_robot

    if isinstance(urdf, Robot):
        return urdf
    if not isinstance(urdf, str | Path):
        raise refusal("", "urdf", shown(type(urdf).__name__), "a name, a path or a Robot", "name a URDF")
    name = str(urdf)
    if name in ("figure", "stick_figure"):
        return load_figure()

    if Path(name).is_file():
        try:
            return load_figure(name)
        except InputError:  # not a figure: load it as a robot, whose error message is clearer
            pass

    load = partial(load_robot, name, srdf=settings.srdf, package_dirs=settings.package_dirs)
    joint_map = settings.joint_map or ""
    bodies = "meshes" if settings.bodies == "auto" else settings.bodies
    found = load(bodies=bodies, joint_map=joint_map)
    if settings.bodies == "auto" and not found.collision_pairs:
        return load(bodies="capsules", joint_map=joint_map)
    return found


@names_checked
def assert_valid(
    given: Any,
    urdf: Any = "",
    settings: ValidateSettings | None = None,
    *,
    checks: Any = None,
    ranges: str | None = None,
) -> None:
    """Raise an error unless every posture is valid.

    Parameters
    ----------
    given : array, Motion or path
    urdf, settings, checks, ranges
        As in `posekit.validate`.

    Raises
    ------
    InvalidError
        If a posture is invalid or undecided. The error is an `AssertionError`; its message lists the first findings.

    Warns
    -----
    UserWarning
        The report's warnings, such as a doubt about the order of quaternions.

    Examples
    --------
    >>> import posekit
    >>> posekit.assert_valid(posekit.load_figure().neutral_points[:14])
    """
    import posekit

    report = posekit.validate(given, settings, urdf=urdf, checks=checks, ranges=ranges)
    for line in report.warnings:
        warnings.warn(line, UserWarning, stacklevel=3)
    bad = int((~report.ok).sum())
    if bad or report.refused:
        reasons = "; ".join(str(span) for span in report.spans[:3]) or "joints are missing"
        raise InvalidError(f"{bad} of {len(report)} postures are not valid: {reasons}")
