"""The exact interpretation tree: all combinations of near and far for 13 joints, pruned level by level by checks."""

from posekit.tree.tree import Trees as Trees
from posekit.tree.tree import ancestors as ancestors
from posekit.tree.tree import grow as grow
