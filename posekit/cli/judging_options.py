"""Options that say what postures are judged by, and with which tolerances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from posekit.cli.options import (
    PHYSICAL_CHECKS_TEXT,
    AngleTolerance,
    Rules,
    as_recover,
    option,
    rule_numbers,
    split,
)

if TYPE_CHECKING:
    from posekit.settings import PartialTolerance


@dataclass(frozen=True, kw_only=True)
class Judging:
    """By what postures are judged: `recover`, `batch` and `evaluate` have it."""

    checks: Annotated[
        str, option("--checks", "LIST", "Some of rigid-parts, joint-range, collision, walking, by commas.")
    ] = PHYSICAL_CHECKS_TEXT
    ranges: Annotated[
        str,
        option(
            "--ranges", "NAME|FILE", "Joint ranges: anatomical, urdf, table1, table1-printed, or a TOML file."
        ),
    ] = "anatomical"
    rules: Rules = "1,2"
    walkers: Annotated[
        str,
        option(
            "--walkers",
            "paper|people|paper-printed",
            "Thresholds of those rules: by Lee & Chen's word, as real walkers keep them, or as printed.",
        ),
    ] = "paper"

    @property
    def names(self) -> tuple[str, ...]:
        """The checks."""
        return split(self.checks)

    @property
    def numbers(self) -> tuple[int, ...]:
        """The rules of walking."""
        return rule_numbers(self.rules)


@dataclass(frozen=True, kw_only=True)
class Tolerances:
    """What may be off: `recover` explains it."""

    rigid_tolerance: Annotated[
        str,
        option(
            "--rigid-tolerance",
            "LENGTH",
            "How far distances inside torso and hips may be off. Default: exact where some torso fits "
            "exactly, else 3cm, or 10cm in an uncalibrated view. A tolerance that is given turns refinement off.",
        ),
    ] = ""
    tangent_tolerance: Annotated[
        str,
        option(
            "--tangent-tolerance",
            "LENGTH",
            "How much too short for its image a segment may be. Default: as above, 1cm or 5cm.",
        ),
    ] = ""
    angle_tolerance: AngleTolerance = None

    @property
    def rigid(self) -> float | None:
        """Metres, where it is given."""
        return _length(self.rigid_tolerance, "--rigid-tolerance")

    @property
    def tangent(self) -> float | None:
        """Metres, where it is given."""
        return _length(self.tangent_tolerance, "--tangent-tolerance")

    @property
    def given(self) -> PartialTolerance | None:
        """The tolerances that are given; None where none is."""
        from posekit.settings import PartialTolerance as Made

        return Made.of(rigid=self.rigid, tangent=self.tangent, angle=self.angle_tolerance)


@dataclass(frozen=True, kw_only=True)
class TolerancesAsRecover(Tolerances):
    """The same, told more shortly."""

    rigid_tolerance: Annotated[str, as_recover("--rigid-tolerance", "LENGTH")] = ""
    tangent_tolerance: Annotated[str, as_recover("--tangent-tolerance", "LENGTH")] = ""


def _length(text: str, option: str) -> float | None:
    from posekit.formats.own import parse_length

    return parse_length(text, name=option) if text else None
