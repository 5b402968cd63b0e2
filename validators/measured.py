r"""What the checks of a figure allow people who were measured: what bodies give, and what measuring noise does.

A coordinate is off by :math:`\sigma`, a distance between two points so by :math:`\sqrt 2\,\sigma`, and the direction of
a segment of length l by :math:`\sqrt 2\,\sigma / l`. Three deviations are allowed for (`ALLOWED_DEVIATIONS`), as
squares beside what is allowed without noise: with :math:`e = 3 \sqrt 2\,\sigma`

- directions: :math:`\sqrt{(2^\circ)^2 + (e/l)^2}`, the widest of the segments that a check reads, of length l;
- lengths of bones, each by its own noise, and shoulder to shoulder: :math:`\sqrt{(3\,\mathrm{cm})^2 + e^2}`;
- spine, and shoulders to pelvis: the same with what a bending spine gives (`posekit.body.torso_bending`);
- contact: bodies may penetrate by e.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Final, cast

import numpy as np

from posekit.body import Figure
from posekit.body.measured import LIMB_NAMES, MeasuredPerson, hips_outward, noise_by_limb, usual_noise
from posekit.body.torso_bending import bending_gives
from posekit.geometry import Array
from posekit.settings import ALLOWED_DEVIATIONS, MEASURED_TOLERANCE, RigidTolerance, ValidateSettings
from posekit.skeleton import JOINT, RIGID_SEGMENTS, SEGMENT_NAMES, SEGMENTS, segment_name
from posekit.tree import Check, Loosening
from posekit.validators.ranges import Ranges

SPINE_SEGMENT: Final = (JOINT["neck"], JOINT["pelvis"])
USUAL_LENGTH: Final = 0.2
"""Metres: of the shortest segment by which directions are told."""
NECK_TO_HEAD: Final = ("", 0.2)
"""Where a check reads no segment, the length of one, metres: from neck to nose."""


@dataclass(frozen=True, kw_only=True)
class Allowance:
    """What is allowed in the postures of one person.

    Parameters
    ----------
    settings : ValidateSettings
        What was asked: a tolerance that is given stays as it is.
    person : MeasuredPerson, optional
        Whose noise is allowed for; none where it is not known.
    """

    settings: ValidateSettings
    person: MeasuredPerson | None = None

    def off(self, segment: str = "") -> float:
        """Return what noise may change a distance between two points by, metres: a segment, or any two."""
        noise = self.settings.noise
        if noise is None:
            known = not self.settings.strict and self.person is not None and math.isfinite(self.person.noise)
            noise = self.person.noise_of(segment) if known and self.person is not None else 0.0
        return ALLOWED_DEVIATIONS * math.sqrt(2) * noise

    @property
    def contact_margin(self) -> float:
        """Metres that bodies must keep from each other."""
        return self.settings.contact_margin - self.off()

    def rigid(self, figure: Figure) -> RigidTolerance:
        """Return what distances inside a figure may be off."""
        usual = self.settings.rigid
        if self.settings.strict or self.settings.rigid_tolerance is not None:
            return RigidTolerance.uniform(usual)
        sides = math.hypot(max(usual, bending_gives(figure.lengths)), self.off())
        bones = {
            segment: math.hypot(usual, self.off(segment_name(segment)))
            for segment in SEGMENTS
            if segment not in RIGID_SEGMENTS
        }
        bone = math.hypot(usual, self.off())
        return RigidTolerance(
            shoulders=bone, sides=sides, hips=bone, own=tuple({**bones, SPINE_SEGMENT: sides}.items())
        )

    def ranges(self, ranges: Ranges) -> Ranges:
        """Return joint ranges that begin where the person's skeleton has its pelvis.

        That is told by frames of a recording alone: who is judged by the model's lengths, as the survivors of a result
        are, has its pelvis.
        """
        if self.person is None or self.settings.strict or not math.isfinite(self.person.hips_forward):
            return ranges
        if self.settings.lengths == "model":
            return ranges
        return ranges.with_hips(self.person.hips_forward, hips_outward(self.person.lengths))

    def angle(self, segment: str, length: float) -> float:
        """Return by how much the direction of a segment may be off, degrees, by its length, metres."""
        if self.settings.strict or self.settings.angle_tolerance is not None:
            return self.settings.angle
        return math.hypot(MEASURED_TOLERANCE.angle, math.degrees(self.off(segment) / length))

    def of_robot(self, settings: ValidateSettings, *, made_up: bool) -> ValidateSettings:
        """Return a robot's settings with what noise asks for: its limits are its own, and known.

        Bodies may penetrate by what noise puts them off where they are made up; meshes have no depth.
        """
        off = self.off()
        shortest = min(self.person.lengths.values(), default=USUAL_LENGTH) if self.person else USUAL_LENGTH
        angle = math.degrees(off / max(shortest, USUAL_LENGTH))
        changes: dict[str, float] = {}
        if settings.rigid_tolerance is None:
            changes["rigid_tolerance"] = math.hypot(settings.rigid, off)
        if settings.angle_tolerance is None:
            changes["angle_tolerance"] = math.hypot(settings.angle, angle)
        if made_up:
            changes["contact_margin"] = settings.contact_margin - off
        return settings.changed(**changes)

    def applied(self, checks: Iterable[Check], figure: Figure) -> list[Check]:
        """Return the checks of a figure, each that judges directions with the tolerance that its own segments ask."""
        return [
            replace(cast(Any, check), tolerance=self._widest_angle(check.points, figure))
            if check.noise is Loosening.DIRECTIONS and hasattr(check, "tolerance")
            else check
            for check in checks
        ]

    def _widest_angle(self, points: tuple[int, ...], figure: Figure) -> float:
        read = [segment_name(segment) for segment in SEGMENTS if set(segment) <= set(points)]
        return max(
            (self.angle(name, figure.lengths[name]) for name in read), default=self.angle(*NECK_TO_HEAD)
        )

    def told(self, figure: Figure) -> dict[str, Any]:
        """Say what was allowed, as reports do: of angles and bones the least and the most."""
        rigid = self.rigid(figure)
        limbs = [self.angle(name, figure.lengths[name]) for name in LIMB_NAMES]
        bones = [rigid.of(SEGMENTS[SEGMENT_NAMES.index(name)]) for name in LIMB_NAMES]
        noise = self.settings.noise
        if noise is None and self.person is not None and math.isfinite(self.person.noise):
            noise = round(self.person.noise, 6)
        return {
            "noise": noise,
            "angle_tolerance": [round(min(limbs), 4), round(max(limbs), 4)],
            "rigid_tolerance": [f"{100 * min(bones):.3g}cm", f"{100 * max(bones):.3g}cm"],
            "torso_tolerance": f"{100 * rigid.sides:.3g}cm",
            "contact_margin": f"{round(100 * self.contact_margin, 3) + 0.0:g}cm",
        }


def recorded_noise(joints: Array, settings: ValidateSettings) -> float:
    """Return the noise that checks over time allow for, metres: what is stated, else what limbs tell, else 0.

    Parameters
    ----------
    joints : array (T, 14, 3)
        Frames of one recording, metres; NaN where unknown.
    settings : ValidateSettings
        Where it is stated; strict ones allow for none.
    """
    if settings.noise is not None or settings.strict:
        return settings.noise or 0.0
    return float(np.nan_to_num(usual_noise(noise_by_limb(joints))))
