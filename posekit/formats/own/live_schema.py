"""JSON lines of live key points: a header that says who and what is seen, if any, and a line a picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

from pydantic import Discriminator, Field, Tag

from posekit.formats.own.view_schema import Lengths, OpenCVCamera, Pixels, Point3, Positive
from posekit.tables.file_model import FileModel, conforming

LivePoint = Annotated[list[float | None], Field(min_length=2, max_length=3)]
ByNumber = Annotated[list[LivePoint | None], Field(max_length=1000)]
ByName = dict[str, LivePoint | None]


def _spelling(points: Any) -> str:
    return "by name" if isinstance(points, dict) else "by number"


class LiveHeader(FileModel):
    """Who is seen, by which camera, and what the points are: the first line, where there is one."""

    tags: ClassVar[frozenset[str]] = frozenset({"opencv"})
    hints: ClassVar[Mapping[str, str]] = {
        "camera": 'a camera is {"model": "opencv", "K": [[f, 0, cx], [0, f, cy], [0, 0, 1]]}, in pixels',
        "size": "size is [width, height] in whole pixels",
        "lengths": "a length is in metres, named a-b",
        "stature": "give it in metres",
        "deviation": "give it in pixels, or leave it out",
        "layout": "name a skeleton map, as coco_17 or mediapipe_33, or leave it out",
    }

    camera: OpenCVCamera | None = Field(default=None, description="The camera, lengths in metres.")
    size: Annotated[list[Pixels], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="Width and height of the pictures, pixels, where the camera is not known."
    )
    lengths: Lengths | None = Field(default=None, description="Segment lengths, metres, named a-b.")
    stature: Positive | None = Field(default=None, description="Height of the person, metres.")
    deviation: Positive | None = Field(
        default=None, description="Standard deviation of each coordinate of the points, pixels."
    )
    layout: str | None = Field(
        default=None, description="A skeleton map by name; joints in tree order if not given."
    )


class LiveFrame(FileModel):
    """One picture."""

    tags: ClassVar[frozenset[str]] = frozenset({"by name", "by number"})
    hints: ClassVar[Mapping[str, str]] = {
        "time": "give it in seconds",
        "points": "a point is [x, y] or [x, y, confidence], or null where it was not seen",
        "root": "the root is [x, y, z] in metres; leave it out where it is not known",
    }

    time: float = Field(description="Seconds.")
    points: Annotated[
        Annotated[ByName, Tag("by name")] | Annotated[ByNumber, Tag("by number")], Discriminator(_spelling)
    ] = Field(description="Points by name, or in the order of the layout: pixels, maybe with a confidence.")
    root: Point3 | None = Field(
        default=None, description="The neck, camera frame, metres, where it is known."
    )


def live_header(document: object, where: str) -> LiveHeader:
    """Read the header that a line holds; `where` is what errors call the line.

    Raises
    ------
    InputError
        For the first error, with how many more there are.
    """
    return conforming(LiveHeader, document, where)


def live_frame(document: object, where: str) -> LiveFrame:
    """Read the picture that a line holds; as `live_header`."""
    return conforming(LiveFrame, document, where)
