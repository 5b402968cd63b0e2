"""The binary interpretation tree and the protocol of the checks that prune it."""

from posekit.tree.check import Check as Check
from posekit.tree.check import Findings as Findings
