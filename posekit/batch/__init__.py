"""Archives: inputs cut into shards, recovered by local processes or a cluster, one Parquet file each.

A shard is a pure function of its frames and the settings, its file's name tells both, and a file has its name only when
it is whole: a run that was killed goes on where it was, and never does anything twice.
"""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand

if TYPE_CHECKING:
    from posekit.batch.reading import read_frames as read_frames
    from posekit.batch.reading import read_shards as read_shards
    from posekit.batch.reading import shard_paths as shard_paths
    from posekit.batch.recipe import Recipe as Recipe
    from posekit.batch.run import Workers as Workers
    from posekit.batch.run import run_batch as run_batch
    from posekit.batch.running import Progress as Progress
    from posekit.batch.running import Summary as Summary
    from posekit.batch.shard import Finished as Finished
    from posekit.batch.shard import Shard as Shard
    from posekit.batch.shard import run_shard as run_shard
    from posekit.batch.verdicts import VerdictTotals as VerdictTotals
    from posekit.batch.verdicts import validate_archive as validate_archive
    from posekit.batch.view_table import write_view_table as write_view_table
else:
    __getattr__ = on_demand(
        __name__,
        {
            "reading": (
                "read_frames",
                "read_shards",
                "shard_paths",
            ),
            "recipe": ("Recipe",),
            "run": ("Workers", "run_batch"),
            "running": (
                "Progress",
                "Summary",
            ),
            "shard": (
                "Finished",
                "Shard",
                "run_shard",
            ),
            "verdicts": ("VerdictTotals", "validate_archive"),
            "view_table": ("write_view_table",),
        },
    )
