"""Camera models, and `View`: the image points of one person in one camera."""

from posekit.cameras.camera import Camera as Camera
from posekit.cameras.camera import Lift as Lift
from posekit.cameras.lee_chen import LeeChenCamera as LeeChenCamera
from posekit.cameras.pinhole import PinholeCamera as PinholeCamera
from posekit.cameras.pinhole import camera_from_fov as camera_from_fov
from posekit.cameras.scaled_orthographic import ScaledOrthographicCamera as ScaledOrthographicCamera
from posekit.cameras.view import CameraModel as CameraModel
from posekit.cameras.view import View as View
