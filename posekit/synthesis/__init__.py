"""Synthetic views with truth: a walker, random legal postures, motion capture; noise and seeds.

Each is a `SyntheticScene`: a figure, a camera, every point in the camera's frame and where it is seen.
"""

from posekit.synthesis.camera_sphere import CameraPlacements as CameraPlacements
from posekit.synthesis.camera_sphere import CameraSphere as CameraSphere
from posekit.synthesis.capture import Capture as Capture
from posekit.synthesis.capture_file import read_capture as read_capture
from posekit.synthesis.gait import Gait as Gait
from posekit.synthesis.mocap import clip_lengths as clip_lengths
from posekit.synthesis.mocap import mocap_scene as mocap_scene
from posekit.synthesis.mocap import mocap_scenes as mocap_scenes
from posekit.synthesis.random_postures import random_postures as random_postures
from posekit.synthesis.random_postures import random_views as random_views
from posekit.synthesis.synthetic_scene import SyntheticScene as SyntheticScene
from posekit.synthesis.walker import Walker as Walker
from posekit.synthesis.walker_scene import seq1 as seq1
from posekit.synthesis.walker_scene import seq2 as seq2
from posekit.synthesis.walker_scene import walker_scene as walker_scene
