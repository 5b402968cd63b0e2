"""Where the body is: the depth of the neck from the head, from the rigid torso, or searched along its ray."""

from posekit.placement.place import DETECTED_DEVIATION as DETECTED_DEVIATION
from posekit.placement.place import DETECTED_OFFSET as DETECTED_OFFSET
from posekit.placement.place import Method as Method
from posekit.placement.place import place as place
from posekit.placement.placement import Placement as Placement
