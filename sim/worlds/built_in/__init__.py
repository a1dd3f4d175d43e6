"""Built-in worlds: the room of the demo, stand-ins for the paper's environments, buildings, and random rooms.

The catalogue of worlds lists them by name. The room may import the other modules of worlds, but not the file formats.
"""
