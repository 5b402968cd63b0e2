"""The type `Motion` for the motion of one body, its validation, and its repair."""

from posekit.motion.motion import Motion as Motion
