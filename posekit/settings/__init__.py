"""What a run was asked: made once, handed down whole, and written into every result."""

from posekit.settings.check import CheckSettings as CheckSettings
from posekit.settings.judging import DEFAULT_RANGES as DEFAULT_RANGES
from posekit.settings.judging import DEFAULT_RULES as DEFAULT_RULES
from posekit.settings.judging import RangeTable as RangeTable
from posekit.settings.recover import DEFAULT_CHECKS as DEFAULT_CHECKS
from posekit.settings.recover import RecoverSettings as RecoverSettings
from posekit.settings.rooting import Rooting as Rooting
from posekit.settings.scale import Scale as Scale
from posekit.settings.tolerance import ALLOWED_DEVIATIONS as ALLOWED_DEVIATIONS
from posekit.settings.tolerance import EXACT_TOLERANCE as EXACT_TOLERANCE
from posekit.settings.tolerance import MEASURED_TOLERANCE as MEASURED_TOLERANCE
from posekit.settings.tolerance import PHOTOGRAPH_TOLERANCE as PHOTOGRAPH_TOLERANCE
from posekit.settings.tolerance import Judged as Judged
from posekit.settings.tolerance import PartialTolerance as PartialTolerance
from posekit.settings.tolerance import RigidTolerance as RigidTolerance
from posekit.settings.tolerance import Tolerance as Tolerance
from posekit.settings.validate import RIGID_TOLERANCE as RIGID_TOLERANCE
from posekit.settings.validate import ValidateSettings as ValidateSettings
