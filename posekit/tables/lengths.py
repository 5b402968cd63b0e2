"""``posekit.lengths/1``: a person's segment lengths, and the figure of a ``posekit.view/1`` as such a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal, Self

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, model_validator

from posekit.safe_io.refusal import shown
from posekit.skeleton import SEGMENT_NAMES
from posekit.tables.file_model import FileModel, named, refuse

PER_METRE: Final = {"m": 1.0, "cm": 100.0, "mm": 1000.0}
"""Units in one metre."""
MAX_SEGMENT_METRES: Final = 3.0
"""What a segment may have; longer is another unit."""


def _both_sides() -> dict[str, tuple[str, ...]]:
    """Name what stands for both sides: ``elbow-wrist``, ``neck-shoulder``, ``shoulder-pelvis``."""
    names: dict[str, tuple[str, ...]] = {}
    for name in SEGMENT_NAMES:
        if not all(end.startswith("left_") for end in name.split("-")):  # one side names the pair
            plain = name.replace("right_", "").replace("left_", "")
            pair = tuple(dict.fromkeys((name, name.replace("right_", "left_"))))
            if plain != name and len(pair) == 2 and all(one in SEGMENT_NAMES for one in pair):
                names[plain] = pair
    return names


BOTH_SIDES: Final = _both_sides()
"""Names without a side, and the two segments that they stand for."""


def _positive(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
        refuse("a positive number", "correct it", got=shown(value))
    return value


def _each_segment_once(lengths: dict[str, float]) -> dict[str, float]:
    """Give names without a side to both sides."""
    values: dict[str, float] = {}
    for key, number in lengths.items():
        for name in BOTH_SIDES.get(key, (key,)):
            if name in values:
                refuse("once", "drop the name without a side", at=key, got=f"{name} twice")
            values[name] = number
    return values


Positive = Annotated[float, BeforeValidator(_positive)]
BySegment = Annotated[
    dict[str, Positive],
    named((*SEGMENT_NAMES, *BOTH_SIDES), "segment"),
    AfterValidator(_each_segment_once),
]


class FigureTable(FileModel):
    """A person's lengths and stature, in the unit of the file."""

    lengths: BySegment = Field(default={})
    stature: Positive | None = None

    def check(self, unit: str, place: str = "") -> None:
        """Refuse a person without any length, and lengths that are those of another unit."""
        if not self.lengths and self.stature is None:
            refuse("one or more, or a stature", "add them", at=f"{place}lengths", got="no length")
        for name, value in self.lengths.items():
            if value / PER_METRE[unit] > MAX_SEGMENT_METRES:
                expected = f"at most {MAX_SEGMENT_METRES:g} m"
                at, got = f"{place}lengths.{name}", f"{value:g} {unit}"
                refuse(expected, "correct it, or the unit", at=at, got=got)


class LengthsTable(FigureTable):
    """A person's lengths."""

    hints_at: ClassVar[Mapping[str, str]] = {"unit": "say what the lengths are in"}

    schema_: Literal["posekit.lengths/1"] = Field(alias="schema")
    unit: Literal["m", "cm", "mm"]
    source: str | None = Field(default=None, description="Where the lengths come from.")
    deviation: BySegment = Field(default={}, description="Standard deviations of some of them.")

    @model_validator(mode="after")
    def _possible(self) -> Self:
        self.check(self.unit)
        extra = sorted(set(self.deviation) - set(self.lengths))
        if extra:
            got = "a deviation without its length"
            refuse("both", "add the length", at=f"deviation.{extra[0]}", got=got)
        return self


class ViewFigure(FigureTable):
    """The figure of a view, which says more of a person than this."""

    model_config = ConfigDict(extra="ignore")


class ViewLengthsTable(FileModel):
    """What a view says of a person's lengths; the rest of it is passed over."""

    model_config = ConfigDict(extra="ignore")

    schema_: Literal["posekit.view/1"] = Field(alias="schema")
    unit: Literal["m", "cm", "mm"]
    figure: ViewFigure = ViewFigure()

    @model_validator(mode="after")
    def _possible(self) -> Self:
        self.figure.check(self.unit, "figure.")
        return self
