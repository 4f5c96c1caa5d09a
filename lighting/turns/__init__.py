"""How the cameras of several photos are turned against each other, from what they see in common."""

from lighting.turns.apart import place_apart
from lighting.turns.match import MAX_SIDE, Features, Matches, features, has_opencv, match
from lighting.turns.rotation import Turn, relative_rotation, rotation_of
from lighting.turns.sets import UP_SIGMA, Placed, Shot, View, place

__all__ = [
    "MAX_SIDE",
    "UP_SIGMA",
    "Features",
    "Matches",
    "Placed",
    "Shot",
    "Turn",
    "View",
    "features",
    "has_opencv",
    "match",
    "place",
    "place_apart",
    "relative_rotation",
    "rotation_of",
]
