"""Every posture that fits a noisy view: the modes of the posterior of 14 joint positions.

`solve` is the method. `Problem` holds the image points and the prior knowledge of a body. `Modes` holds the result.
`Limits` holds the joint ranges.
"""

from posekit.solver.engine import backend as backend
from posekit.solver.limits import Limits as Limits
from posekit.solver.modes import Modes as Modes
from posekit.solver.problem import Problem as Problem
from posekit.solver.solve import solve as solve
