"""Robots: any URDF, checked and loaded once, with joint limits, collision bodies, and the 14 joints' positions."""

from posekit.robots.columns import Mimic as Mimic
from posekit.robots.find import robot_names as robot_names
from posekit.robots.robot import Robot as Robot
from posekit.robots.robot import load_robot as load_robot
