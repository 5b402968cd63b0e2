"""Cameras as other tools write them, and guesses where none is known.

A `CalibratedCamera` is what a file says; `pinhole_of` makes the camera that the interpretation tree uses of it, and
`undistorted` takes points there where the lens has more than Brown's five coefficients.
"""

from posekit.calibration.camera import CalibratedCamera as CalibratedCamera
from posekit.calibration.camera import choose_camera as choose_camera
from posekit.calibration.camera import needs_undistortion as needs_undistortion
from posekit.calibration.camera import pinhole_of as pinhole_of
from posekit.calibration.exif import read_exif as read_exif
from posekit.calibration.guesses import camera_from_focal35 as camera_from_focal35
from posekit.calibration.guesses import camera_from_fov as camera_from_fov
from posekit.calibration.projection import project as project
from posekit.calibration.reading import FORMATS as FORMATS
from posekit.calibration.reading import read_cameras as read_cameras
from posekit.calibration.reading import write_cameras as write_cameras
from posekit.calibration.undistortion import undistorted as undistorted
