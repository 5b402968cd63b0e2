"""Anatomical ranges from a table of `posekit.ranges/1`, kind ``anatomical``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, cast

from posekit.errors import InputError
from posekit.safe_io import cut, one_line
from posekit.validators.anatomical import ANGLES, DERIVED, Anatomy, Coupling, End, Motion, Side, Sinus

ELEVATION, PLANE, TURN = DERIVED

ALLOWED: Mapping[str, tuple[str, ...]] = {
    ELEVATION: (PLANE,),
    TURN: (ELEVATION,),
    **{
        angle: tuple(
            other
            for other in ANGLES
            if other != angle and {angle.split(".")[0], other.split(".")[0]} <= set(pair)
        )
        for pair in (("shoulder", "elbow"), ("hip", "knee"))
        for angle in ANGLES
        if angle.split(".")[0] in pair
    },
}
"""The angles that a coupling may bound, and those of the same limb on which it may depend."""

SINUSES = ("hip",)
"""The ball joints that may have a sinus: those whose three angles are judged, all in one check."""

MAX_COUPLINGS = 100
MAX_POWER = 100.0
MAX_SPREADS = 10.0
FULL_TURN = 360.0


def parse_anatomy(table: dict[str, Any], source: str) -> Anatomy:
    """Make anatomical ranges from the tables of a file, without its ``schema`` and ``kind``.

    Raises
    ------
    InputError
        Where an angle is missing or unknown, a number is none, or an end refers to no source of the table.
    """
    spreads = _number(table.pop("spreads", None), f"{source}: spreads")
    if not 0 <= spreads <= MAX_SPREADS:
        raise InputError(
            f"{source}: spreads is {spreads:g}; expected 0 to {MAX_SPREADS:g} standard deviations"
        )
    sources = table.pop("sources", {})
    if not isinstance(sources, dict) or not all(isinstance(text, str) for text in sources.values()):
        raise InputError(f"{source}: sources: expected a table such as [sources] boone = 'Boone & Azen 1979'")
    couplings = table.pop("coupling", [])
    if not isinstance(couplings, list) or len(couplings) > MAX_COUPLINGS:
        raise InputError(f"{source}: coupling: expected [[coupling]] tables, at most {MAX_COUPLINGS}")
    sinuses = _sinuses(table.pop("sinus", []), sources, source)
    motions = {}
    for joint, angles in table.items():
        if not isinstance(angles, dict):
            raise InputError(one_line(f"{source}: {joint!r}: expected a table such as [neck.flexion]"))
        for angle, motion in angles.items():
            name = f"{joint}.{angle}"
            if name not in ANGLES:
                raise InputError(
                    one_line(f"{source}: {cut(name)!r} is not an angle; expected {', '.join(ANGLES)}")
                )
            motions[name] = _motion(motion, sources, f"{source}: {name}")
    missing = [angle for angle in ANGLES if angle not in motions]
    if missing:
        raise InputError(
            f"{source}: missing {', '.join(missing)}; a table of anatomical ranges lists every angle"
        )
    return Anatomy(
        motions=motions,
        couplings=tuple(
            _coupling(given, sources, f"{source}: coupling {k + 1}") for k, given in enumerate(couplings)
        ),
        spreads=spreads,
        sources=sources,
        sinuses=sinuses,
    )


def _motion(given: object, sources: Mapping[str, str], where: str) -> Motion:
    table = _table(given, {"lower", "upper"}, {"zero"}, where)
    lower, upper = (_end(table[side], sources, f"{where}.{side}") for side in ("lower", "upper"))
    if not lower.mean < upper.mean:
        raise InputError(f"{where}: lower mean {lower.mean:g} is not below upper mean {upper.mean:g}")
    if upper.mean - lower.mean > FULL_TURN:
        raise InputError(f"{where}: {lower.mean:g} to {upper.mean:g}; expected at most a full turn")
    if "zero" not in table:
        return Motion(lower=lower, upper=upper)
    return Motion(lower=lower, upper=upper, zero=_end(table["zero"], sources, f"{where}.zero", exact=True))


def _end(given: object, sources: Mapping[str, str], where: str, *, exact: bool = False) -> End:
    table = _table(given, {"mean", "spread"}, {"source"}, where)
    return End(
        mean=_angle(table["mean"], f"{where}.mean"),
        spread=_spread(table["spread"], f"{where}.spread", exact=exact),
        source=_sources(table.get("source", []), sources, where),
    )


def _coupling(given: object, sources: Mapping[str, str], where: str) -> Coupling:
    table = _table(given, {"angle", "end", "of", "points", "spread"}, {"source"}, where)
    angle, end, of, points = (table[key] for key in ("angle", "end", "of", "points"))
    if not isinstance(angle, str) or angle not in ALLOWED:
        raise InputError(one_line(f"{where}: angle is {cut(str(angle))!r}; expected {', '.join(ALLOWED)}"))
    if not isinstance(of, str) or of not in ALLOWED[angle]:
        raise InputError(
            one_line(f"{where}: {angle} of {cut(str(of))!r}; expected of {', '.join(ALLOWED[angle])}")
        )
    if end not in ("lower", "upper"):
        raise InputError(one_line(f"{where}: end is {cut(str(end))!r}; expected 'lower' or 'upper'"))
    if not isinstance(points, list) or len(points) < 2:
        raise InputError(f"{where}: points: expected two or more of [{of}, {angle}], degrees")
    knots = []
    for point in points:
        if not isinstance(point, list) or len(point) != 2:
            raise InputError(f"{where}: points: {cut(str(point))}; expected [{of}, {angle}], degrees")
        knots.append((_angle(point[0], f"{where}.points"), _angle(point[1], f"{where}.points")))
    if any(b[0] <= a[0] for a, b in pairwise(knots)):
        raise InputError(f"{where}: points: {of} does not ascend; put the points in order")
    return Coupling(
        angle=angle,
        side=cast(Side, end),
        of=of,
        points=tuple(knots),
        spread=_spread(table["spread"], f"{where}.spread"),
        source=_sources(table.get("source", []), sources, where),
    )


def _sinuses(given: object, sources: Mapping[str, str], source: str) -> tuple[Sinus, ...]:
    if not isinstance(given, list) or len(given) > len(SINUSES):
        raise InputError(
            f"{source}: sinus: expected [[sinus]] tables, at most one for each of {', '.join(SINUSES)}"
        )
    sinuses: list[Sinus] = []
    for k, each in enumerate(given):
        where = f"{source}: sinus {k + 1}"
        table = _table(each, {"joint", "power", "source"}, set(), where)
        joint, power = table["joint"], _number(table["power"], f"{where}.power")
        if joint not in SINUSES:
            raise InputError(
                one_line(f"{where}: joint is {cut(str(joint))!r}; expected {', '.join(SINUSES)}")
            )
        if not 1 <= power <= MAX_POWER:
            raise InputError(f"{where}: power is {power:g}; expected 1 to {MAX_POWER:g} (2 is an ellipsoid)")
        sinuses.append(Sinus(joint=joint, power=power, source=_sources(table["source"], sources, where)))
    return tuple(sinuses)


def _table(given: object, needed: set[str], optional: set[str], where: str) -> dict[str, Any]:
    if not isinstance(given, dict):
        raise InputError(one_line(f"{where}: {cut(str(given))}; expected {', '.join(sorted(needed))}"))
    missing, unknown = sorted(needed - set(given)), sorted(set(given) - needed - optional)
    if missing:
        raise InputError(f"{where}: missing {', '.join(missing)}")
    if unknown:
        raise InputError(
            one_line(f"{where}: unknown {cut(unknown[0])!r}; expected {', '.join(sorted(needed | optional))}")
        )
    return given


def _sources(given: object, sources: Mapping[str, str], where: str) -> tuple[str, ...]:
    keys = [given] if isinstance(given, str) else given
    if not isinstance(keys, list) or not all(isinstance(key, str) for key in keys):
        raise InputError(f"{where}.source: expected one or more keys of [sources]")
    for key in keys:
        if key not in sources:
            raise InputError(one_line(f"{where}.source: {cut(key)!r} is not in [sources]; add it there"))
    return tuple(keys)


def _spread(given: object, where: str, *, exact: bool = False) -> float:
    number = _angle(given, where)
    if number < 0 or (number == 0 and not exact):
        raise InputError(f"{where}: {number:g}; expected a positive standard deviation, degrees")
    return number


def _angle(given: object, where: str) -> float:
    number = _number(given, where)
    if abs(number) > FULL_TURN:
        raise InputError(f"{where}: {number:g}; expected degrees from -360 to 360")
    return number


def _number(given: object, where: str) -> float:
    if isinstance(given, bool) or not isinstance(given, (int, float)):
        raise InputError(one_line(f"{where}: {cut(str(given))}; expected a finite number"))
    try:
        number = float(given)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InputError(f"{where}: {number:g}; expected a finite number")
    return number
