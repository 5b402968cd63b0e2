"""Where the body is: the depth of the neck from the head, from the rigid torso, or searched along its ray."""

from posekit.cameras.neck.given import NeckSettings as NeckSettings
from posekit.cameras.neck.place import place as place
from posekit.cameras.neck.placement import NeckPlacement as NeckPlacement
