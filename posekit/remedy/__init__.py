"""The remedy: the nearest postures, motion or configurations that pass, with a record of what was changed."""

from posekit.remedy.configurations import repair_configurations as repair_configurations
from posekit.remedy.record import Repaired as Repaired
from posekit.remedy.record import RepairedSpan as RepairedSpan
from posekit.remedy.record import UnrepairedFrame as UnrepairedFrame
from posekit.remedy.repair import repair as repair
