"""Key points: what detectors found in pictures, in the formats that they write."""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand

if TYPE_CHECKING:
    from posekit.formats.keypoints.key_point_format import KeyPointFormat as KeyPointFormat
    from posekit.formats.keypoints.keypoints import KeyPoints as KeyPoints
    from posekit.formats.keypoints.persons import Person as Person
    from posekit.formats.keypoints.persons import choose as choose
    from posekit.formats.keypoints.persons import list_people as list_people
    from posekit.formats.keypoints.reading import chosen as chosen
    from posekit.formats.keypoints.reading import is_format as is_format
    from posekit.formats.keypoints.reading import key_point_formats as key_point_formats
    from posekit.formats.keypoints.reading import read_keypoints as read_keypoints
    from posekit.formats.keypoints.sides import SideCheck as SideCheck
    from posekit.formats.keypoints.sides import check_sides as check_sides
    from posekit.formats.keypoints.sides import swap as swap
    from posekit.formats.keypoints.tracking import track as track
else:
    __getattr__ = on_demand(
        __name__,
        {
            "key_point_format": ("KeyPointFormat",),
            "keypoints": ("KeyPoints",),
            "persons": ("Person", "choose", "list_people"),
            "reading": ("chosen", "is_format", "key_point_formats", "read_keypoints"),
            "sides": ("SideCheck", "check_sides", "swap"),
            "tracking": ("track",),
        },
    )
