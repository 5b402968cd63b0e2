"""What any robot's postures are judged by, one kind of check a file.

A `Subject` is a model with its limits and bodies; a `Fitter` makes configurations of postures; the checks judge
configurations in batches. `RobotValidator` puts them together, and `posekit.validators.Validator` is its face.
"""

from posekit.validators.robot.contacts import Contacts as Contacts
from posekit.validators.robot.deferred import Deferred as Deferred
from posekit.validators.robot.ranges import load_joint_limits as load_joint_limits
from posekit.validators.robot.robot_validator import RobotValidator as RobotValidator
from posekit.validators.robot.settings import ROBOT_CHECKS as ROBOT_CHECKS
from posekit.validators.robot.settings import ROBOT_DEFAULT as ROBOT_DEFAULT
