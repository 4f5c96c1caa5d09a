"""Many photos at once: on the CPUs of one machine, or on Ray. The results are the same."""

from lighting.batch.job import Job, Maps
from lighting.batch.photos import find_photos, other_pictures
from lighting.batch.pool import open_batch, run_pool
from lighting.batch.ray import find_photos_at, run_ray
from lighting.batch.summary import Summary
from lighting.batch.table import TABLE, require_parquet, write_table

__all__ = [
    "TABLE",
    "Job",
    "Maps",
    "Summary",
    "find_photos",
    "find_photos_at",
    "open_batch",
    "other_pictures",
    "require_parquet",
    "run_pool",
    "run_ray",
    "write_table",
]
