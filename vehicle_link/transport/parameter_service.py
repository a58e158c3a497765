"""The six parameter services of a ROS 2 node, so that `ros2 param` and rqt find our parameters,
and the client that quadlab itself uses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from quadrotor.errors import ParameterError
from quadrotor.parameter_description import ParameterDescription, ParameterValue
from vehicle_link.messages import Message, new, records
from vehicle_link.parameters.messages import (
    ROS_TYPES,
    from_descriptor,
    from_parameters,
    from_value,
    to_descriptor,
    to_parameters,
    to_value,
)
from vehicle_link.transport.node import Node

NAMES_A_CALL = 50
"""Number of descriptions requested at a time: about 15 kB, quick even on a lossy link."""

ROS_REQUESTER = "ros2 param"
"""Requester in the log, as these services do not say who asks."""


class ParameterBackend(Protocol):
    """The authority behind the services; called on their threads."""

    def descriptions(self) -> Sequence[ParameterDescription]: ...

    def values(self) -> Mapping[str, ParameterValue]: ...

    def change(
        self, values: Mapping[str, ParameterValue], requester: str
    ) -> tuple[Mapping[str, ParameterValue], int]:
        """Change values, all or nothing; return (applied values, revision). Raises
        ParameterError.
        """
        ...


def serve_parameters(node: Node, backend: ParameterBackend) -> None:
    """Serve `<node>/get_parameters` and its five siblings until the node is closed."""
    service = _ParameterService(backend)
    for name in (
        "GetParameters",
        "SetParameters",
        "SetParametersAtomically",
        "ListParameters",
        "GetParameterTypes",
        "DescribeParameters",
    ):
        handler = getattr(service, _snake(name))
        node.serve(f"{node.full_name}/{_snake(name)}", f"rcl_interfaces/srv/{name}", handler)


class _ParameterService:
    """Handlers, one method for each service: request message in, response message out."""

    def __init__(self, backend: ParameterBackend) -> None:
        self._backend = backend

    def get_parameters(self, request: records.GetParametersRequest) -> Message:
        values = self._backend.values()
        unset = new("rcl_interfaces/ParameterValue")
        found = [to_value(values[n]) if n in values else unset for n in request.names]
        return new("rcl_interfaces/srv/GetParameters_Response", values=found)

    def set_parameters(self, request: records.SetParametersRequest) -> Message:
        """Set each parameter separately, as ROS 2 specifies: a refused one does not stop the
        others.
        """
        results = [self._set([parameter]) for parameter in request.parameters]
        return new("rcl_interfaces/srv/SetParameters_Response", results=results)

    def set_parameters_atomically(self, request: records.SetParametersAtomicallyRequest) -> Message:
        result = self._set(request.parameters)
        return new("rcl_interfaces/srv/SetParametersAtomically_Response", result=result)

    def list_parameters(self, request: records.ListParametersRequest) -> Message:
        """List the names below any of the prefixes, at most `depth` levels deep (0 = all)."""
        names = [
            name
            for name in self._backend.values()
            if any(_below(name, prefix, int(request.depth)) for prefix in request.prefixes or [""])
        ]
        prefixes = sorted({name.rpartition(".")[0] for name in names} - {""})
        return new(
            "rcl_interfaces/srv/ListParameters_Response",
            result={"names": names, "prefixes": prefixes},
        )

    def get_parameter_types(self, request: records.GetParameterTypesRequest) -> Message:
        kinds = {d.name: ROS_TYPES[d.type] for d in self._backend.descriptions()}
        types = [kinds.get(name, 0) for name in request.names]
        return new("rcl_interfaces/srv/GetParameterTypes_Response", types=types)

    def describe_parameters(self, request: records.DescribeParametersRequest) -> Message:
        known = {d.name: d for d in self._backend.descriptions()}
        descriptors = [
            to_descriptor(known[name])
            if name in known
            else new("rcl_interfaces/ParameterDescriptor", name=name)
            for name in request.names
        ]
        return new("rcl_interfaces/srv/DescribeParameters_Response", descriptors=descriptors)

    def _set(self, parameters: Sequence[records.Parameter]) -> Message:
        try:
            self._backend.change(from_parameters(parameters), ROS_REQUESTER)
        except ParameterError as error:
            return new("rcl_interfaces/SetParametersResult", successful=False, reason=str(error))
        return new("rcl_interfaces/SetParametersResult", successful=True)


class ParameterClient:
    """Client of the parameters of another node.

    Args:
        remote_node: its full name (`/quad1/vehicle`), or its name relative to the namespace of
            `node`.
        timeout: seconds for each call.
    """

    def __init__(self, node: Node, remote_node: str, timeout: float = 2.0) -> None:
        self._timeout = timeout
        self._list = node.client(
            f"{remote_node}/list_parameters", "rcl_interfaces/srv/ListParameters"
        )
        self._describe = node.client(
            f"{remote_node}/describe_parameters", "rcl_interfaces/srv/DescribeParameters"
        )
        self._get = node.client(f"{remote_node}/get_parameters", "rcl_interfaces/srv/GetParameters")
        self._set = node.client(
            f"{remote_node}/set_parameters_atomically", "rcl_interfaces/srv/SetParametersAtomically"
        )

    def names(self) -> list[str]:
        """Return all names, in the authority's order. Raises LinkError, as all methods here do."""
        request = new("rcl_interfaces/srv/ListParameters_Request")
        return list(self._list.call(request, self._timeout).result.names)

    def describe(self) -> list[ParameterDescription]:
        """Fetch the descriptions of all parameters. Raises LinkError."""
        descriptions: list[ParameterDescription] = []
        for names in _portions(self.names()):
            request = new("rcl_interfaces/srv/DescribeParameters_Request", names=names)
            response = self._describe.call(request, self._timeout)
            descriptions += map(from_descriptor, response.descriptors)
        return descriptions

    def values(self) -> dict[str, ParameterValue]:
        """Fetch the values of all parameters. Raises LinkError."""
        values: dict[str, ParameterValue] = {}
        for names in _portions(self.names()):
            request = new("rcl_interfaces/srv/GetParameters_Request", names=names)
            response = self._get.call(request, self._timeout)
            values.update(zip(names, map(from_value, response.values), strict=True))
        return values

    def set(self, values: Mapping[str, ParameterValue]) -> None:
        """Set values, all or nothing.

        Raises:
            ParameterError: refused; the text is the authority's.
            LinkError: no answer, so it is unknown whether they were set.
        """
        request = new(
            "rcl_interfaces/srv/SetParametersAtomically_Request", parameters=to_parameters(values)
        )
        result = self._set.call(request, self._timeout).result
        if not result.successful:
            raise ParameterError(str(result.reason))


def _portions(names: list[str]) -> list[list[str]]:
    return [names[i : i + NAMES_A_CALL] for i in range(0, len(names), NAMES_A_CALL)]


def _below(name: str, prefix: str, depth: int) -> bool:
    if prefix and name != prefix and not name.startswith(f"{prefix}."):
        return False
    rest = name[len(prefix) :].strip(".")
    return depth == 0 or rest.count(".") < depth


def _snake(name: str) -> str:
    return "".join(f"_{c.lower()}" if c.isupper() else c for c in name).strip("_")
