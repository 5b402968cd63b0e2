"""Any URDF: checked before a native library sees it, loaded in a child first, scaled and fitted to postures."""

from posekit.robot.body_point import BodyPoint as BodyPoint
from posekit.robot.body_point import Site as Site
from posekit.robot.find import RobotFiles as RobotFiles
from posekit.robot.find import find as find
from posekit.robot.find import robot_names as robot_names
from posekit.robot.ik import InverseKinematics as InverseKinematics
from posekit.robot.ik import Reach as Reach
from posekit.robot.ik import Solution as Solution
from posekit.robot.ik import solve as solve
from posekit.robot.ik import solve_sequence as solve_sequence
from posekit.robot.joint_map import JointMap as JointMap
from posekit.robot.joint_map import find_joint_map as find_joint_map
from posekit.robot.joint_map import load_joint_map as load_joint_map
from posekit.robot.joint_map import postures_of as postures_of
from posekit.robot.joint_map import targets_of as targets_of
from posekit.robot.kinematics import Kinematics as Kinematics
from posekit.robot.kinematics import body_points as body_points
from posekit.robot.loading import load_robot as load_robot
from posekit.robot.robot import Robot as Robot
from posekit.robot.scaling import Scaled as Scaled
from posekit.robot.scaling import scaled as scaled
from posekit.robot.scaling import segment_lengths as segment_lengths
from posekit.robot.scaling import shoulders_are_behind as shoulders_are_behind
from posekit.robot.unit_quaternions import QuaternionWarning as QuaternionWarning
from posekit.robot.unit_quaternions import check_configurations as check_configurations
from posekit.robot.untrusted import ProbeLimits as ProbeLimits
