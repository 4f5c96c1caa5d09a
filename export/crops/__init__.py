"""Pictures for training and evaluation, taken from panoramas with their targets. Needs no torch."""

from export.crops.augment import augment
from export.crops.cameras import PROTOCOLS, Camera, aimed_camera, paper_camera, pinhole, training_camera
from export.crops.crops import Crop, finest_side, is_resolved, take
from export.crops.exposure import automatic_gain
from export.crops.irradiance import Irradiance, clear_ratio, irradiance_of
from export.crops.mosaic import companions, joined, same_view
from export.crops.photos import PhotoSource, likelihood, load_photos, photo_weights, take_photo
from export.crops.seeds import generator
from export.crops.seen_sun import CELL, where_seen
from export.crops.sources import Source, load_sources, sampling_weights, stretched
from export.crops.stretch import NOT_STRETCHED, Stretch, any_stretch
from export.crops.surroundings import CELLS, light_around, seen_from

__all__ = [
    "CELL",
    "CELLS",
    "NOT_STRETCHED",
    "PROTOCOLS",
    "Camera",
    "Crop",
    "Irradiance",
    "PhotoSource",
    "Source",
    "Stretch",
    "aimed_camera",
    "any_stretch",
    "augment",
    "automatic_gain",
    "clear_ratio",
    "companions",
    "finest_side",
    "generator",
    "irradiance_of",
    "is_resolved",
    "joined",
    "light_around",
    "likelihood",
    "load_photos",
    "load_sources",
    "paper_camera",
    "photo_weights",
    "pinhole",
    "same_view",
    "sampling_weights",
    "seen_from",
    "stretched",
    "take",
    "take_photo",
    "training_camera",
    "where_seen",
]
