"""What a step is made of: acts, each of which gives its stages."""

from collections.abc import Callable, Sequence
from typing import Protocol

from warpsph.device.launch import Launch, Launcher

Stage = Callable[[], None]
Part = Callable[[], Sequence[Stage]]


class Act(Protocol):
    """A physical act of a step."""

    def stages(self) -> dict[str, Stage]:
        """What to call in each step, in order, by names that tell what it does.

        Bound to the arrays as they are now: asked for again whenever arrays have grown. What a scene does not have is
        an act without stages.
        """


class Together:
    """An act of one stage: the launches of its parts in one go, since none waits for all particles of another."""

    def __init__(self, launcher: Launcher, name: str, *parts: Part) -> None:
        """Each of `parts` gives launches when it is called; one that gives none is not there."""
        self._launcher, self._name, self._parts = launcher, name, parts

    def stages(self) -> dict[str, Stage]:
        """One stage, or none."""
        found = [launch for part in self._parts for launch in part()]
        launches = [launch for launch in found if isinstance(launch, Launch)]
        if len(found) > 1:
            assert len(launches) == len(found), "only launches can go together with others"
            return {self._name: self._launcher.chain(*launches)}
        return {self._name: found[0]} if found else {}


class Renamed:
    """An act that a step has twice, under names of its own."""

    def __init__(self, act: Act, where: str) -> None:
        """`where` is appended to the names of stages."""
        self._act, self._where = act, where

    def stages(self) -> dict[str, Stage]:
        """Those of the act."""
        return {name + self._where: stage for name, stage in self._act.stages().items()}
