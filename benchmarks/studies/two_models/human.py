"""The published human as a second judge: the stick figure's ranges on its joints, signs and offsets measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pinocchio as pin

from benchmarks.studies.two_models.angles import JUDGED_DOFS, Limits, column
from posekit.body import Figure
from posekit.skeleton import JOINTS
from posekit.validators import Report, Validator

HUMAN_NAME: Final = "human"
MAP_FILE: Final = "human_as_stick_figure.toml"

BEND_DEGREES: Final = 60.0
"""Degrees by which elbows and knees are bent while joints are compared, so that axial rotations show."""

TURN_DEGREES: Final = 20.0
"""Degrees by which one joint is turned."""

HELD_JOINTS: Final = (
    "middle_thoracic_Z",
    "middle_thoracic_X",
    "right_clavicle_joint_X",
    "left_clavicle_joint_X",
)
"""The human's joints between the mapped points that the stick figure, whose trunk is rigid, has not."""


class Counterpart(NamedTuple):
    """The human's joint that does what one of the stick figure's does: its angle is sign * theirs + offset, degrees."""

    joint: str
    sign: int
    offset: float


def mapped_ranges() -> Path:
    """Return the file of the stick figure's ranges on the human's joints."""
    return Path(str(resources.files("posekit.urdf") / "ranges" / MAP_FILE))


def without_collision(report: Report) -> Report:
    """Leave the collisions out of a report."""
    judgements = [each for each in report.judgements if each.check != "collision"]
    return replace(report, judgements=judgements, colliders=())


def measure_counterparts(figure: Figure, validator: Validator | None = None) -> dict[str, Counterpart]:
    """Find which joint of the human does what each of the stick figure's does, with sign and offset.

    The stick figure is put into its neutral configuration with elbows and knees bent, and into others that differ
    from it by one angle. The human is fitted to each, and its joint that turns most is the counterpart; the offset is
    what it reads where the stick figure's angle is zero.

    Parameters
    ----------
    figure : Figure
    validator : Validator, optional
        Of the human; one with its own limits unless told otherwise.

    Returns
    -------
    dict
        By the names in `posekit.skeleton.DOFS`, without the neck's.
    """
    base = pin.neutral(figure.model)
    for dof in JUDGED_DOFS:
        if "elbow" in dof or "knee" in dof:
            base[column(figure, dof)] = np.radians(BEND_DEGREES)
    q = np.tile(base, (len(JUDGED_DOFS) + 1, 1))
    for row, dof in enumerate(JUDGED_DOFS, start=1):
        q[row, column(figure, dof)] += np.radians(TURN_DEGREES)
    postures = figure.forward_kinematics(q)[:, : len(JOINTS)]
    validator = validator or Validator(HUMAN_NAME, checks=("reach",))
    columns = joint_columns(validator)
    names, at = list(columns), list(columns.values())
    read = np.degrees(validator.check(postures, lengths=figure.lengths).q[:, at])
    found = {}
    for row, dof in enumerate(JUDGED_DOFS, start=1):
        turned = read[row] - read[0]
        k = int(np.argmax(np.abs(turned)))
        sign = int(np.sign(turned[k]))
        offset = read[0, k] - sign * np.degrees(base[column(figure, dof)])
        found[dof] = Counterpart(names[k], sign, _rounded(offset))
    return found


def limits_on_human(
    limits: Limits, counterparts: Mapping[str, Counterpart]
) -> dict[str, tuple[float, float]]:
    """Turn limits of the stick figure's angles into limits of the human's joints, degrees."""
    turned = {}
    for dof, (joint, sign, offset) in counterparts.items():
        low, high = sorted(sign * limit + offset for limit in limits[dof])
        turned[joint] = (_rounded(low), _rounded(high))
    return turned


def limits_of_human(
    report: Report, counterparts: Mapping[str, Counterpart]
) -> dict[str, tuple[float, float]]:
    """Turn the limits that a report on the human was made with into limits of the stick figure's angles, degrees."""
    judged = next(each for each in report.judgements if each.check == "joint_range")
    turned = {}
    for dof, (joint, sign, offset) in counterparts.items():
        k = judged.where.index(joint)
        low, high = sorted(sign * (limit - offset) for limit in (judged.lower[0, k], judged.upper[0, k]))
        turned[dof] = (float(low), float(high))
    return turned


def joint_columns(validator: Validator) -> dict[str, int]:
    """Return where the joints with one variable stand in the human's q, by name."""
    model = validator.robot.model  # type: ignore[union-attr]
    joints = [joint for joint in range(1, model.njoints) if model.nqs[joint] == 1]
    return {str(model.names[joint]): int(model.idx_qs[joint]) for joint in joints}


def ranges_text(limits: Limits) -> str:
    """Write limits as `posekit.ranges/1` of a robot's joints."""
    lines = [f"{joint} = [{low}, {high}]" for joint, (low, high) in limits.items()]
    return "\n".join(['schema = "posekit.ranges/1"', 'kind = "joints"', "", "[limits]", *lines, ""])


def _rounded(angle: float) -> float:
    return round(float(angle), 3) + 0.0  # no minus zero
