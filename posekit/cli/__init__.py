"""The subcommands of `posekit`, one in each module."""
