"""What a simulated world can get wrong."""

from features.errors import CwlfError


class WorldError(CwlfError):
    """Walls or polygons that do not make a world."""
