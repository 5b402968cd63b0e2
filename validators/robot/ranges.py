"""Limits by a robot's own joint names, read from TOML."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pinocchio as pin

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.safe_io import cut, nearest, one_line, refusal

UNLIMITED_FROM = 1e100
"""Radians or metres from which on a limit of the model is none."""


def load_joint_limits(name: str, model: pin.Model) -> tuple[Array, Array]:
    """Return limits of q (nq,) each: the model's own (``urdf``), or those with a TOML file's put in their place.

    The file is `posekit.ranges/1` of kind ``joints``: one table ``[limits]`` of ``joint = [lower, upper]``, degrees
    for joints that turn, metres for those that slide. Joints that it does not name keep the model's limits.

    Raises
    ------
    InputError
        Where there is no such file, it is of another kind, or names a joint that the robot has not or that has no
        one variable.
    """
    lower, upper = model.lowerPositionLimit.copy(), model.upperPositionLimit.copy()
    lower[lower < -UNLIMITED_FROM], upper[upper > UNLIMITED_FROM] = -np.inf, np.inf
    if name == "urdf":
        return lower, upper
    for joint, (low, high) in _read(name, model).items():
        index = model.getJointId(joint)
        k = model.idx_qs[index]
        scale = 1.0 if model.joints[index].shortname().startswith("JointModelP") else math.pi / 180
        lower[k], upper[k] = low * scale, high * scale
    return lower, upper


def _read(name: str, model: pin.Model) -> dict[str, tuple[float, float]]:
    from posekit.tables.ranges import JointLimitsTable
    from posekit.tables.reading import read_table

    try:
        exists = Path(name).exists()
    except (OSError, ValueError):
        exists = False
    if not name or not exists:
        extra = f" ({name} is for the stick figure)" if name in ("table1", "table1-printed") else ""
        raise InputError(
            one_line(
                f"--ranges {cut(name)}: no such table or file{extra}; expected urdf or the path of a TOML file"
            )
        )
    table = read_table(name, JointLimitsTable)
    known = [str(model.names[k]) for k in range(1, model.njoints) if model.nqs[k] == 1]
    for joint in table.limits:
        if joint not in known:
            got = "a joint that the robot has not"
            remedy = nearest(joint, known)[:200]
            raise refusal(name, f"limits.{cut(joint)}", got, "one with limits", remedy)
    return {joint: (lower, upper) for joint, (lower, upper) in table.limits.items()}
