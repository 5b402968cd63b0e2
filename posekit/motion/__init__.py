"""Motion: points in space over time, in the formats of motion capture, biomechanics and animation."""

from posekit.motion.motion import Motion as Motion
