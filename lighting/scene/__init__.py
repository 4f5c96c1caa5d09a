"""A photo's light as a scene for the tools that people use; one file here for each tool.

`common.make_scene` computes a Scene once, `files.write_scene` and `files.zip_scene` hand it to a tool's writer.
"""

TOOLS = ("blender", "usd", "gltf", "threejs", "mitsuba")  # each is a module here with `write(scene, folder)`
