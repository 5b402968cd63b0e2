"""Files: the boundary where what others wrote is checked, once, before anything is calculated from it."""

from posekit.files.camera_model import CameraModel as CameraModel
from posekit.files.camera_model import LeeChenModel as LeeChenModel
from posekit.files.camera_model import OpenCVModel as OpenCVModel
from posekit.files.camera_model import ScaledOrthographicModel as ScaledOrthographicModel
from posekit.files.reading import read_json as read_json
from posekit.files.units import parse_length as parse_length
from posekit.files.view import View as View
from posekit.files.view_file import read_view as read_view
from posekit.files.view_file import write_view as write_view
