"""How the cameras of several photos are turned against each other, from what they see in common."""

from lighting.turns.apart import place_apart
from lighting.turns.match import MAX_SIDE, Features, Matches, centred, features, has_opencv, match, opencv, shrunk
from lighting.turns.parallax import motion, obeying_more
from lighting.turns.rays import cross_matrix, focal_of, nearest_rotation, rays, rotation_about, rotation_vector
from lighting.turns.rotation import Turn, relative_rotation, rotation_of
from lighting.turns.search import search
from lighting.turns.sets import GUESSED_FOV_SIGMA, UP_SIGMA, Placed, Shot, View, place
from lighting.turns.upright import angles_of, common_up, level, own_up
from lighting.turns.zoomed import ONE_LENS

__all__ = [
    "GUESSED_FOV_SIGMA",
    "MAX_SIDE",
    "ONE_LENS",
    "UP_SIGMA",
    "Features",
    "Matches",
    "Placed",
    "Shot",
    "Turn",
    "View",
    "angles_of",
    "centred",
    "common_up",
    "cross_matrix",
    "features",
    "focal_of",
    "has_opencv",
    "level",
    "match",
    "motion",
    "nearest_rotation",
    "obeying_more",
    "opencv",
    "own_up",
    "place",
    "place_apart",
    "rays",
    "relative_rotation",
    "rotation_about",
    "rotation_of",
    "rotation_vector",
    "search",
    "shrunk",
]
