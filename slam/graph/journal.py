"""A factor graph that can be pickled: as the journal of the calls that built it."""

from typing import Any

from features.se2 import Array, Pose
from slam.graph.incremental import LandmarkGraph
from slam.graph.rules import GraphRules
from slam.graph.values import Closure, Observations


class JournaledGraph(LandmarkGraph):
    """Factor graph that is pickled as a journal of its method calls, which are replayed when it is unpickled.

    The state of iSAM2 cannot be serialised exactly, but the same calls in the same order reproduce it.

    Parameters
    ----------
    cauchy_scale, rules : of :class:`LandmarkGraph`.
    journal : names and arguments of the calls that the constructor replays.
    """

    def __init__(
        self,
        cauchy_scale: float,
        rules: GraphRules = GraphRules(),  # noqa: B008, frozen
        journal: tuple[tuple[str, Any], ...] = (),
    ) -> None:
        super().__init__(cauchy_scale, rules)
        self._cauchy_scale = cauchy_scale
        self._journal: list[tuple[str, Any]] = []
        for name, arguments in journal:
            getattr(self, name)(*arguments)

    def __reduce__(self) -> tuple[type, tuple[Any, ...]]:
        return JournaledGraph, (self._cauchy_scale, self._rules, tuple(self._journal))

    def add_key_frame(
        self, pose_world_robot: Pose, motion: Pose, motion_cov: Array, observations: Observations
    ) -> None:
        """See :meth:`LandmarkGraph.add_key_frame`."""
        self._journal.append(("add_key_frame", (pose_world_robot, motion, motion_cov, observations)))
        super().add_key_frame(pose_world_robot, motion, motion_cov, observations)

    def add_closure(self, closure: Closure) -> None:
        """See :meth:`LandmarkGraph.add_closure`."""
        self._journal.append(("add_closure", (closure,)))
        super().add_closure(closure)

    def merge(self, kept: int, other: int) -> None:
        """See :meth:`LandmarkGraph.merge`."""
        self._journal.append(("merge", (kept, other)))
        super().merge(kept, other)

    def update(self) -> None:
        """See :meth:`LandmarkGraph.update`."""
        self._journal.append(("update", ()))
        super().update()

    def newest_cov(self) -> Array | None:
        """See :meth:`LandmarkGraph.newest_cov`; iSAM2 keeps parts of it, so it is in the journal too."""
        self._journal.append(("newest_cov", ()))
        return super().newest_cov()
