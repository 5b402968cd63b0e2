"""Robots: any URDF, checked and loaded once, with limits, collisions, and the places of the 14 joints."""

from posekit.robots.columns import Mimic as Mimic
from posekit.robots.find import robot_names as robot_names
from posekit.robots.robot import Robot as Robot
from posekit.robots.robot import load_robot as load_robot
