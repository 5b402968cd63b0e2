"""What is in posekit's own files, in a few lines: results, batches and their shards, evaluations, reports."""

from posekit.pipeline.contents.describe import describe as describe
