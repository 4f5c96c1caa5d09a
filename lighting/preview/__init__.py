"""Pictures for people: the photo, its light, and three spheres in this light."""
