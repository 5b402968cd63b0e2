"""The exact interpretation tree: every near-far choice of 13 joints, pruned by checks as early as they can be asked."""

from posekit.tree.tree import Trees as Trees
from posekit.tree.tree import grow as grow
