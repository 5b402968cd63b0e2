"""Any URDF: found by name or path, checked before a native library sees it, and loaded in a child first."""

from posekit.robot.find import RobotFiles as RobotFiles
from posekit.robot.find import find as find
from posekit.robot.find import robot_names as robot_names
from posekit.robot.loading import load_robot as load_robot
from posekit.robot.robot import Robot as Robot
from posekit.robot.unit_quaternions import QuaternionWarning as QuaternionWarning
from posekit.robot.unit_quaternions import check_configurations as check_configurations
from posekit.robot.untrusted import ProbeLimits as ProbeLimits
