"""The binary interpretation tree and the protocol of the checks that prune it."""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand
from posekit.tree.candidates import BranchState as BranchState
from posekit.tree.check import Check as Check
from posekit.tree.check import Findings as Findings
from posekit.tree.check import Loosening as Loosening
from posekit.tree.check import Place as Place
from posekit.tree.check import Rule as Rule
from posekit.tree.check import Scope as Scope
from posekit.tree.check import given_check as given_check
from posekit.tree.enumeration import enumerate_leaves as enumerate_leaves
from posekit.tree.interpretation_tree import InterpretationTree as InterpretationTree
from posekit.tree.leaves import Leaves as Leaves
from posekit.tree.leaves import Losses as Losses
from posekit.tree.leaves import Pruned as Pruned

if TYPE_CHECKING:
    from posekit.tree.screening import screened as screened
else:
    __getattr__ = on_demand(__name__, {"screening": ("screened",)})
