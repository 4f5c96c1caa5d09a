# godot --path PROJECT --script render.gd -- NAME...: a picture of the scene in linear light for each name, NAME.exr.
# "scene": as it is. "ground": the ground is a white diffuse plane, so that the picture holds its irradiance / pi.
# "sky": the same without the sun. "uniform": the same under a sky of (0.2, 0.3, 0.4) and black ground.
extends SceneTree

func _initialize() -> void:
	var scene: Node = load("res://scene.tscn").instantiate()
	root.add_child(scene)
	root.use_hdr_2d = true
	for name in OS.get_cmdline_user_args():
		if name != "scene":
			scene.get_node("Ground").material_override = white()
			scene.get_node("Camera/Backdrop").visible = false
		if name == "sky" or name == "uniform":
			scene.get_node("Sun").visible = false
		if name == "uniform":
			scene.get_node("Sky").environment.sky.sky_material.panorama = half_sky()
		for i in 4:
			await process_frame
		await RenderingServer.frame_post_draw
		var image := root.get_texture().get_image()
		image.convert(Image.FORMAT_RGBF)
		image.save_exr(name + ".exr")
	quit()

func white() -> Material:
	var material := StandardMaterial3D.new()
	material.diffuse_mode = BaseMaterial3D.DIFFUSE_LAMBERT
	material.specular_mode = BaseMaterial3D.SPECULAR_DISABLED
	return material

func half_sky() -> Texture2D:
	var image := Image.create(512, 256, false, Image.FORMAT_RGBF)
	image.fill_rect(Rect2i(0, 0, 512, 128), Color(0.2, 0.3, 0.4))
	return ImageTexture.create_from_image(image)
