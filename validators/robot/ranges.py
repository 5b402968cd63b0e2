"""Limits by a robot's own joint names, read from TOML."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.safe_io import cut, nearest, one_line, read_toml, refusal, shown
from posekit.validators.ranges import MAX_BYTES, SCHEMA

KIND = "joints"
UNLIMITED = 1e100
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
    lower[lower < -UNLIMITED], upper[upper > UNLIMITED] = -np.inf, np.inf
    if name == "urdf":
        return lower, upper
    for joint, (low, high) in _read(name, model).items():
        index = model.getJointId(joint)
        k = model.idx_qs[index]
        scale = 1.0 if model.joints[index].shortname().startswith("JointModelP") else math.pi / 180
        lower[k], upper[k] = low * scale, high * scale
    return lower, upper


def _read(name: str, model: pin.Model) -> dict[str, tuple[float, float]]:
    try:
        exists = Path(name).exists()
    except (OSError, ValueError):
        exists = False
    if not name or not exists:
        extra = " (table1 is for the stick figure)" if name == "table1" else ""
        raise InputError(
            one_line(
                f"--ranges {cut(name)}: no such table or file{extra}; expected urdf or the path of a TOML file"
            )
        )
    table = read_toml(name, limit=MAX_BYTES)
    if table.get("schema") != SCHEMA:
        raise refusal(name, "schema", shown(table.get("schema")), f'"{SCHEMA}"', "name it in the first line")
    if table.get("kind") != KIND:
        remedy = f'write kind = "{KIND}" and a table [limits] of the robot\'s own joints'
        raise refusal(name, "kind", shown(table.get("kind")), f'"{KIND}"', remedy)
    unknown = sorted(set(table) - {"schema", "kind", "limits"})
    if unknown:
        raise refusal(name, unknown[0], "an unknown entry", "schema, kind, [limits]", "remove it")
    limits = table.get("limits", {})
    if not isinstance(limits, dict) or not limits:
        raise refusal(name, "limits", shown(limits), "a table of joints", "write [limits] above them")
    known = [str(model.names[k]) for k in range(1, model.njoints) if model.nqs[k] == 1]
    return {joint: _range(name, joint, bounds, known) for joint, bounds in limits.items()}


def _range(source: str, joint: str, bounds: object, known: Sequence[str]) -> tuple[float, float]:
    field = f"limits.{joint}"
    if joint not in known:
        raise refusal(
            source, field, "a joint that the robot has not", "one with limits", nearest(joint, known)[:200]
        )
    numbers = [
        float(bound)
        for bound in (bounds if isinstance(bounds, list) else [])
        if isinstance(bound, int | float) and not isinstance(bound, bool)
    ]
    if not isinstance(bounds, list) or len(bounds) != 2 or len(numbers) != 2:
        raise refusal(source, field, shown(bounds), "[lower, upper], degrees or metres", "give two numbers")
    lower, upper = numbers
    if lower > upper:
        raise refusal(source, field, f"[{lower:g}, {upper:g}]", "the lower one first", "swap them")
    return lower, upper
