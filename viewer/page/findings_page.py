"""What checks find in postures, as a page shows it: which check, its value and its bound, and at whose joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from posekit.body.capsules import CAPSULE_AXES
from posekit.skeleton import JOINT, JOINTS
from posekit.viewer.scene.culprit import culprit

Json = dict[str, Any]

MOST_OF_POSTURE: Final = 6
"""Findings of one posture that a page has."""

SHOWN_UNITS: Final = {"m": (1000.0, "mm"), "deg": (1.0, "°"), "1": (1.0, "")}
"""How values are shown, by unit."""


@dataclass(frozen=True, kw_only=True)
class PageFinding:
    """What a check found in a posture.

    Parameters
    ----------
    check, where : str
        The check, and the place that it judged.
    unit : str
        ``m``, ``deg`` or empty.
    value, bound : float
        What was measured, and the bound that it is beyond, in that unit.
    """

    check: str
    where: str
    unit: str
    value: float
    bound: float


@dataclass(frozen=True, kw_only=True)
class PageFindings:
    """What checks found in the postures of a file.

    Parameters
    ----------
    by_posture : mapping of int to sequence of PageFinding
        By the number of each posture in its file, from 0; those without findings are left out.
    """

    by_posture: Mapping[int, Sequence[PageFinding]] = field(default_factory=dict)

    def places(self) -> list[tuple[str, str, str]]:
        """List the places that something was found at: check, where, unit."""
        all_of_them = (one for found in self.by_posture.values() for one in found)
        return list(dict.fromkeys((one.check, one.where, one.unit) for one in all_of_them))

    def described(self) -> list[Json]:
        """Describe the places for the page."""
        return [
            {
                "check": check,
                "where": where,
                "unit": SHOWN_UNITS.get(unit, (1.0, unit))[1],
                "joints": joints_of(f"{check}/{where}"),
            }
            for check, where, unit in self.places()
        ]

    def numbers(self) -> dict[int, list[list[float]]]:
        """Return by posture the number of each finding's place, its value and its bound, in units that are shown."""
        place = {one: k for k, one in enumerate(self.places())}
        found = {}
        for posture, each in self.by_posture.items():
            rows = []
            for one in each[:MOST_OF_POSTURE]:
                scale = SHOWN_UNITS.get(one.unit, (1.0, ""))[0]
                values = [float(f"{scale * value:.4g}") for value in (one.value, one.bound)]
                rows.append([place[one.check, one.where, one.unit], *values])
            found[posture] = rows
        return found


def joints_of(reason: str) -> list[int]:
    """Return which points a finding is about: the joints that it names, or the ends of its links.

    Parameters
    ----------
    reason : str
        ``check/where``.
    """
    found = culprit(reason)
    ends = [point for link in found.links for axis in CAPSULE_AXES[link] for point in axis]
    joints = {*(JOINT[name] for name in found.joints), *ends}
    return sorted(joint for joint in joints if joint < len(JOINTS)) or sorted(joints)
