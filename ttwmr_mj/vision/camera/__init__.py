"""The camera: model, lens, light, and the pictures it takes."""
