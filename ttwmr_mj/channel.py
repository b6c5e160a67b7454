"""A channel with latency, jitter and loss, in whole control periods."""

from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.state import BoolArray, FloatArray

T = TypeVar("T")
IntArray = NDArray[np.int64]
BLOCK = 512  # periods for which delays and losses are drawn at once
NEVER = 2**61  # periods: larger than any run, and does not overflow when a latency is added


@dataclass(frozen=True, slots=True)
class Channel:
    """How messages, one per control period, are delayed and lost.

    Attributes:
        latency: smallest delay, in periods; one for all simulations, or (nsim,).
        jitter: largest additional delay, in periods; uniform from 0 for each message.
        drop_probability: of a message to be lost.
    """

    latency: int | IntArray = 0
    jitter: int | IntArray = 0
    drop_probability: float | FloatArray = 0.0

    @property
    def is_random(self) -> bool:
        """Whether delays or losses are random, in any simulation."""
        return bool(np.any(self.jitter) or np.any(self.drop_probability))


class Arrived(NamedTuple):
    """The newest message that each simulation's receiver has."""

    sent: IntArray  # (nsim,) period in which it was sent
    travel: IntArray  # (nsim,) its delay, in periods


class LatencyQueue(Generic[T]):
    """Delivers to every simulation the newest message that has arrived.

    A message that arrives after one that was sent later is discarded. The first message is there
    from the start, and is used until another has arrived.
    """

    def __init__(self, channel: Channel, rngs: list[np.random.Generator]) -> None:
        """Set up; every simulation has its own generator, whatever the batch."""
        self._channel, self._rngs = channel, rngs
        self._is_random = channel.is_random
        self._sent: dict[int, T] = {}
        self._arrival: dict[int, IntArray] = {}
        self._newest: IntArray = np.zeros(len(rngs), dtype=np.int64)
        self._travel: IntArray = np.full(len(rngs), channel.latency, dtype=np.int64)
        self._lost: BoolArray = np.zeros((0, len(rngs)), dtype=np.bool_)  # (BLOCK, nsim)
        self._late: IntArray = np.zeros((0, len(rngs)), dtype=np.int64)
        self._k = -1

    def exchange(self, fresh: T) -> Arrived:
        """Send this period's message; returns which message each receiver has now."""
        self._k += 1
        k, travel = self._k, self._drawn(self._k)
        self._sent[k] = fresh
        self._arrival[k] = k + travel
        for sent, arrival in self._arrival.items():
            here = (arrival <= k) & (sent > self._newest)
            self._newest[here] = sent
            self._travel[here] = (arrival - sent)[here]
        self._forget()
        return Arrived(self._newest.copy(), self._travel.copy())

    def item(self, sent: int) -> T:
        """The message sent in a period that the last `exchange` named."""
        return self._sent[sent]

    def _drawn(self, k: int) -> IntArray:
        """(nsim,) delay of the message sent in period k, in periods; NEVER if it is lost."""
        channel, rngs = self._channel, self._rngs
        latency = np.full(len(rngs), channel.latency, dtype=np.int64)
        if not self._is_random or k == 0:  # the first is never lost
            return latency
        if (k - 1) % BLOCK == 0:
            chance = np.array([rng.random(BLOCK) for rng in rngs]).T
            jitter = np.broadcast_to(channel.jitter, len(rngs)).tolist()
            late = [
                rng.integers(most, size=BLOCK, endpoint=True)
                for rng, most in zip(rngs, jitter, strict=True)
            ]
            self._lost = chance < channel.drop_probability
            self._late = np.array(late, dtype=np.int64).T
        block = (k - 1) % BLOCK
        return np.where(self._lost[block], NEVER, latency + self._late[block])

    def _forget(self) -> None:
        """Delete messages that no receiver has and none will get."""
        for sent in list(self._arrival):
            held = self._newest == sent
            coming = (self._newest < sent) & (self._arrival[sent] < NEVER)
            if not (held | coming).any():
                del self._sent[sent], self._arrival[sent]
