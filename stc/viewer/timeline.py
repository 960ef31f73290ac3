"""The displayed time: playing, paused or dragged, at any speed, once or in a loop."""

from __future__ import annotations

from stc.records import dataclass

#: Speeds that the keys and the panel offer, as shares of real time.
SPEEDS = (0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.0)

#: In a loop the last instant stays for this long, in seconds as the watcher counts them.
PAUSE = 0.6


@dataclass(slots=True)
class Timeline:
    """A clock that runs from the first frame of a motion to its last.

    Attributes:
        start: time of the first frame, in seconds.
        end: time of the last frame.
        now: the instant that is shown.
        playing: whether time passes.
        speed: seconds of the motion that pass in one second.
        loop: whether it starts again at the end.
    """

    start: float = 0.0
    end: float = 0.0
    now: float = 0.0
    playing: bool = True
    speed: float = 1.0
    loop: bool = True
    _waited: float = 0.0

    @property
    def duration(self) -> float:
        """From the first frame to the last, in seconds."""
        return self.end - self.start

    @property
    def share(self) -> float:
        """The part of the motion that has passed, 0 to 1."""
        return (self.now - self.start) / self.duration if self.duration > 0.0 else 0.0

    def cover(self, start: float, end: float) -> None:
        """Change to a motion of other length; the share that has passed stays."""
        share = self.share
        self.start, self.end = start, max(start, end)
        self.now = self.start + share * self.duration

    def advance(self, seconds: float) -> None:
        """Advance by ``seconds`` of real time."""
        if not self.playing or seconds <= 0.0:
            return
        if self.now < self.end:
            self.now = min(self.end, self.now + self.speed * seconds)
            self._waited = 0.0
        elif not self.loop:
            self.playing = False
        elif self._waited < PAUSE:
            self._waited += seconds
        else:
            self.now, self._waited = self.start, 0.0

    def toggle(self) -> None:
        """Play or pause; play at the end begins at the start."""
        self.playing = not self.playing
        if self.playing and self.now >= self.end:
            self.now = self.start

    def seek(self, time: float) -> None:
        """Show another instant, clipped to the motion."""
        self.now = min(max(time, self.start), self.end)
        self._waited = 0.0

    def step(self, seconds: float) -> None:
        """Pause, ``seconds`` of the motion later or, if negative, earlier."""
        self.playing = False
        self.seek(self.now + seconds)

    def faster(self, by: int = 1) -> None:
        """The next of :data:`SPEEDS`, or the one before for a negative ``by``."""
        nearest = min(range(len(SPEEDS)), key=lambda k: abs(SPEEDS[k] - self.speed))
        self.speed = SPEEDS[min(max(nearest + by, 0), len(SPEEDS) - 1)]
