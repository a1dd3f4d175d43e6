"""Worlds to drive through: walls, their corners, checks, built-in buildings and files of other programs."""
