"""Cameras as other tools write them, and guesses where none is known.

A `CalibratedCamera` is what a file says; `pinhole_of` makes the camera that the interpretation tree uses of it, and
`undistorted` takes points there where the lens has more than Brown's five coefficients.
"""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand

if TYPE_CHECKING:
    from posekit.formats.cameras.exif import read_exif as read_exif
    from posekit.formats.cameras.reading import camera_formats as camera_formats
    from posekit.formats.cameras.reading import read_cameras as read_cameras
    from posekit.formats.cameras.reading import write_cameras as write_cameras
else:
    __getattr__ = on_demand(
        __name__,
        {
            "exif": ("read_exif",),
            "reading": (
                "camera_formats",
                "read_cameras",
                "write_cameras",
            ),
        },
    )
