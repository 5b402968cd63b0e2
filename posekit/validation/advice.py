"""One sentence about why most postures of a file fail, and what to try; and what was allowed them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from posekit.display.plural import plural
from posekit.formats.own import ValidationReport
from posekit.formats.own.report_columns import ReportPlace, VerdictColumns
from posekit.settings import DEFAULT_RANGES, EXACT_TOLERANCE
from posekit.validation.causes import CAUSING_CHECKS, FOLLOWING_CHECKS

FEW_DEGREES: Final = 15.0
"""Degrees within which somebody may well be more mobile, or a skeleton's joints placed otherwise."""

FULL_TURN_DEGREES: Final = 360.0
"""No joint is beyond its limit by so much whose angles are in radians."""

FEW_METRES: Final = 0.15
"""Metres by which a length may be off that a wider tolerance is worth trying for."""

MOST_OF_THEM: Final = 0.95
"""Share of the postures that fail by a check which a tolerance that is proposed lets pass."""

MANY_METRES: Final = 3.0
"""Metres: what misses a length by so much is in another unit."""

ALMOST_AS_MANY: Final = 0.9
"""Share of the most frequent violation's postures from which a cause is said instead."""

FEWER_CAUSES: Final = 3
"""Times as many postures may be rejected by what follows from another violation as by that."""

INVALID_VERDICT: Final = 1
"""Of a verdict in `VerdictColumns.verdict`."""


def why_most_fail(columns: VerdictColumns, told: Mapping[str, Any]) -> str:
    """Say in one sentence what rejects most of the postures that fail, by how much, and what to try; or nothing.

    Parameters
    ----------
    columns : VerdictColumns
        The verdicts.
    told : mapping
        What decided them, as the report says it.
    """
    if not np.any(columns.verdict == INVALID_VERDICT) or not len(columns.place):
        return ""
    often = np.bincount(columns.place, minlength=len(columns.places)) / [
        FEWER_CAUSES if one.check in FOLLOWING_CHECKS else 1 for one in columns.places
    ]
    many = often >= ALMOST_AS_MANY * often.max()
    causes = [
        k for k in np.flatnonzero(many).tolist() if columns.places[k].check in (*CAUSING_CHECKS, "teleport")
    ]
    most = int(causes[0] if causes else often.argmax())
    mine, place = columns.place == most, columns.places[most]
    count, beyond = len(np.unique(columns.posture[mine])), -columns.margin[mine]
    if place.check == "swap":
        return (
            f"{count} of {plural(len(columns), 'posture')} have left and right exchanged: put them right by "
            "--repair FILE"
        )
    check = place.check.replace("_", "-")
    return (
        f"{count} of {plural(len(columns), 'posture')} fail by {place.where} ({check}), by "
        f"{_amount(float(np.median(beyond)), place.unit)} in the median: "
        f"{_remedy(place, float(np.quantile(beyond, MOST_OF_THEM)), told)}"
    )


def _remedy(place: ReportPlace, by: float, told: Mapping[str, Any]) -> str:
    """Say what to try, where most of the postures that fail do so by no more than this."""
    ours = told.get("urdf") in (None, "stick_figure", "as recovered")
    if place.check == "joint_range":
        if not ours and by > FULL_TURN_DEGREES:
            return "its angles are in degrees, as it seems: give radians"
        if ours and told.get("ranges") not in (None, DEFAULT_RANGES):
            return f"try --ranges {DEFAULT_RANGES}, which real people pass"
        if by <= FEW_DEGREES:
            return f"try --angle-tolerance {math.ceil(by)}, or wider limits by --ranges FILE"
        return "are its axes, or left and right, as supposed? Else give wider limits by --ranges FILE"
    if place.check in ("rigid_parts", "reach"):
        if by > MANY_METRES:
            return "its lengths are no person's in metres: give its --unit"
        if told.get("lengths_from") == "model":
            return "try --lengths median, the person's own"
        if by > FEW_METRES:
            return "joints are swapped, broken, or of several people in one recording"
        used = "torso_tolerance" if "-pelvis" in place.where else "rigid_tolerance"
        return f"try --rigid-tolerance {math.ceil(_centimetres(told.get(used, '3cm')) + 100 * by)}cm"
    if place.check == "collision":
        allowed = _centimetres(told.get("contact_margin", "0cm"))
        margin = math.floor(allowed - 100 * by)
        if margin >= allowed:
            return "they touch: --repair takes them apart"
        why = ": bodies are capsules, and flesh gives" if ours else ", or --repair"
        return f"try --contact-margin {margin}cm{why}"
    if place.check in ("walking", "balance"):
        return f"leave {place.check} out of --checks where it is not asked for"
    return (
        "leave such frames out (--keep, --keep-spans), repair them (--repair FILE), or give your own threshold "
        "(--profile FILE)"
    )


def _centimetres(said: Any) -> float:
    """Return the larger of what was allowed."""
    return max(float(str(one).removesuffix("cm")) for one in (said if isinstance(said, list) else [said]))


def _amount(by: float, unit: str) -> str:
    if unit == "m":
        return f"{100 * by:.2g} cm" if by < 1 else f"{by:.3g} m"
    if unit == "1":
        return f"{by:.2g} times its bound" if by >= 1 else f"{by:.1%}"
    return f"{by:.2g} {'degrees' if unit == 'deg' else unit}"


def said_of(report: ValidationReport) -> list[str]:
    """Say what the postures of a report were allowed, and why most of those that fail do."""
    told = report.settings
    lines, angle = [], told.get("angle_tolerance")
    if "noise" in told or "people" in told:
        lines.append(_allowed(told))
    elif isinstance(angle, float) and (
        angle != EXACT_TOLERANCE.angle or str(told.get("contact_margin")).startswith("-")
    ):
        lines.append(f"judged with {angle:g} degrees of tolerance")
    if told.get("bodies_because"):
        lines.append(f"collision is judged by bodies that are made up: {told['bodies_because']}")
    if told.get("why"):
        lines.append(str(told["why"]))
    return lines


def _span(low: float, high: float) -> str:
    return " to ".join(dict.fromkeys((f"{low:.2g}", f"{high:.2g}")))


def _allowed(told: Mapping[str, Any]) -> str:
    """Say lengths, noise and tolerances in a line."""
    lengths = "the figure's lengths" if told.get("lengths_from") == "model" else "lengths as measured"
    noise = told.get("noise")
    if told.get("strict"):
        known = "strictly"
    elif isinstance(noise, list):
        known = f"{_span(1000 * noise[0], 1000 * noise[1])} mm of noise, at most"
    elif noise is None:
        known = "noise not known of so few frames"
    else:
        known = f"{1000 * noise:.2g} mm of noise"
    if "torso_tolerance" not in told:
        allowed = f"{told.get('angle_tolerance', 0):.3g} degrees, {told.get('rigid_tolerance', '')}"
        return f"judged by {lengths}, {known}: {allowed}"
    low, high = told["angle_tolerance"]
    angles = _span(low, high)
    bones = " to ".join(dict.fromkeys(told["rigid_tolerance"]))
    return (
        f"judged by {lengths}, {known}: {angles} degrees, {bones} in bones, {told['torso_tolerance']} in the torso, "
        f"{told['contact_margin']} between bodies"
    )
