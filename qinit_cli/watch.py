"""How far learning has come, for whoever shows it, and the way to stop it."""

from __future__ import annotations

import threading


class Watch:
    """Progress of learning that other threads may read, and the way to stop it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        self._steps, self._finished = 0, 0
        self._tasks = 0.0

    def add(self, steps: int, tasks: float = 0.0, finished: int = 0) -> None:
        """Counts steps, the tasks they amount to (an episode is its share of one), and the tasks whose last episode ended."""
        with self._lock:
            self._steps += steps
            self._tasks += tasks
            self._finished += finished

    def stop(self) -> None:
        """Learning ends soon; tasks that are not finished by then are lost."""
        self._stopped.set()

    @property
    def stopped(self) -> bool:
        """True once somebody has called `stop`."""
        return self._stopped.is_set()

    @property
    def steps(self) -> int:
        """Steps learned so far, in episodes that ended."""
        return self._steps

    @property
    def tasks(self) -> float:
        """Tasks learned so far, those at work by the share of their episodes that ended."""
        return self._tasks

    @property
    def finished(self) -> int:
        """Tasks whose last episode has ended; they may not have been handed in yet."""
        return self._finished

    def part(self, share: float = 1.0) -> Part:
        """A watch of some of the learning, which counts here too, its tasks as this share of one."""
        return Part(self, share)


class Part(Watch):
    """Progress of a part of the learning, and the same way to stop it as the whole."""

    def __init__(self, whole: Watch, share: float) -> None:
        super().__init__()
        self._whole, self._share = whole, share

    def add(self, steps: int, tasks: float = 0.0, finished: int = 0) -> None:
        """Counts here and in the whole; a task is not finished with a share of it."""
        super().add(steps, tasks, finished)
        self._whole.add(steps, tasks * self._share, finished if self._share == 1.0 else 0)

    def take_back(self) -> None:
        """Takes the tasks of this part, which were lost, from those of the whole; their steps still count."""
        self.add(0, -self.tasks, -self.finished)

    def stop(self) -> None:
        """Stops the whole."""
        self._whole.stop()

    @property
    def stopped(self) -> bool:
        """True once the whole was stopped."""
        return self._whole.stopped
