"""Files to try posekit with: a walk, what a detector would see of it, a photograph's points, and robots.

All of them are made when they are asked for, from the walker's gait and from seeds: they are the same every time.
"""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand

if TYPE_CHECKING:
    from posekit.samples.folder import write_samples as write_samples
else:
    __getattr__ = on_demand(__name__, {"folder": ("write_samples",)})
