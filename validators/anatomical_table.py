"""Anatomical ranges of their table: `posekit.ranges/1`, kind ``anatomical``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from posekit.validators.anatomical import Anatomy, AngleRange, Coupling, End, Sinus

if TYPE_CHECKING:
    from posekit.tables.anatomy import AnatomyTable, EndTable, ZeroTable


def anatomy_of(table: AnatomyTable) -> Anatomy:
    """Make anatomical ranges of their table.

    Parameters
    ----------
    table : AnatomyTable
        What a file says.
    """
    return Anatomy(
        motions={
            angle: AngleRange(
                lower=_end(motion.lower),
                upper=_end(motion.upper),
                zero=_end(motion.zero),
                pelvis=motion.zero.pelvis,
            )
            for angle, motion in table.joints.items()
        },
        couplings=tuple(
            Coupling(
                angle=one.angle,
                side=one.end,
                of=one.of,
                points=tuple((of, mean) for of, mean in one.points),
                spread=one.spread,
                source=tuple(one.source),
            )
            for one in table.coupling
        ),
        spreads=table.spreads,
        sources=table.sources,
        sinuses=tuple(
            Sinus(joint=one.joint, power=one.power, source=tuple(one.source)) for one in table.sinus
        ),
    )


def _end(table: EndTable | ZeroTable) -> End:
    return End(mean=table.mean, spread=table.spread, source=tuple(table.source))
