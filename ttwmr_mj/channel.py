"""What lies between a sender and a receiver: latency, jitter and loss, in whole control periods."""

from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.state import BoolArray

T = TypeVar("T")
IntArray = NDArray[np.int64]
BLOCK = 512  # periods whose fate is drawn at once
NEVER = 2**61  # a period that does not come, with room to add to


@dataclass(frozen=True, slots=True)
class Channel:
    """How a channel delays and loses what is sent once per control period.

    Attributes:
        latency: periods that everything takes.
        jitter: the most periods that one takes longer, drawn evenly from 0 to this.
        drop_probability: share that never arrives.
    """

    latency: int = 0
    jitter: int = 0
    drop_probability: float = 0.0

    @property
    def is_random(self) -> bool:
        """Whether anything is drawn."""
        return bool(self.jitter or self.drop_probability)


class Arrived(NamedTuple):
    """The newest that each simulation's receiver has."""

    sent: IntArray  # (nsim,) period in which it was sent
    travel: IntArray  # (nsim,) periods that its way takes


class LatencyQueue(Generic[T]):
    """Delivers to every simulation the newest of what has arrived.

    What arrives after something that was sent later is of no use and is not delivered. The first
    stands in, never lost, until another has arrived.
    """

    def __init__(self, channel: Channel, rngs: list[np.random.Generator]) -> None:
        """Set up; each simulation has its generator, so that it does not depend on the batch."""
        self._channel, self._rngs = channel, rngs
        self._sent: dict[int, T] = {}
        self._arrival: dict[int, IntArray] = {}
        self._newest: IntArray = np.zeros(len(rngs), dtype=np.int64)
        self._travel: IntArray = np.full(len(rngs), channel.latency, dtype=np.int64)
        self._lost: BoolArray = np.zeros((0, len(rngs)), dtype=np.bool_)  # (BLOCK, nsim)
        self._late: IntArray = np.zeros((0, len(rngs)), dtype=np.int64)
        self._k = -1

    def exchange(self, fresh: T) -> Arrived:
        """Put in what is sent in this period; what the receivers have now. `item` looks it up."""
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
        """What was sent in a period that `exchange` has just named."""
        return self._sent[sent]

    def _drawn(self, k: int) -> IntArray:
        """(nsim,) periods that what is sent in period k takes; NEVER if it is lost."""
        channel, rngs = self._channel, self._rngs
        latency = np.full(len(rngs), channel.latency, dtype=np.int64)
        if not channel.is_random or k == 0:  # the first is never lost: there is nothing else
            return latency
        if (k - 1) % BLOCK == 0:
            lost = np.array([rng.random(BLOCK) for rng in rngs]) < channel.drop_probability
            late = [rng.integers(channel.jitter, size=BLOCK, endpoint=True) for rng in rngs]
            self._lost, self._late = lost.T, np.array(late, dtype=np.int64).T
        block = (k - 1) % BLOCK
        return np.where(self._lost[block], NEVER, latency + self._late[block])

    def _forget(self) -> None:
        """Drop what no receiver has and none will get."""
        for sent in list(self._arrival):
            held = self._newest == sent
            coming = (self._newest < sent) & (self._arrival[sent] < NEVER)
            if not (held | coming).any():
                del self._sent[sent], self._arrival[sent]
