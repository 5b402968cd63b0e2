"""What bodies can do, one kind of check a file.

Each module makes checks (`posekit.tree.Check`) for a figure: small judges of a few points in batches, which
the interpretation tree asks as soon as those points are known, and `Validator` asks about whole postures. `registry`
has them by name; a check of your own inherits from `Check` (docs, "Write your own check").
"""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand
from posekit.tree import Check as Check
from posekit.tree import Findings as Findings
from posekit.tree import Loosening as Loosening
from posekit.tree import Place as Place
from posekit.tree import Scope as Scope
from posekit.validators.collision import collision as collision
from posekit.validators.joint_range import joint_range as joint_range
from posekit.validators.rigid_parts import rigid_parts as rigid_parts
from posekit.validators.walking import walking as walking

if TYPE_CHECKING:
    from posekit.validators.options import CheckOptions as CheckOptions
    from posekit.validators.ranges import Ranges as Ranges
    from posekit.validators.ranges import load_ranges as load_ranges
    from posekit.validators.registry import ALL_CHECKS as ALL_CHECKS
    from posekit.validators.registry import PHYSICAL_CHECKS as PHYSICAL_CHECKS
    from posekit.validators.registry import AnyCheck as AnyCheck
    from posekit.validators.registry import check_names as check_names
    from posekit.validators.registry import chosen_checks as chosen_checks
    from posekit.validators.registry import make_checks as make_checks
    from posekit.validators.robot.report import Report as Report
    from posekit.validators.suite import Judgement as Judgement
    from posekit.validators.suite import judge as judge
    from posekit.validators.suite import worst_margins as worst_margins
    from posekit.validators.validator import Validator as Validator
else:
    __getattr__ = on_demand(
        __name__,
        {
            "options": ("CheckOptions",),
            "ranges": (
                "Ranges",
                "load_ranges",
            ),
            "registry": (
                "ALL_CHECKS",
                "PHYSICAL_CHECKS",
                "AnyCheck",
                "check_names",
                "chosen_checks",
                "make_checks",
            ),
            "robot.report": ("Report",),
            "suite": (
                "Judgement",
                "judge",
                "worst_margins",
            ),
            "validator": ("Validator",),
        },
    )
