"""How finely hidden joints are sampled."""

from __future__ import annotations

from dataclasses import dataclass

from posekit.errors import InputError


@dataclass(frozen=True, kw_only=True)
class OcclusionSampling:
    """Numbers of samples; more are finer and slower.

    Parameters
    ----------
    sphere : int
        Positions of one hidden joint about its parent: 400 are 10 degrees apart.
    ends : int
        Positions of a limb's end about each position of its middle, where both are hidden.
    circle : int
        Turns of a rigid part about two known points: 120 are 3 degrees apart.
    rotations : int
        Turns of a rigid part about one known point: 6000 are 14 degrees apart.
    measured_sphere : int
        Positions of a hidden joint of a measured limb about its parent: 1200 are 6 degrees apart.
    trunk_sphere : int
        Positions of a hidden joint of a measured trunk about its parent: 2000 are 4.5 degrees apart.
    hip_depths : int
        Depths of a hip that was seen, of a measured trunk whose pelvis was not.
    trunks : int
        Of those, how many limbs are placed on, at most.
    rounds : int
        Steps in which the ends of the boxes are sought between the samples.

    Raises
    ------
    InputError
        Where a number is too small to say anything.
    """

    sphere: int = 400
    ends: int = 24
    circle: int = 120
    rotations: int = 6000
    measured_sphere: int = 1200
    trunk_sphere: int = 2000
    hip_depths: int = 160
    trunks: int = 120
    rounds: int = 16

    def __post_init__(self) -> None:
        for name, least in (
            ("sphere", 32),
            ("ends", 8),
            ("circle", 24),
            ("rotations", 256),
            ("measured_sphere", 32),
            ("trunk_sphere", 64),
            ("hip_depths", 16),
            ("trunks", 8),
            ("rounds", 0),
        ):
            value = getattr(self, name)
            if not isinstance(value, int) or value < least:
                raise InputError(
                    f"the sampling's {name} is {value!r}; expected a whole number, at least {least}"
                )
