"""Worlds to drive through: walls and their corners, a check of walls, built-in worlds, and readers of world files.

The room promises worlds by name or from files; what cannot become a world raises ``WorldError``. It may import the room
of casting.
"""
