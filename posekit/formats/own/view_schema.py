"""The schema ``posekit.view/1``, as a file holds it: in its own unit, a missing joint an absent key."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, ConfigDict, FailFast, Field, model_validator

from posekit.display.plural import plural
from posekit.formats.own.camera_model import check_intrinsics, check_rotation
from posekit.formats.own.units import Unit
from posekit.safe_io.refusal import cut, nearest, shown
from posekit.settings.recover import MAX_LENGTH_DEVIATION
from posekit.skeleton import HEAD_POINTS, JOINTS, POINTS, SEGMENT_NAMES
from posekit.tables.file_model import FileModel, checked, named, refuse

VIEW_SCHEMA = "posekit.view/1"
HEAD_NAMES = ("neck", *HEAD_POINTS)
LONGEST_NAME = 60
"""Characters of the name of a head point of the user's own."""
MISSPELT_LIKENESS = 0.75
"""Likeness (`difflib`) to a usual head point's name from which an own point that is seen nowhere is a misspelling."""


def _keys(names: tuple[str, ...], **more: Any) -> Any:
    """Say in the published schema which keys an object may have."""
    return Field(json_schema_extra={"propertyNames": {"enum": list(names)}, **more})


def is_head_name(name: str) -> bool:
    """Tell whether a head point can have this name: any short one that is no other joint's."""
    return name in HEAD_NAMES or (
        0 < len(name.strip()) <= len(name) <= LONGEST_NAME and name.isprintable() and name not in JOINTS
    )


def _head_named(value: Any) -> Any:
    for name in value if isinstance(value, dict) else ():
        if not is_head_name(name):
            remedy = f"give a name of up to {LONGEST_NAME} characters that no joint has"
            refuse("the name of a head point", remedy, at=cut(name), got=shown(name))
    return value


HEAD_NAMED = BeforeValidator(_head_named)
_HEAD_KEYS = {"minLength": 1, "maxLength": LONGEST_NAME, "not": {"enum": list(JOINTS[1:])}}

Point2 = Annotated[list[float], Field(min_length=2, max_length=2)]
Point3 = Annotated[list[float], Field(min_length=3, max_length=3)]
Matrix3 = Annotated[list[Point3], Field(min_length=3, max_length=3)]
Positive = Annotated[float, Field(gt=0)]
Confidence = Annotated[float, Field(ge=0)]
Pixels = Annotated[int, Field(gt=0, le=10**6)]

Image = Annotated[dict[str, Point2], named(JOINTS, "joint"), _keys(JOINTS)]
HeadImage = Annotated[
    dict[str, Point2],
    HEAD_NAMED,
    Field(json_schema_extra={"propertyNames": {**_HEAD_KEYS, "not": {"enum": list(JOINTS)}}}),
]
Sure = Annotated[dict[str, Confidence], named(POINTS, "joint or head point"), _keys(POINTS)]
Derived = Annotated[list[Literal[JOINTS]], Field(max_length=len(JOINTS))]  # type: ignore[valid-type]
Joints = Annotated[dict[str, Point3], named(JOINTS, "joint"), _keys(JOINTS)]
HeadPoints = Annotated[dict[str, Point3], HEAD_NAMED, Field(json_schema_extra={"propertyNames": _HEAD_KEYS})]
Lengths = Annotated[dict[str, Positive], named(SEGMENT_NAMES, "segment"), _keys(SEGMENT_NAMES)]


class LeeChenCamera(FileModel):
    """The camera of Lee & Chen 1985: image points on its image plane, x right, y up, in `unit`."""

    model: Literal["lee-chen"]
    f: Positive | None = Field(description="Lens to image plane, in `unit`; null where it is not known.")


class OpenCVCamera(FileModel):
    """A calibrated pinhole camera in OpenCV's convention: image points in pixels, y down."""

    model: Literal["opencv"]
    K: Annotated[Matrix3, checked(check_intrinsics, "a matrix of intrinsics")] = Field(
        description="Intrinsics, pixels: [[fx, skew, cx], [0, fy, cy], [0, 0, 1]]."
    )
    distortion: Annotated[list[float], Field(min_length=5, max_length=5)] | None = Field(
        default=None, description="k1, k2, p1, p2, k3."
    )
    R: Annotated[Matrix3, checked(check_rotation, "a rotation matrix")] | None = Field(
        default=None, description="World to camera: p_cam = R p_world + t."
    )
    t: Point3 | None = Field(default=None, description="World to camera, in `unit`.")
    size: Annotated[list[Pixels], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="Width and height of the picture, pixels."
    )
    up: Literal["+x", "-x", "+y", "-y", "+z", "-z"] | None = Field(
        default=None, description="The world's axis that points against gravity, where R is given."
    )


class ScaledOrthographicFields(FileModel):
    """The uncalibrated camera of Taylor 2000: image points in pixels, y down."""

    model: Literal["scaled-orthographic"]
    scale: Positive | None = Field(description="Pixels a `unit` of length; null where it is not known.")
    aspect: Positive = Field(
        default=1.0, description="Width of a pixel over its height, where it is not square."
    )


class FigureFields(FileModel):
    """What is known of the person's body."""

    lengths: Lengths | None = Field(default=None, description="Segment lengths in `unit`, named a-b.")
    shoulders: Literal["front", "behind"] | None = Field(
        default=None,
        description="On which side of the line from neck to pelvis the shoulders lie: lengths do not tell it.",
    )
    stature: Positive | None = Field(default=None, description="Height of the person, in `unit`.")
    head_points: HeadPoints | None = Field(
        default=None,
        description="Points of the rigid head in the head's frame, in `unit`: neck, nose, eyes, ears, and any others.",
    )


class FrameFields(FileModel):
    """One picture."""

    time: float = Field(description="Seconds.")
    image: Image = Field(
        description="Where each joint is seen; one that is not seen is left out. The neck is seen in one frame at "
        "least, unless the camera is scaled-orthographic."
    )
    head_image: HeadImage | None = Field(
        default=None,
        description="Where each point of the head is seen: nose, eyes, ears, and others that `head_points` names.",
    )
    confidence: Sure | None = Field(
        default=None, description="How sure each image point is, as its detector says it: mostly 0 to 1."
    )
    root: Point3 | None = Field(default=None, description="The neck, OpenCV camera frame, in `unit`.")
    truth: Joints | None = Field(default=None, description="Joints, OpenCV camera frame, in `unit`.")


class ViewFile(FileModel):
    """One view of one person, a frame or a sequence."""

    tags: ClassVar[frozenset[str]] = frozenset({"lee-chen", "opencv", "scaled-orthographic"})
    hints: ClassVar[Mapping[str, str]] = {
        "f": "give it in the view's unit, or write null to have it recovered from the head",
        "scale": "give it in pixels a unit, or write null where it is not known",
        "lengths": "correct it, or leave it out to take the figure's",
        "shoulders": "say front or behind, or leave it out",
        "stature": "correct it, or leave it out",
        "head_points": "a head point is [x, y, z]; leave out one that is not known",
        "image": "an image point is [u, v]; leave out a joint that is not seen",
        "head_image": "an image point is [u, v]; leave out one that is not seen",
        "deviation": "give it in pixels, or leave it out",
        "length_deviation": "give a fraction of the length, 0 where lengths are exact, or leave it out",
        "derived": "name joints, or leave it out",
        "confidence": "a confidence is a number from 0; leave out one that is not known",
        "truth": "a joint is [x, y, z]; leave out one that is not known",
        "root": "the root is [x, y, z]; leave it out where it is not known",
        "K": "K is three rows of three numbers, in pixels",
        "R": "R is three rows of three numbers",
        "t": "t is three numbers in the view's unit",
        "distortion": "give the five numbers k1, k2, p1, p2, k3, or leave it out",
        "size": "size is [width, height] in whole pixels",
        "up": "give +x, -x, +y, -y, +z or -z, or leave it out",
        "frames": "a view has at least one frame, each of them an object with time and image",
        "time": "give it in seconds",
    }

    model_config = ConfigDict(
        json_schema_extra={
            "if": {"properties": {"camera": {"properties": {"model": {"const": "scaled-orthographic"}}}}},
            "else": {
                "properties": {
                    "frames": {"contains": {"properties": {"image": {"required": ["neck"]}}}},
                }
            },
        }
    )

    schema_: Literal["posekit.view/1"] = Field(alias="schema")
    unit: Unit
    camera: LeeChenCamera | OpenCVCamera | ScaledOrthographicFields = Field(discriminator="model")
    figure: FigureFields | None = None
    deviation: Positive | None = Field(
        default=None, description="Standard deviation of each coordinate of the image points, pixels."
    )
    length_deviation: Annotated[float, Field(ge=0, le=MAX_LENGTH_DEVIATION)] | None = Field(
        default=None,
        description="Relative standard deviation of the person's lengths; 0 where they are exact.",
    )
    derived: Derived | None = Field(
        default=None,
        description="Joints of `image` that no detector saw: they were put between others that it saw.",
    )
    frames: Annotated[list[FrameFields], Field(min_length=1), FailFast()]

    @model_validator(mode="after")
    def _head_is_known(self) -> ViewFile:
        """Refuse names on one side only: an image point without its place, and a place that is a misspelt name."""
        places = (self.figure.head_points if self.figure else None) or {}
        known = {*HEAD_POINTS, *places} - {"neck"}
        seen: set[str] = set()
        for index, frame in enumerate(self.frames):
            for name in frame.head_image or ():
                if name not in known:
                    remedy = f"{nearest(name, sorted(known))}; or give its place in figure.head_points"
                    at = f"frames[{index}].head_image.{cut(name)}"
                    refuse("the name of a head point", remedy, at=at, got=shown(name))
            seen.update(frame.head_image or ())
        for name in places.keys() - seen - set(HEAD_NAMES):
            if meant := get_close_matches(name, HEAD_NAMES, n=1, cutoff=MISSPELT_LIKENESS):
                remedy = f"did you mean {meant[0]}? or say in head_image where {cut(name)} is seen"
                refuse(
                    "the name of a head point", remedy, at=f"figure.head_points.{cut(name)}", got=shown(name)
                )
        return self

    @model_validator(mode="after")
    def _neck_is_seen(self) -> ViewFile:
        calibrated = not isinstance(self.camera, ScaledOrthographicFields)
        if calibrated and not any("neck" in frame.image for frame in self.frames):
            refuse(
                "the neck in one frame at least: the tree grows from it",
                "add it",
                at="frames[0].image.neck",
                got=f"nothing, in none of {plural(len(self.frames), 'frame')}",
            )
        return self
