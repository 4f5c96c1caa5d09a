"""How the cameras of several photos are turned against each other, from what they see in common."""
