"""What `python -m export video` measures of clips: accuracy, trembling, drift and speed, with exact truth."""

PARTS = ("clips", "dissolves", "streams", "speed")  # of the report
KINDS = (
    "pan",
    "tilt",
    "hand",
    "moving things",
    "crowd",
    "motion blur",
    "exposure",
    "zoom",
    "walk",
)  # of clips, by what is hard in them
