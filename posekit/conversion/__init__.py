"""Any file into any other format that can hold what it says."""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand

if TYPE_CHECKING:
    from posekit.conversion.conversion import Conversion as Conversion
    from posekit.conversion.conversion import convert as convert
else:
    __getattr__ = on_demand(
        __name__,
        {
            "conversion": (
                "Conversion",
                "convert",
            ),
        },
    )
