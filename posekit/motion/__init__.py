"""Motion of one body: the type that everything reads, judges, repairs, draws and writes."""

from posekit.motion.motion import Motion as Motion
