"""A ROS 2 node over Zenoh without ROS: publishers, subscriptions, services and their clients.

Threads: the subscriptions and services of a node share threads, made as they are needed. Each
handles its messages one after the other, and none waits for another: a slow callback delays only
its own topic. With `direct=True` the callback runs on Zenoh's network thread instead, but it must
return at once. `put` may take 1 ms (50 ms for large messages), so it does not belong in a control
thread.

There is no latching: a topic whose last value new subscribers need is published periodically.
"""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar, overload

import zenoh
import zenoh.ext as extended
from zenoh.handlers import Callback, RingChannel

from quadrotor.errors import LinkError, QuadlabError
from vehicle_link import clock, defects
from vehicle_link.messages import Message, decode, encode
from vehicle_link.topics.rmw_keys import (
    RELIABLE,
    SENSOR_DATA,
    EntityKind,
    NodeIdentity,
    Qos,
    attachment,
    data_key,
    full_name,
    gid_of,
    parse_attachment,
)
from vehicle_link.transport.client import ServiceClient, encoding_of, peer_of
from vehicle_link.transport.executor_queue import ExecutorQueue
from vehicle_link.transport.idempotent import answering
from vehicle_link.transport.misrouted import PublisherTopics
from vehicle_link.transport.publisher import AnyPublisher, OtherPath, Publisher, Received

if TYPE_CHECKING:
    from vehicle_link.messages.records import Answer, ServiceName
    from vehicle_link.topics.table import Priority, Topic

log = logging.getLogger(__name__)
A = TypeVar("A", bound=Message)
Q = TypeVar("Q", bound=Message)

# One counter for each session numbers nodes and endpoints (rmw_zenoh).
_counters: dict[str, itertools.count[int]] = {}
_counters_lock = threading.Lock()
_published = PublisherTopics()
PUT_LONGEST = 2.0  # s
MAX_THREADS = 64
"""Limit of a node's threads: more than subscriptions and services are active at one time."""


class Node:
    """One node of a session; topic and service names are relative to its namespace.

    Args:
        namespace: `/quad1`, or empty.
        name: for instance `vehicle`; must not contain a slash.
    """

    def __init__(self, session: zenoh.Session, namespace: str, name: str, domain: int = 0) -> None:
        zid = str(session.info.zid())
        with _counters_lock:
            self._ids = _counters.setdefault(zid, itertools.count())
        self.session = session
        self.namespace = f"/{namespace.strip('/')}" if namespace.strip("/") else ""
        self.name = name
        self.full_name = full_name(self.namespace, name)
        self.domain = domain
        self._identity = NodeIdentity(zid, next(self._ids), self.namespace, name, domain)
        self._entities: list[object] = []
        self._pool = ThreadPoolExecutor(MAX_THREADS, thread_name_prefix=self.full_name)
        self._is_closing = False
        self._declare_token(self._identity.token)

    def advertise(self, topic: Topic, other: OtherPath | None = None) -> Publisher:
        """Make a publisher as the table of topics defines it.

        Args:
            other: another path that its messages take as well.
        """
        key, gid = self._announce("MP", topic.name, topic.type_name, topic.qos)
        declare: Callable[..., AnyPublisher] = partial(self.session.declare_publisher, key)
        if topic.kept:
            declare = partial(
                extended.declare_advanced_publisher,
                self.session,
                key,
                cache=extended.CacheConfig(topic.kept),
                sample_miss_detection=extended.MissDetectionConfig(),  # type: ignore[call-arg]
            )
        reliable = topic.qos.reliable
        congestion, trust = zenoh.CongestionControl, zenoh.Reliability
        publisher = declare(
            priority=getattr(zenoh.Priority, topic.priority.upper()),
            express=topic.express,
            congestion_control=congestion.BLOCK if reliable else congestion.DROP,
            reliability=trust.RELIABLE if reliable else trust.BEST_EFFORT,
        )
        self._entities.append(publisher)
        return Publisher(publisher, gid, other)

    def subscribe(
        self,
        topic: str,
        type_name: str,
        callback: Callable[[Received], None],
        *,
        qos: Qos = SENSOR_DATA,
        direct: bool = False,
        newest: int = 0,
        frequent: bool = False,
        complete: bool = False,
    ) -> None:
        """Call back with each message; the module docstring describes the threads.

        With `newest` a callback that falls behind gets only that many of the latest messages: for
        data that are worthless when late. Otherwise all messages wait for their turn, however long.
        If they are also `frequent`, the topic has a thread of its own, which takes each message in
        two thirds of the time that a shared one needs. With `complete`, what was lost
        meanwhile of a topic that is kept comes later, in its order.

        An exception from the callback is logged with its traceback and ends that call only. A
        sample without ROS attachment is logged and dropped.
        """

        key, _ = self._announce("MS", topic, type_name, qos)

        def deliver(arrived: tuple[zenoh.Sample, int]) -> None:
            sample, received_ns = arrived
            try:
                data = sample.attachment
                sequence, source_ns, gid = parse_attachment(data.to_bytes() if data else b"")
                if not _published.belongs(gid, key):
                    log.warning("a message of another topic arrived as %s and was dropped", topic)
                    return
                payload = sample.payload.to_bytes()
                callback(Received(payload, sequence, source_ns, received_ns, gid))
            except MemoryError as error:
                defects.report(error)
            except Exception:
                log.exception("a message of %s could not be handled", topic)

        subscriber: object
        if newest and frequent:
            subscriber = self.session.declare_subscriber(key, RingChannel(newest))
            threading.Thread(
                target=_each, args=(subscriber, deliver), name=topic, daemon=True
            ).start()
        else:
            samples = ExecutorQueue(self._pool, deliver, newest=newest)

            def arrived(sample: zenoh.Sample) -> None:
                if direct:
                    return deliver((sample, clock.time_ns()))
                try:
                    samples.put((sample, clock.time_ns()))
                except (MemoryError, RuntimeError) as error:
                    self._not_queued(error)

            declare = _declare_complete if complete else zenoh.Session.declare_subscriber
            subscriber = declare(self.session, key, Callback(arrived, indirect=False))
        self._entities.append(subscriber)

    def serve(
        self,
        name: str,
        srv_type: str,
        handler: Callable[[Q], Message],
        *,
        direct: bool = False,
        at_once: int = 1,
    ) -> None:
        """Answer requests of a service one by one; the module docstring describes the threads.

        With `at_once` above 1 that many are handled at the same time, so none waits for a slow one.

        A QuadlabError of the handler becomes an answer, not accepted and with the text as the
        reason, if the response has such fields; otherwise a LinkError with the same text at the
        client. A NoAnswerError is passed to the client: it is unknown what became of the request.
        Any other error is logged with its traceback and reported to the client.
        """
        key, _ = self._announce("SS", name, srv_type, RELIABLE)
        handle = answering(srv_type, handler)

        def answer(query: zenoh.Query) -> None:
            with query:  # finishes the query also when nothing was replied
                try:
                    data = query.attachment
                    sequence, _, gid = parse_attachment(data.to_bytes() if data else b"")
                    payload = query.payload.to_bytes() if query.payload else b""
                    response = encode(handle(decode(payload, f"{srv_type}_Request")))
                    stamped = attachment(sequence, clock.time_ns(), gid)
                    query.reply(key, response, attachment=stamped)
                except MemoryError as error:
                    defects.report(error)
                except QuadlabError as error:
                    query.reply_err(str(error).encode(), encoding=encoding_of(error))
                except Exception as error:
                    log.exception("service %s failed", name)
                    reason = f"a defect of {peer_of(name)}, see its log: {error!r}"
                    query.reply_err(reason.encode())

        queries = ExecutorQueue(self._pool, answer, at_once)

        def hand_over(query: zenoh.Query) -> None:
            try:
                queries.put(query)
            except (MemoryError, RuntimeError) as error:
                self._not_queued(error)
                log.debug("service %s was asked while it closes", name)
                with query:
                    query.reply_err(f"{peer_of(name)} is closing".encode())

        called_back = Callback(answer if direct else hand_over, indirect=False)
        self._entities.append(self.session.declare_queryable(key, called_back, complete=True))

    @overload
    def client(  # type: ignore[overload-overlap]  # two services of the table cannot refuse
        self, name: str, srv_type: ServiceName[A], *, priority: Priority = ...
    ) -> ServiceClient[A]: ...

    @overload
    def client(
        self, name: str, srv_type: str, *, priority: Priority = ...
    ) -> ServiceClient[Answer]: ...

    def client(
        self, name: str, srv_type: str, *, priority: Priority = "interactive_high"
    ) -> ServiceClient[Message]:
        """Make a client; `priority` applies to its requests and to their answers."""
        key, gid = self._announce("SC", name, srv_type, RELIABLE)
        return ServiceClient(
            self.session,
            full_name(self.namespace, name),
            key,
            srv_type,
            gid,
            getattr(zenoh.Priority, priority.upper()),
        )

    def close(self) -> None:
        """Undeclare everything of this node; its session stays open."""
        self._is_closing = True
        while self._entities:
            _undeclare(self._entities.pop())
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _not_queued(self, error: Exception) -> None:
        """Handle an error of the pool, which takes nothing after `close`; before that, the system
        gives it no thread or no memory.
        """
        if not self._is_closing:
            defects.report(error)

    def _announce(self, kind: EntityKind, name: str, type_name: str, qos: Qos) -> tuple[str, bytes]:
        """Declare the token of a new endpoint; return its key and GID."""
        topic = full_name(self.namespace, name)
        token = self._identity.endpoint_token(next(self._ids), kind, topic, type_name, qos)
        self._declare_token(token)
        return data_key(self.domain, topic, type_name), gid_of(token)

    def _declare_token(self, token: str) -> None:
        try:
            self._entities.append(self.session.liveliness().declare_token(token))
        except zenoh.ZError as error:
            raise LinkError(f"cannot announce {self.full_name}: {error}") from error


def _declare_complete(session: zenoh.Session, key: str, handler: Callback[zenoh.Sample]) -> Any:
    recovery = extended.RecoveryConfig(heartbeat=True)  # type: ignore[call-arg]
    return extended.declare_advanced_subscriber(session, key, handler, recovery=recovery)


def _each(samples: Any, deliver: Callable[[tuple[zenoh.Sample, int]], None]) -> None:
    """Deliver each sample until the subscription is undeclared."""
    for sample in samples:
        deliver((sample, clock.time_ns()))


def _undeclare(entity: Any) -> None:
    """Undeclare; wait for a `put` of another thread, during which Zenoh cannot close it."""
    until = time.monotonic() + PUT_LONGEST
    while True:
        try:
            entity.undeclare()
            return
        except RuntimeError as error:
            if "borrowed" not in str(error) or time.monotonic() > until:
                raise
            time.sleep(0.001)
