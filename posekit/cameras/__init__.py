"""Cameras: where a point is seen, and where the end of a segment can be.

A camera is anything with `project` and `lift` (see `posekit.cameras.camera.Camera`); the interpretation
tree asks for nothing else.
"""

from posekit.cameras.camera import Camera as Camera
from posekit.cameras.camera import Lift as Lift
from posekit.cameras.pinhole import PinholeCamera as PinholeCamera
from posekit.cameras.scaled_orthographic import ScaledOrthographicCamera as ScaledOrthographicCamera
