"""The queues of responses, events and traces; those of a topic that the broker refuses wait apart. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Set as AbstractSet

from lfs10d.outbox.items import Message
from lfs10d.telemetry.publication import PublicationKind

MESSAGES_MOST = 1000
"""Most responses and events that wait while the broker is away, and traces while it is slow; the oldest are dropped."""


class MessageQueue:
    """Two queues, each in order of arrival: responses and events, and traces."""

    def __init__(self) -> None:
        self.messages: deque[Message] = deque(maxlen=MESSAGES_MOST)
        """Responses and events."""
        self.traces: deque[Message] = deque(maxlen=MESSAGES_MOST)
        self._passed_over: deque[Message] = deque(maxlen=MESSAGES_MOST)

    def __bool__(self) -> bool:
        """Return whether anything waits that the broker does not refuse."""
        return bool(self.messages or self.traces)

    def take(self, queue: deque[Message], refused: AbstractSet[str]) -> Message | None:
        """Take the next of `messages` or `traces`; those on `refused` topics are passed over."""
        while queue:
            message = queue.popleft()
            if message.topic not in refused:
                return message
            self.pass_over(message)
        return None

    def pass_over(self, message: Message) -> None:
        """Let a message wait until its topic is tried again; a trace is dropped."""
        if message.publication.kind is not PublicationKind.TRACE:
            self._passed_over.append(message)

    def put_back(self, message: Message) -> None:
        """Let a message that was under way go first, if there is room; one of QoS 0 is dropped."""
        if message.publication.qos and len(self.messages) < MESSAGES_MOST:
            self.messages.appendleft(message)

    def lifted(self, topics: AbstractSet[str]) -> None:
        """Let what was passed over of these topics go first."""
        again = [message for message in self._passed_over if message.topic in topics]
        self.messages.extendleft(reversed(again))
        self._passed_over = deque((each for each in self._passed_over if each.topic not in topics), MESSAGES_MOST)
