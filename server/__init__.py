"""The HTTP service around `lighting`: photos in, light out; environment maps from parameters alone."""
