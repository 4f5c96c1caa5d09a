"""What `python -m export turns` measures of photos of one place: their turns, and what those make of the sun."""

PARTS = ("pairs", "zooms", "walks", "sets", "overlap")  # of the report
