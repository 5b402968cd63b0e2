"""Any URDF: checked before a native library sees it, loaded in a child first, scaled and fitted to postures."""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand

if TYPE_CHECKING:
    from posekit.robots.body_point import BodyPoint as BodyPoint
    from posekit.robots.body_point import BodySite as BodySite
    from posekit.robots.find import RobotFiles as RobotFiles
    from posekit.robots.find import robot_names as robot_names
    from posekit.robots.ik import InverseKinematics as InverseKinematics
    from posekit.robots.ik import Reach as Reach
    from posekit.robots.ik import Solution as Solution
    from posekit.robots.ik import solve as solve
    from posekit.robots.ik import solve_sequence as solve_sequence
    from posekit.robots.joint_map import JointMap as JointMap
    from posekit.robots.joint_map import find_joint_map as find_joint_map
    from posekit.robots.joint_map import load_joint_map as load_joint_map
    from posekit.robots.joint_map import postures_of as postures_of
    from posekit.robots.joint_map import targets_of as targets_of
    from posekit.robots.kinematics import Kinematics as Kinematics
    from posekit.robots.kinematics import body_points as body_points
    from posekit.robots.loading import load_robot as load_robot
    from posekit.robots.robot import Robot as Robot
    from posekit.robots.scaling import ScaledRobot as ScaledRobot
    from posekit.robots.scaling import scaled as scaled
    from posekit.robots.scaling import segment_lengths as segment_lengths
    from posekit.robots.scaling import shoulders_are_behind as shoulders_are_behind
    from posekit.robots.unit_quaternions import QuaternionWarning as QuaternionWarning
    from posekit.robots.unit_quaternions import check_configurations as check_configurations
    from posekit.robots.untrusted import ProbeLimits as ProbeLimits
else:
    __getattr__ = on_demand(
        __name__,
        {
            "body_point": (
                "BodyPoint",
                "BodySite",
            ),
            "find": (
                "RobotFiles",
                "robot_names",
            ),
            "ik": (
                "InverseKinematics",
                "Reach",
                "Solution",
                "solve",
                "solve_sequence",
            ),
            "joint_map": (
                "JointMap",
                "find_joint_map",
                "load_joint_map",
                "postures_of",
                "targets_of",
            ),
            "kinematics": (
                "Kinematics",
                "body_points",
            ),
            "loading": ("load_robot",),
            "robot": ("Robot",),
            "scaling": (
                "ScaledRobot",
                "scaled",
                "segment_lengths",
                "shoulders_are_behind",
            ),
            "unit_quaternions": (
                "QuaternionWarning",
                "check_configurations",
            ),
            "untrusted": ("ProbeLimits",),
        },
    )
