"""What a file holds, told in lines."""

from typing import TYPE_CHECKING

from posekit.inspection.describe import describe as describe
from posekit.on_demand import on_demand

if TYPE_CHECKING:
    from posekit.inspection.inspection import inspect as inspect
else:
    __getattr__ = on_demand(
        __name__,
        {
            "inspection": ("inspect",),
        },
    )
