"""Panoramas and what is known about each: the index of a folder, the pictures, the labels.

This door needs neither torch nor scipy; `labelling`, `reports` and `synthetic`, which do the work of commands, are
imported from their modules.
"""

from export.data.labels import Label, labels_of, read_labels, write_labels
from export.data.panoramas import Panorama, is_permissive, read_index, write_index
from export.data.photos import PHOTOS, PhotoRow, needed_photo_rows, read_photo_rows
from export.data.pictures import decode, linear_of, read_picture
from export.data.tables import DataError, read_table, write_table

__all__ = [
    "PHOTOS",
    "DataError",
    "Label",
    "Panorama",
    "PhotoRow",
    "decode",
    "is_permissive",
    "labels_of",
    "linear_of",
    "needed_photo_rows",
    "read_index",
    "read_labels",
    "read_photo_rows",
    "read_picture",
    "read_table",
    "write_index",
    "write_labels",
    "write_table",
]
