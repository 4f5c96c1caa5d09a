"""How well the shade on the ground of photos is found, in rendered places."""
