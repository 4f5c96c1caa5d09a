"""How the cameras of several photos are turned against each other, from what they see in common."""

from lighting.turns.match import Features, Matches, features, has_opencv, match
from lighting.turns.rotation import Turn, relative_rotation, rotation_of

__all__ = ["Features", "Matches", "Turn", "features", "has_opencv", "match", "relative_rotation", "rotation_of"]
