"""The validator of whole postures: every check at once, no tree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.cameras import Array
from posekit.errors import FigureError, InputError
from posekit.figure import Figure, load_figure, with_head
from posekit.skeleton import HEAD_POINTS, JOINTS
from posekit.validators.joint_range import TOLERANCE
from posekit.validators.ranges import load_ranges
from posekit.validators.suite import PHYSICAL, Judgement, check_names, judge, make_checks
from posekit.validators.walking import DEFAULT_RULES

BUILT_IN = ("human", "stick_figure")
RIGID_TOLERANCE = 0.03
"""Metres: measured torsos give by some centimetres (docs, "Tolerances")."""

FARTHEST = 1e9
"""Metres: no body is there, and well beyond it squares overflow, to findings that are undecided."""


@dataclass(frozen=True, kw_only=True)
class Report:
    """Verdicts on N postures, with the findings behind them.

    Parameters
    ----------
    judgements : list of Judgement
        By validator.
    complete : bool array (N,)
        Whether all 14 joints are known.
    q : array (N, nq)
        The configuration of each posture.
    fk_distance : array (N,)
        Distance between the posture and its configuration, metres: the largest over the joints.
    """

    judgements: list[Judgement]
    complete: NDArray[np.bool_]
    q: Array
    fk_distance: Array

    @property
    def invalid(self) -> NDArray[np.bool_]:
        """Postures that some check rejects (N,)."""
        invalid = np.zeros(len(self.complete), dtype=bool)
        for judgement in self.judgements:
            invalid |= judgement.violated.any(axis=1)
        return invalid

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Postures with all joints that no check rejects, and on which every check decided something (N,)."""
        return self._decided & ~self.invalid

    @property
    def undecided(self) -> NDArray[np.bool_]:
        """Postures that nothing rejects, but with unknown joints, or that some check could not judge at all (N,)."""
        return ~self._decided & ~self.invalid

    @property
    def _decided(self) -> NDArray[np.bool_]:
        decided = self.complete.copy()
        for judgement in self.judgements:
            decided &= ~np.isnan(judgement.worst)
        return decided

    @property
    def verdicts(self) -> list[str]:
        """``valid``, ``invalid`` or ``undecided``, a posture each."""
        return [
            "invalid" if bad else "valid" if good else "undecided"
            for bad, good in zip(self.invalid, self.valid, strict=True)
        ]


class Validator:
    """Judges postures against a human figure.

    Parameters
    ----------
    urdf : str or Figure
        ``"human"`` (or ``"stick_figure"``), the built-in figure; the path of a figure's URDF; or a figure.
    checks : sequence of str
        Some of ``rigid-parts``, ``joint-range``, ``collision``, ``walking``.
    ranges : str
        ``urdf``, ``table1`` or the path of a TOML table.
    rules : sequence of int
        Rules of walking.
    rigid_tolerance : float
        Metres by which distances inside torso and hips, and the lengths of the limbs, may be off.
    angle_tolerance : float
        Degrees by which the direction of a segment may be off.
    contact_margin : float
        Metres that bodies must keep from each other; negative allows penetration.

    Examples
    --------
    >>> import numpy as np, posekit
    >>> standing = posekit.load_figure().neutral_points[:14]
    >>> posekit.Validator("human").check(standing[None]).verdicts
    ['valid']
    """

    def __init__(
        self,
        urdf: str | Figure = "human",
        *,
        checks: Sequence[str] = PHYSICAL,
        ranges: str = "urdf",
        rules: Sequence[int] = DEFAULT_RULES,
        rigid_tolerance: float = RIGID_TOLERANCE,
        angle_tolerance: float = TOLERANCE,
        contact_margin: float = 0.0,
    ) -> None:
        if isinstance(urdf, Figure):
            self.figure = urdf
        else:
            if urdf not in BUILT_IN and not Path(urdf).is_file():
                raise FigureError(
                    f"--urdf {urdf}: no such file; expected a figure's URDF, or {BUILT_IN[0]} (built in)"
                )
            self.figure = load_figure(None if urdf in BUILT_IN else urdf)
        self.checks = check_names(checks)
        if not self.checks:
            raise InputError("--checks: none is given, so nothing would be judged; expected one or more")
        self._suite = make_checks(
            self.figure,
            self.checks,
            ranges=load_ranges(ranges),
            rigid_tolerance=rigid_tolerance,
            rigid_mode="distances",
            angle_tolerance=angle_tolerance,
            limbs=True,
            rules=rules,
            contact_margin=contact_margin,
            exact=True,
        )

    def check(self, postures: ArrayLike, head: ArrayLike | None = None) -> Report:
        """Judge postures.

        Rigid parts, collision, walking and projected ranges judge the posture as it is given; the URDF's
        ranges judge the configuration made from it, and `Report.fk_distance` says how far the two are apart.

        Parameters
        ----------
        postures : array (N, 14, 3)
            Joints in tree order, metres, any right-handed frame; NaN where unknown.
        head : array (N, 5, 3), optional
            Nose, eyes and ears; without them the neck is undecided and no arm collides with the head.

        Returns
        -------
        Report

        Raises
        ------
        InputError
            Where a shape is wrong or a coordinate is no number, infinite or absurd.
        """
        joints = _points("postures", postures, len(JOINTS))
        points = with_head(joints)
        if head is not None:
            points[:, len(JOINTS) :] = _points("head", head, len(HEAD_POINTS), len(joints))
        q, distance = self.figure.configurations(points)
        return Report(
            judgements=judge(self._suite, points),
            complete=np.asarray(np.isfinite(joints).all(axis=(1, 2))),
            q=q,
            fk_distance=distance,
        )


def _points(name: str, given: ArrayLike, count: int, postures: int | None = None) -> Array:
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
