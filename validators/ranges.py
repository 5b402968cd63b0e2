"""Named tables of joint ranges, read from TOML."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Literal

from posekit.errors import InputError
from posekit.safe_io import cut, one_line, parse_toml, read_text
from posekit.skeleton import DOFS
from posekit.validators.anatomical import Anatomy
from posekit.validators.anatomical_table import parse_anatomy

SCHEMA = "posekit.ranges/1"
MAX_BYTES = 1_000_000

PROJECTED_ANGLES: Mapping[str, tuple[str, ...]] = {
    "shoulder": ("flexion", "abduction"),
    "elbow": ("flexion",),
    "hip": ("flexion", "flexion_with_straight_knee", "abduction"),
    "knee": ("flexion",),
    "pelvis": ("flexion", "rotation", "bending"),
    "neck": ("flexion", "rotation", "bending"),
}

Range = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Ranges:
    """Joint ranges in degrees.

    Parameters
    ----------
    name : str
        What results call them.
    kind : {"configuration", "projected"}
        Ranges of the URDF's own angles, or of the projected angles of Lee & Chen 1985, §3.2.A.
    limits : mapping
        ``"shoulder.flexion"`` (projected; both sides) or ``"right_shoulder.flexion"`` (configuration; angles
        that are not listed keep the URDF's limits) to (lower, upper), degrees.
    shortest_projection : float
        Fraction of a segment below which its projection has no direction to measure.
    knee_flexed : float
        Degrees of knee flexion above which the hip's wider range applies.
    anatomy : Anatomy, optional
        Ranges with a mean and a spread for each end, and couplings (of kind configuration): `limits` are its own.
    """

    name: str
    kind: Literal["configuration", "projected"]
    limits: Mapping[str, Range] = field(default_factory=dict)
    shortest_projection: float = 0.1
    knee_flexed: float = 5.0
    anatomy: Anatomy | None = None


URDF_RANGES = Ranges(name="urdf", kind="configuration")

NAMED = ("table1", "anatomical")
"""Tables that come with the package."""


def load_ranges(name: str) -> Ranges:
    """Load ranges by name (`urdf`, `table1`, `anatomical`) or from a TOML file.

    Raises
    ------
    InputError
        Where there is no such table or it is not what `posekit.ranges/1` says.
    """
    if name == "urdf":
        return URDF_RANGES
    if name in NAMED:
        text = (resources.files("posekit.urdf") / "ranges" / f"{name}.toml").read_text(encoding="utf-8")
        return _parse(text, name)
    try:
        exists = Path(name).exists()
    except (OSError, ValueError):
        exists = False
    if not name or not exists:
        raise InputError(
            one_line(
                f"--ranges {cut(name)}: no such table or file; expected urdf, {', '.join(NAMED)} or the path "
                "of a TOML file"
            )
        )
    return _parse(read_text(name, limit=MAX_BYTES), name)


def _parse(text: str, source: str) -> Ranges:
    table = parse_toml(text, source, finite=False)  # each number is named below, in the words of its range
    schema = table.pop("schema", None)
    if schema != SCHEMA:
        raise InputError(f"{source}: schema is {schema!r}; expected {SCHEMA!r} in the first line")
    kind = table.pop("kind", None)
    if kind == "anatomical":
        anatomy = parse_anatomy(table, source)
        return Ranges(name=source, kind="configuration", limits=anatomy.limits(), anatomy=anatomy)
    if kind not in ("configuration", "projected"):
        raise InputError(
            f"{source}: kind is {kind!r}; expected 'configuration' or 'projected', or 'anatomical'"
        )
    shortest = _number(table.pop("shortest_projection", 0.1), f"{source}: shortest_projection")
    flexed = _number(table.pop("knee_flexed", 5.0), f"{source}: knee_flexed")
    if not 0 <= shortest < 1:
        raise InputError(
            f"{source}: shortest_projection is {shortest:g}; expected a fraction from 0 to below 1"
        )
    if kind == "projected":
        known = {f"{joint}.{angle}" for joint, angles in PROJECTED_ANGLES.items() for angle in angles}
    else:
        known = set(DOFS)
    limits: dict[str, Range] = {}
    for joint, angles in table.items():
        if not isinstance(angles, dict):
            raise InputError(f"{source}: {joint!r}: expected a table such as [neck] flexion = [-55, 45]")
        for angle, bounds in angles.items():
            where = f"{joint}.{angle}"
            if where not in known:
                raise InputError(
                    f"{source}: {where!r} is not an angle of kind {kind!r}; expected {', '.join(sorted(known))}"
                )
            limits[where] = _range(bounds, f"{source}: {where}")
    missing = known - set(limits) if kind == "projected" else set()
    if missing:
        raise InputError(
            f"{source}: missing {', '.join(sorted(missing))}; a projected table lists every angle"
        )
    return Ranges(name=source, kind=kind, limits=limits, shortest_projection=shortest, knee_flexed=flexed)


def _range(bounds: object, where: str) -> Range:
    if not isinstance(bounds, list) or len(bounds) != 2:
        raise InputError(f"{where}: {bounds!r}; expected [lower, upper] in degrees")
    lower, upper = (_number(bound, where) for bound in bounds)
    if lower > upper:
        raise InputError(f"{where}: lower {lower:g} is above upper {upper:g}; swap them")
    return lower, upper


def _number(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"{where}: {value!r}; expected a finite number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InputError(f"{where}: {number:g}; expected a finite number")
    return number
