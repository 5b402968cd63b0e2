"""``posekit.ranges/1`` of kind ``anatomical``: each end of an angle with its mean, its spread and its source."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Final, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from posekit.safe_io.refusal import cut, shown
from posekit.tables.angles import DERIVED_ANGLES, SIDELESS_ANGLES, SIDEWAYS_ANGLES
from posekit.tables.fields import listed
from posekit.tables.file_model import FileModel, refuse
from posekit.tables.ranges import by_joint, check_angles

ELEVATION_ANGLE, PLANE_ANGLE, TURN_ANGLE = DERIVED_ANGLES

COUPLED_ANGLES: Final[Mapping[str, tuple[str, ...]]] = {
    ELEVATION_ANGLE: (PLANE_ANGLE,),
    TURN_ANGLE: (ELEVATION_ANGLE,),
    **{angle: (hinge,) for angle, hinge in SIDEWAYS_ANGLES.items()},
    **{
        angle: tuple(
            other
            for other in SIDELESS_ANGLES
            if other != angle and {angle.split(".")[0], other.split(".")[0]} <= set(pair)
        )
        for pair in (("shoulder", "elbow"), ("hip", "knee"))
        for angle in SIDELESS_ANGLES
        if angle.split(".")[0] in pair
    },
}
"""The angles that a coupling may bound, and those of the same limb on which it may depend."""

SINUS_JOINTS: Final = ("hip",)
"""The ball joints that may have a sinus: those whose three angles are judged, all in one check."""
MAX_COUPLINGS: Final = 100
MAX_POWER: Final = 100
MAX_SPREADS: Final = 10
FULL_TURN_DEGREES: Final = 360
MAX_METRES: Final = 1.0


def _positive(value: Any) -> Any:
    if isinstance(value, int | float) and not isinstance(value, bool) and not value > 0:
        refuse("a positive standard deviation, degrees", "correct it", got=shown(value))
    return value


Degrees = Annotated[float, Field(ge=-FULL_TURN_DEGREES, le=FULL_TURN_DEGREES)]
Spread = Annotated[Degrees, BeforeValidator(_positive)]
Sources = Annotated[list[str], BeforeValidator(listed)]


class EndTable(FileModel):
    """One end of an angle."""

    mean: Degrees
    spread: Spread
    source: Sources = Field(default=[])


class ZeroTable(FileModel):
    """Where the clinic's zero is on the figure; it may be known exactly."""

    mean: Degrees
    spread: Annotated[Degrees, Field(ge=0)]
    pelvis: Annotated[float, Field(ge=0, le=MAX_METRES)] = Field(
        default=0.0,
        description="Metres, one standard deviation, by which skeletons put the pelvis before or behind that.",
    )
    source: Sources = Field(default=[])


class MotionTable(FileModel):
    """The range of one angle."""

    lower: EndTable
    upper: EndTable
    zero: ZeroTable = ZeroTable(mean=0.0, spread=0.0)

    @model_validator(mode="after")
    def _ascending(self) -> Self:
        lower, upper = self.lower.mean, self.upper.mean
        got = f"means {lower:g} and {upper:g}"
        if not lower < upper:
            refuse("the lower mean below the upper one", "correct them", got=got)
        if upper - lower > FULL_TURN_DEGREES:
            refuse("at most a full turn", "correct them", got=got)
        return self


class CouplingTable(FileModel):
    """An end of one angle as a function of another."""

    angle: Literal[tuple(COUPLED_ANGLES)]  # type: ignore[valid-type]  # the names are calculated
    end: Literal["lower", "upper"]
    of: str
    points: Annotated[
        list[Annotated[list[Degrees], Field(min_length=2, max_length=2)]], Field(min_length=2)
    ] = Field(description="Knots: `of`, and the mean end there, degrees.")
    spread: Spread
    source: Sources = Field(default=[])

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.of not in COUPLED_ANGLES[self.angle]:
            expected = f"one that {self.angle} may depend on: {', '.join(COUPLED_ANGLES[self.angle])}"
            refuse(expected, "correct it", at="of", got=shown(self.of))
        if any(b[0] <= a[0] for a, b in pairwise(self.points)):
            refuse(f"{self.of} to ascend", "put the points in order", at="points", got="points out of order")
        return self


class SinusTable(FileModel):
    """A ball joint's ranges rounded off."""

    joint: Literal[SINUS_JOINTS]  # type: ignore[valid-type]  # the names stand once
    power: Annotated[float, Field(ge=1, le=MAX_POWER)] = Field(description="2 is an ellipsoid.")
    source: Sources


class AnatomyTable(FileModel):
    """Anatomical ranges of all angles."""

    tags: ClassVar[frozenset[str]] = frozenset({"joints"})
    hints_at: ClassVar[Mapping[str, str]] = {
        "coupling": "write [[coupling]] tables",
        "sinus": "write [[sinus]] tables, one for a joint",
        "sources": 'write a table such as [sources] boone = "Boone & Azen 1979"',
        "source": "name one or more keys of [sources]",
    }

    schema_: Literal["posekit.ranges/1"] = Field(alias="schema")
    kind: Literal["anatomical"]
    spreads: Annotated[float, Field(ge=0, le=MAX_SPREADS)] = Field(
        description="Standard deviations beyond the means that are still possible."
    )
    sources: dict[str, str] = Field(default={})
    coupling: Annotated[list[CouplingTable], Field(max_length=MAX_COUPLINGS)] = Field(default=[])
    sinus: Annotated[list[SinusTable], Field(max_length=len(SINUS_JOINTS))] = Field(default=[])
    joints: dict[str, MotionTable] = Field(
        description="By angle: in the file a table for each, [neck.flexion]."
    )

    @model_validator(mode="before")
    @classmethod
    def _by_joint(cls, document: Any) -> Any:
        tables = by_joint(cls, document)
        if isinstance(tables, dict):
            check_angles(tables["joints"], SIDELESS_ANGLES, every=True)
        return tables

    @model_validator(mode="after")
    def _known_sources(self) -> Self:
        for place, keys in self._cited():
            for key in keys:
                if key not in self.sources:
                    refuse("a key of [sources]", "add it there", at=f"{place}.source", got=shown(cut(key)))
        return self

    def _cited(self) -> Iterator[tuple[str, list[str]]]:
        for name, motion in self.joints.items():
            for side in ("lower", "upper", "zero"):
                yield f"{name}.{side}", getattr(motion, side).source
        yield from ((f"coupling[{k}]", one.source) for k, one in enumerate(self.coupling))
        yield from ((f"sinus[{k}]", one.source) for k, one in enumerate(self.sinus))
